# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
URDFs with something changed, and values of parameters, as hypothesis draws them.

A URDF is changed in its tree, where most changes leave something that can be parsed, or in its
text. Both start from arms that are in order.
"""

from collections.abc import Callable, Sequence
import copy
from typing import Any
import xml.etree.ElementTree as ElementTree

from fuzz_strategies import Draw, mostly, small_numbers, wild_numbers, wild_texts
from hypothesis import strategies as st
from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.msg import ParameterValue
from robot_dynamics.ros.declared_parameters import ParameterSpec, Type

WORDS_FOR_NUMBERS = (
    '', ' ', '0', '-0', '-1', '1e-320', '1e-30', '1e9', '1e30', '-1e200', '1e308', '1e400', 'nan',
    'inf', '-inf', '0x10', '1_000', '1,5', '1.', '٣', 'one', '1 2', '0 0 0', '1 2 3 4',
    '1e308 1e308 1e308', '0 0 nan', '1e-200 0 0', '1e200 0 0', '3.2 -1.5 0.7', '${pi}', '&#48;')
_TAGS = (
    'link', 'joint', 'inertial', 'mass', 'inertia', 'origin', 'axis', 'limit', 'dynamics', 'mimic',
    'parent', 'child', 'collision', 'geometry', 'box', 'transmission', 'robot')
_KINDS = ('revolute', 'continuous', 'prismatic', 'fixed', 'floating', 'planar', 'spherical', '')
_likely_numbers = st.floats(0.01, 3.0).map(repr)
_number_texts = st.one_of(
    _likely_numbers, _likely_numbers, small_numbers.map(repr), wild_numbers.map(repr),
    st.sampled_from(WORDS_FOR_NUMBERS))
_CHANGE_COUNTS = st.sampled_from((1, 1, 1, 2, 3))
_MARKUP = st.text(alphabet='<>/="\'&;![]-? \n\t\x00a0é', max_size=8)


# ---------------------------------------------------------------------------------- trees

def _change_attribute(draw: Draw, root: ElementTree.Element) -> None:
    element = draw(st.sampled_from([e for e in root.iter() if e.attrib]))
    attribute = draw(st.sampled_from(sorted(element.attrib)))
    text = element.attrib[attribute]
    if attribute == 'type':
        element.attrib[attribute] = draw(st.sampled_from(_KINDS))
    elif text.strip('-+.0123456789 e'):  # a name
        names = [e.get('name', '') for e in root.iter() if e.get('name')]
        element.attrib[attribute] = draw(st.one_of(st.sampled_from(names), wild_texts))
    else:
        words = text.split() or ['0']
        words[draw(st.integers(0, len(words) - 1))] = draw(_number_texts)
        element.attrib[attribute] = ' '.join(words)


def _remove_attribute(draw: Draw, root: ElementTree.Element) -> None:
    element = draw(st.sampled_from([e for e in root.iter() if e.attrib]))
    del element.attrib[draw(st.sampled_from(sorted(element.attrib)))]


def _add_attribute(draw: Draw, root: ElementTree.Element) -> None:
    element = draw(st.sampled_from(list(root.iter())))
    name = draw(st.sampled_from(
        ('name', 'value', 'lower', 'upper', 'damping', 'friction', 'xyz', 'multiplier', 'joint')))
    element.set(name, draw(st.sampled_from(WORDS_FOR_NUMBERS)))


def _parent_and_child(draw: Draw, root: ElementTree.Element) -> tuple[Any, Any]:
    return draw(st.sampled_from([(parent, child) for parent in root.iter() for child in parent]))


def _remove_element(draw: Draw, root: ElementTree.Element) -> None:
    parent, child = _parent_and_child(draw, root)
    if len(list(root.iter())) > 2:
        parent.remove(child)


def _copy_element(draw: Draw, root: ElementTree.Element) -> None:
    _, child = _parent_and_child(draw, root)
    draw(st.sampled_from(list(root.iter()))).append(copy.deepcopy(child))


def _rename_element(draw: Draw, root: ElementTree.Element) -> None:
    draw(st.sampled_from(list(root.iter()))).tag = draw(st.sampled_from(_TAGS))


def _change_text(draw: Draw, root: ElementTree.Element) -> None:
    draw(st.sampled_from(list(root.iter()))).text = draw(st.sampled_from(WORDS_FOR_NUMBERS))


_CHANGES: Sequence[Callable[[Draw, ElementTree.Element], None]] = (
    _change_attribute, _change_attribute, _change_attribute, _change_attribute,
    _remove_attribute, _add_attribute, _remove_element, _copy_element, _rename_element,
    _change_text)


# ---------------------------------------------------------------------------------- texts

def _change_characters(draw: Draw, xml: str) -> str:
    """Cut a piece out of the text, put something else in its place, or end it early."""
    begin = draw(st.integers(0, len(xml)))
    end = begin + draw(st.integers(0, 30))
    what = draw(st.integers(0, 3))
    if what == 0:
        return xml[:begin]
    if what == 1:
        return xml[:begin] + xml[end:]
    if what == 2:
        return xml[:begin] + draw(_MARKUP) + xml[end:]
    return xml[:begin] + draw(st.text(max_size=5)) + xml[begin:]


def _random_bytes(draw: Draw) -> str:
    """Bytes as a node has them that took them for UTF-8."""
    return str(draw(st.binary(max_size=200)).decode('utf-8', 'replace'))


@st.composite
def urdfs(draw: Draw, bases: Sequence[str]) -> str:
    """Draw a URDF with up to three changes."""
    base = draw(st.sampled_from(bases))
    what = draw(st.integers(0, 19))
    if what == 0:
        return _random_bytes(draw)
    if what <= 3:
        return _change_characters(draw, base)
    root = ElementTree.fromstring(base)
    for _ in range(0 if what == 4 else draw(_CHANGE_COUNTS)):
        draw(st.sampled_from(_CHANGES))(draw, root)
    return ElementTree.tostring(root, encoding='unicode')


# ---------------------------------------------------------------------------------- parameters

def _good_numbers(spec: ParameterSpec) -> st.SearchStrategy[float]:
    low = -1e3 if spec.minimum is None else float(spec.minimum)
    high = 1e3 if spec.maximum is None else float(spec.maximum)
    return st.one_of(
        st.floats(max(low, -10.0), min(high, 10.0)), st.floats(low, high), st.just(high))


@st.composite
def good_values(draw: Draw, spec: ParameterSpec, joints: int) -> Any:
    """Draw a value of the type of a parameter, within its range; arrays of the usual lengths."""
    if spec.kind is Type.BOOL:
        return draw(st.booleans())
    if spec.kind is Type.INTEGER:
        return draw(st.integers(int(spec.minimum or 0), int(spec.maximum or 100)))
    if spec.kind is Type.DOUBLE:
        return draw(_good_numbers(spec))
    texts = st.sampled_from(spec.choices) if spec.choices else wild_texts
    if spec.kind is Type.STRING:
        return draw(texts)
    if spec.kind is Type.STRING_ARRAY:
        return draw(st.lists(texts, max_size=3))
    length = 3 if spec.name == 'gravity' else draw(st.sampled_from((0, 1, 1, joints)))
    return draw(st.lists(_good_numbers(spec), min_size=length, max_size=length))


@st.composite
def spoiled_values(draw: Draw, spec: ParameterSpec) -> Any:
    """Draw a value of the type of a parameter that it may not have."""
    if spec.kind in (Type.BOOL, Type.INTEGER):
        return draw(good_values(spec, 1))
    if spec.kind is Type.DOUBLE:
        return draw(wild_numbers)
    if spec.kind is Type.STRING:
        return draw(wild_texts)
    if spec.kind is Type.STRING_ARRAY:
        return draw(st.lists(wild_texts, max_size=300))
    return draw(st.lists(st.one_of(small_numbers, wild_numbers), max_size=9))


def values(spec: ParameterSpec, joints: int, fraction: float = 0.85) -> st.SearchStrategy[Any]:
    """Draw a value of the type of a parameter."""
    return mostly(good_values(spec, joints), spoiled_values(spec), fraction)


def _any_value() -> st.SearchStrategy[ParameterValue]:
    """Draw a value of any type."""
    whole = st.integers(-2**63, 2**63 - 1)
    number = st.one_of(small_numbers, wild_numbers)

    def of(kind: Any, field: str, value: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
        return value.map(lambda v: ParameterValue(type=kind.value, **{field: v}))

    return st.one_of(
        st.just(ParameterValue()),
        of(Type.BOOL, 'bool_value', st.booleans()), of(Type.INTEGER, 'integer_value', whole),
        of(Type.DOUBLE, 'double_value', number), of(Type.STRING, 'string_value', wild_texts),
        of(Type.BYTE_ARRAY, 'byte_array_value', st.lists(st.binary(min_size=1, max_size=1))),
        of(Type.BOOL_ARRAY, 'bool_array_value', st.lists(st.booleans(), max_size=3)),
        of(Type.INTEGER_ARRAY, 'integer_array_value', st.lists(whole, max_size=3)),
        of(Type.DOUBLE_ARRAY, 'double_array_value', st.lists(number, max_size=300)),
        of(Type.STRING_ARRAY, 'string_array_value', st.lists(wild_texts, max_size=3)))


_FIELDS = {
    Type.BOOL: 'bool_value', Type.INTEGER: 'integer_value', Type.DOUBLE: 'double_value',
    Type.STRING: 'string_value', Type.DOUBLE_ARRAY: 'double_array_value',
    Type.STRING_ARRAY: 'string_array_value'}


@st.composite
def parameter_messages(draw: Draw, specs: Sequence[ParameterSpec], joints: int) -> ParameterMsg:
    """Draw a parameter to set, as `ros2 param set` sends it."""
    spec = draw(st.sampled_from(specs))
    if draw(st.integers(0, 9)) == 0:
        return ParameterMsg(name=draw(mostly(st.just(spec.name), wild_texts)),
                            value=draw(_any_value()))
    value = ParameterValue(type=spec.kind.value)
    setattr(value, _FIELDS[spec.kind], draw(values(spec, joints)))
    return ParameterMsg(name=spec.name, value=value)
