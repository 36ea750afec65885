# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Read a URDF: its joints, limits, friction and mimic relations, checked and with clear errors.

Only the elements that dynamics needs are read; other modules read the geometry. Source: the URDF
XML specification, `joint` and `link` elements.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
import math
from typing import NamedTuple
import xml.etree.ElementTree as ElementTree

from robot_dynamics.exceptions import ModelError
from robot_dynamics.urdf.document import check_document
from robot_dynamics.urdf.pinocchio_xml import INERTIA_ENTRIES, pinocchio_urdf
from robot_dynamics.urdf.transmissions import read_reductions, Reductions
from robot_dynamics.validation import LARGEST_VALUE, SMALLEST_DIVISOR

MOVING_KINDS = ('revolute', 'continuous', 'prismatic')
SUPPORTED_KINDS = (*MOVING_KINDS, 'fixed')

_SHORTEST_AXIS = 1e-9
"""Shortest length of a direction, which a parser normalises; its square must not underflow."""
_CHUNK = 2**16
MOST_LINKS = 500
"""Largest number of links; the recursive parser of Pinocchio crashes for thousands of them."""
MOST_TAGS = 100_000
"""Largest number of XML tags, including geometry; their deallocation blocks other threads."""


class Mimic(NamedTuple):
    """This joint's position is multiplier × the leader's position + offset."""

    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class UrdfJoint:
    """
    One joint of a URDF; units are [rad, N·m] if it turns, [m, N] if it slides.

    An absent limit is infinite; so is an effort or velocity limit of 0, which exporters write for
    "not known", and any limit beyond LARGEST_VALUE.
    """

    name: str
    kind: str
    parent: str
    child: str
    lower: float
    upper: float
    velocity_limit: float
    effort_limit: float
    viscous_friction: float
    coulomb_friction: float
    mimic: Mimic | None

    @property
    def moves(self) -> bool:
        return self.kind in MOVING_KINDS


@dataclass(frozen=True)
class UrdfRobot:
    """A checked URDF: a tree of links from one root, joints in the order of the document."""

    name: str
    root_link: str
    link_names: tuple[str, ...]
    joints: tuple[UrdfJoint, ...]
    pinocchio_xml: str
    """The same tree for Pinocchio: continuous joints as unlimited revolute ones (one coordinate
    each instead of cosine and sine), no geometry, no mimic relations."""
    reductions: Reductions = field(default_factory=dict)
    """The reductions that transmissions state, by joint; see `transmissions`."""

    def joint(self, name: str) -> UrdfJoint:
        return next(joint for joint in self.joints if joint.name == name)


def parse_urdf(xml: str) -> UrdfRobot:
    """
    Parse and check the text of a URDF.

    Raises ModelError if the text is not a URDF, if the links are not a tree (a loop), if a joint
    has more than one degree of freedom, or for non-numeric values.
    """
    root = robot_element(xml)
    name = root.get('name') or ''
    link_names = tuple(_names_of(root.findall('link'), 'link'))
    if not link_names:
        hint = (': its text declares xmlns:xacro, is it a xacro file without its robot?'
                if 'xmlns:xacro' in xml else '')
        raise _error(f'robot {name!r} has no links, expected at least two{hint}')
    if len(link_names) > MOST_LINKS:
        raise _error(f'robot {name!r} has {len(link_names)} links, expected at most {MOST_LINKS}')
    for link in root.findall('link'):
        _check_inertial(link)
    elements = root.findall('joint')
    _names_of(elements, 'joint')
    joints = tuple(_parse_joint(element, link_names) for element in elements)
    root_link = _check_tree(link_names, joints)
    _check_mimics(joints)
    return UrdfRobot(
        name, root_link, link_names, joints, pinocchio_urdf(root), read_reductions(root))


def safety_controllers(xml: str) -> dict[str, float]:
    """Return k_velocity [N·m·s/rad] or [N·s/m] of each `<safety_controller>`, by joint."""
    return {
        joint.get('name') or '': _number(
            joint.find('safety_controller'), 'k_velocity', 0.0, f'joint {joint.get("name")!r}')
        for joint in robot_element(xml).findall('joint')
        if joint.find('safety_controller') is not None}


def resolve_mimic(joint: UrdfJoint, joints: Iterable[UrdfJoint]) -> Mimic:
    """
    Return the relation of a joint to the joint at the head of its chain of leaders.

    A joint that mimics no other is its own leader.
    """
    by_name = {other.name: other for other in joints}
    relation = joint.mimic or Mimic(joint.name, 1.0, 0.0)
    while (link := by_name[relation.leader].mimic) is not None:
        relation = Mimic(
            link.leader, relation.multiplier * link.multiplier,
            relation.multiplier * link.offset + relation.offset)
    return relation


