# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Checks of the message definitions that a recording contains.

The library `rosbags` generates Python code from a definition and executes it. Names and constants
are therefore checked, and so is the number of fields that the code reads one by one.
"""

from collections.abc import Mapping
import re
from typing import Any

from robot_dynamics.exceptions import RecordingError

LARGEST_DEFINITION = 1_000_000
"""Largest number of characters of the definition of a type."""
MOST_FIELDS = 2000
"""Largest number of fields of a message, including its parts and elements of fixed arrays."""
LARGEST_ARRAY = 1_000_000
"""Largest number of elements of a fixed array of numbers."""
MOST_LEVELS = 50
"""Largest nesting depth of messages."""

_TYPE = re.compile(r'[A-Za-z]\w*(/[A-Za-z]\w*)+', re.ASCII)
_NAME = re.compile(r'[A-Za-z]\w*', re.ASCII)
_BASE, _NAMED, _ARRAY = 1, 2, 3
"""Kinds of rosbags.interfaces.Nodetype; the fourth is a sequence."""


def check_types(types: Mapping[str, Any]) -> None:
    """
    Check types as rosbags parses them: constants and fields by type.

    Raises RecordingError, which names the type and the field.
    """
    for name, (constants, fields) in types.items():
        _check_name(_TYPE, name, 'name')
        for constant, _, value in constants:
            _check_name(_NAME, constant, f'constant of {name!r}')
            if type(value) not in (bool, int, float, str):
                raise RecordingError(
                    f'message type {name!r}: constant {constant} is {value!r}, expected a number '
                    'or a string')
        for field, kind in fields:
            _check_name(_NAME, field, f'field of {name!r}')
            _check_kind(name, field, kind)


def check_field_count(name: str, types: Mapping[str, Any]) -> None:
    """Raise RecordingError if a message of this type has too many fields or levels of them."""
    count = _count(name, types, MOST_LEVELS, {})
    if count > MOST_FIELDS:
        raise RecordingError(
            f'message type {name!r} has {count} fields with those of its parts, expected at most '
            f'{MOST_FIELDS}')


def _check_name(pattern: re.Pattern[str], name: str, what: str) -> None:
    if not pattern.fullmatch(name):
        raise RecordingError(
            f'message type: {what} is {name!r}, expected letters, digits and underscores')


def _check_kind(name: str, field: str, kind: Any) -> None:
    """Check the type of a field, which may be an array or a sequence of another one."""
    if kind[0] == _BASE:
        _check_name(_NAME, kind[1][0], f'type of field {field} of {name!r}')
    elif kind[0] == _NAMED:
        _check_name(_TYPE, kind[1], f'type of field {field} of {name!r}')
    else:
        element, size = kind[1]
        if kind[0] == _ARRAY and not 0 < size <= LARGEST_ARRAY:
            raise RecordingError(
                f'message type {name!r}: field {field} is an array of {size}, expected 1 to '
                f'{LARGEST_ARRAY} elements')
        _check_kind(name, field, element)


def _count(name: str, types: Mapping[str, Any], levels: int, known: dict[str, int]) -> int:
    """Return the number of fields that are read one by one; unknown types count once."""
    if name not in types:
        return 1
    if levels == 0:
        raise RecordingError(
            f'message type {name!r} is inside itself or more than {MOST_LEVELS} others, expected '
            'fewer levels')
    if name not in known:
        known[name] = sum(
            _count_of_kind(kind, types, levels - 1, known) for _, kind in types[name][1])
    return known[name]


def _count_of_kind(
    kind: Any, types: Mapping[str, Any], levels: int, known: dict[str, int],
) -> int:
    if kind[0] == _BASE:
        return 1
    if kind[0] == _NAMED:
        return _count(kind[1], types, levels, known)
    element, size = kind[1]
    is_number = element[0] == _BASE and element[1][0] not in ('string', 'wstring')
    count = 1 if is_number else _count_of_kind(element, types, levels, known)
    return count * size if kind[0] == _ARRAY and not is_number else count