def links_from(joints: Iterable[UrdfJoint], links: Iterable[str]) -> set[str]:
    """Return links and all links that they carry."""
    found, frontier = set(links), list(links)
    while frontier:
        parent = frontier.pop()
        children = [joint.child for joint in joints if joint.parent == parent]
        found.update(children)
        frontier += children
    return found


def _error(words: str) -> ModelError:
    return ModelError(f'robot_description: {words}')


def robot_element(xml: str) -> ElementTree.Element:
    """Return the root element, without a namespace; raise ModelError if it is no expanded URDF."""
    if not xml.strip():
        raise ModelError('robot_description is empty, expected the XML of a URDF')
    check_document(xml)
    if xml.count('<') > MOST_TAGS:
        raise ModelError(
            f'robot_description has {xml.count("<")} tags, expected at most {MOST_TAGS}')
    try:
        text, parser = xml.strip(), ElementTree.XMLParser()
        for i in range(0, len(text), _CHUNK):  # in parts: the parser blocks all other threads
            parser.feed(text[i:i + _CHUNK])
        root: ElementTree.Element = parser.close()
    except (ElementTree.ParseError, ValueError) as error:
        raise ModelError(
            f'robot_description is not well-formed XML ({error}), expected a URDF; '
            f'it begins with {xml.strip()[:40]!r}') from None
    # A default namespace has no meaning in URDF, and other readers ignore it.
    namespace = root.tag[:root.tag.find('}') + 1]
    for element in root.iter():
        element.tag = element.tag.removeprefix(namespace)
    if root.tag != 'robot':
        raise ModelError(f'robot_description has the root element <{root.tag}>, expected <robot>')
    _check_expanded(root)
    return root


def _check_expanded(root: ElementTree.Element) -> None:
    for element in root.iter():
        namespace, _, tag = element.tag.rpartition('}')
        if 'xacro' in namespace:
            name = f' name={element.get("name")!r}' if element.get('name') else ''
            raise ModelError(
                f'robot_description is a xacro file, it has <xacro:{tag}{name}>, '
                'expected the URDF that the program xacro makes of it')


def _names_of(elements: Iterable[ElementTree.Element], what: str) -> list[str]:
    names: dict[str, None] = {}
    for element in elements:
        name = element.get('name')
        if not name:
            raise _error(f'a <{what}> has no name')
        if name in names:
            raise _error(f'two {what}s are named {name!r}')
        names[name] = None
    return list(names)


def _number(
    element: ElementTree.Element | None, attribute: str, default: float, where: str,
) -> float:
    text = None if element is None else element.get(attribute)
    if text is None or not text.strip():
        return default
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if math.isnan(value):
        raise _error(f'{where}: {attribute}={text!r}, expected a number')
    return value


def _finite(
    element: ElementTree.Element | None, attribute: str, default: float, where: str,
    expected: str, least: float = -math.inf, name: str = '',
) -> float:
    """Return a finite number of at least `least`; `name` replaces the attribute in errors."""
    value = _number(element, attribute, default, where)
    if not (math.isfinite(value) and value >= least):
        given = f'{name} is {value:g}' if name else f'{attribute}={value:g}'
        raise _error(f'{where}: {given}, expected {expected}')
    _check_size(value, name or attribute, where)
    return value


def _check_size(value: float, name: str, where: str) -> None:
    if abs(value) > LARGEST_VALUE:
        raise _error(f'{where}: {name}={value:g}, expected at most {LARGEST_VALUE:g} in size')


def _vector(
    element: ElementTree.Element | None, attribute: str, default: str, where: str,
) -> tuple[float, ...]:
    text = default if element is None else element.get(attribute, default)
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        values = ()
    if len(values) != 3 or not all(math.isfinite(value) for value in values):
        raise _error(f'{where}: {attribute}={text!r}, expected three numbers')
    for value in values:
        _check_size(value, attribute, where)
    return values


def _check_origin(element: ElementTree.Element, where: str) -> None:
    origin = element.find('origin')
    _vector(origin, 'xyz', '0 0 0', f'{where}: origin')
    _vector(origin, 'rpy', '0 0 0', f'{where}: origin')


def _check_inertial(link: ElementTree.Element) -> None:
    inertial = link.find('inertial')
    if inertial is None:
        return
    where = f'link {link.get("name")!r}: inertial'
    _check_origin(inertial, where)
    _finite(inertial.find('mass'), 'value', math.nan, where, 'a number >= 0', 0.0, 'mass')
    for entry in INERTIA_ENTRIES:
        _finite(inertial.find('inertia'), entry, math.nan, where, 'a number', name=entry)


def _end(element: ElementTree.Element, tag: str, link_names: tuple[str, ...]) -> str:
    end = element.find(tag)
    link = None if end is None else end.get('link')
    if link not in link_names or link is None:
        found = 'missing' if link is None else repr(link)
        raise _error(
            f'joint {element.get("name")!r}: {tag} link is {found}, '
            f'expected one of {list(link_names)}')
    return link


def _parse_joint(element: ElementTree.Element, link_names: tuple[str, ...]) -> UrdfJoint:
    name, kind = element.get('name') or '', element.get('type') or ''
    where = f'joint {name!r}'
    if kind not in SUPPORTED_KINDS:
        hint = ': an arm needs a fixed base' if kind == 'floating' else ''
        raise _error(f'{where} is of type {kind!r}{hint}, expected one of {list(SUPPORTED_KINDS)}')
    _check_origin(element, where)
    if kind in MOVING_KINDS and math.hypot(
            *_vector(element.find('axis'), 'xyz', '1 0 0', where)) < _SHORTEST_AXIS:
        raise _error(f'{where}: axis is zero, expected a direction')
    limit = element.find('limit')
    lower, upper = _position_limits(limit, kind, where)
    dynamics = element.find('dynamics')
    damping, friction = (
        _finite(dynamics, attribute, 0.0, where, 'a number >= 0', 0.0)
        for attribute in ('damping', 'friction'))
    return UrdfJoint(
        name, kind, _end(element, 'parent', link_names), _end(element, 'child', link_names),
        lower, upper,
        _size_limit(limit, 'velocity', where), _size_limit(limit, 'effort', where),
        damping, friction, _parse_mimic(element, where))


def _position_limits(
    limit: ElementTree.Element | None, kind: str, where: str,
) -> tuple[float, float]:
    if kind not in ('revolute', 'prismatic'):
        return -math.inf, math.inf
    if limit is None:
        raise _error(
            f'{where} is {kind} and has no <limit>, which URDF requires'
            + (': a joint without limits has the type continuous' if kind == 'revolute' else ''))
    lower, upper = _number(limit, 'lower', 0.0, where), _number(limit, 'upper', 0.0, where)
    if lower > LARGEST_VALUE or upper < -LARGEST_VALUE:
        raise _error(
            f'{where}: lower={lower:g}, upper={upper:g}, expected a range '
            f'that holds a position in [{-LARGEST_VALUE:g}, {LARGEST_VALUE:g}]')
    if lower > upper:
        raise _error(f'{where}: lower={lower:g} is above upper={upper:g}')
    return (lower if lower >= -LARGEST_VALUE else -math.inf,
            upper if upper <= LARGEST_VALUE else math.inf)


def _size_limit(limit: ElementTree.Element | None, attribute: str, where: str) -> float:
    size = _number(limit, attribute, 0.0, where)
    if size < 0.0:
        raise _error(f'{where}: {attribute}={size:g}, expected >= 0 (0: unknown)')
    return size if SMALLEST_DIVISOR <= size <= LARGEST_VALUE else math.inf


def _parse_mimic(element: ElementTree.Element, where: str) -> Mimic | None:
    mimic = element.find('mimic')
    if mimic is None or element.get('type') == 'fixed':
        return None
    multiplier, offset = (
        _finite(mimic, attribute, default, where, 'a finite number')
        for attribute, default in (('multiplier', 1.0), ('offset', 0.0)))
    return Mimic(mimic.get('joint') or '', multiplier, offset)


def _check_tree(link_names: tuple[str, ...], joints: tuple[UrdfJoint, ...]) -> str:
    """Return the root link; raise ModelError if the links are not a tree."""
    parent_joint: dict[str, UrdfJoint] = {}
    for joint in joints:
        if joint.child in parent_joint:
            raise _error(
                f'link {joint.child!r} is the child of two joints, '
                f'{parent_joint[joint.child].name!r} and {joint.name!r}: '
                'a closed loop, expected a tree')
        parent_joint[joint.child] = joint
    roots = [link for link in link_names if link not in parent_joint]
    if len(roots) > 1:
        raise _error(f'links {roots} all have no parent, expected one root')
    reached = links_from(joints, roots)
    lost = [link for link in link_names if link not in reached]
    if lost:
        raise _error(f'links {lost} form a closed loop that hangs on no root, expected a tree')
    return roots[0]


def _check_mimics(joints: tuple[UrdfJoint, ...]) -> None:
    movable = {joint.name: joint for joint in joints if joint.moves}
    for joint in joints:
        where = f'joint {joint.name!r}'
        followed, relation = {joint.name}, joint.mimic
        while relation is not None:
            if relation.leader not in movable:
                raise _error(
                    f'{where} mimics {relation.leader!r}, expected one of {list(movable)}')
            if relation.leader in followed:
                raise _error(f'{where} mimics itself, through {relation.leader!r}')
            followed.add(relation.leader)
            relation = movable[relation.leader].mimic
        _, multiplier, offset = resolve_mimic(joint, joints)
        _check_size(multiplier, 'multiplier', f'{where}: mimic chain')
        _check_size(offset, 'offset', f'{where}: mimic chain')
