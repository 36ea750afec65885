# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Results on disk: dataclasses, or names with values, each under a key.

Arrays are stored as arrays, everything else as JSON. A result is written to a temporary file in
the same directory and then renamed, so that an existing result is always complete.
"""

from dataclasses import fields, is_dataclass
import json
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_origin, get_type_hints
import zipfile

import numpy as np
from robot_dynamics.tools.command_line import make_directory, writing

_REST = 'json'
"""The entry for everything except arrays."""
_ARRAY = '__array__'
"""The only name in a JSON object that represents an array; its value is the array's entry."""


def save_result(directory: Path, key: str, result: object) -> None:
    """Store a result; raise ToolError, or TypeError for a type that JSON does not have."""
    arrays: dict[str, Any] = {}

    def stored(value: Any) -> Any:
        if not isinstance(value, np.ndarray):
            return plain_value(value)
        name = f'array_{len(arrays)}'
        arrays[name] = value
        return {_ARRAY: name}

    arrays[_REST] = np.frombuffer(json.dumps(result, default=stored).encode(), np.uint8)
    make_directory(directory)
    with writing(_place(directory, key)) as new, new.open('wb') as file:
        np.savez(file, **arrays)


def load_result(directory: Path, key: str) -> Any | None:
    """
    Return the plain value of a stored result: a dataclass as the names and values of its fields.

    None if no complete result is stored under the key.
    """
    try:
        with np.load(_place(directory, key), allow_pickle=False) as kept:
            return json.loads(kept[_REST].tobytes(), object_hook=lambda names: (
                kept[names[_ARRAY]] if set(names) == {_ARRAY} else names))
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile):
        return None


def plain_value(value: object) -> Any:
    """
    Return a dataclass or an array for `json.dumps`; raise TypeError for anything else.

    Fields that a dataclass excludes from comparisons are omitted.
    """
    if is_dataclass(value):
        return {field.name: getattr(value, field.name) for field in fields(value) if field.compare}
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f'{type(value).__name__} cannot be stored, expected a dataclass or an array')


def from_plain(kind: Any, plain: Any) -> Any:
    """
    Return the value of a type from its plain value.

    `kind` is a type of JSON or an array; a dataclass, tuple or dict of such; or one of these or
    None. Raises KeyError if a field of a dataclass is missing.
    """
    arguments = [argument for argument in get_args(kind) if argument is not NoneType]
    if plain is None:
        return None
    if isinstance(kind, type) and is_dataclass(kind):
        return kind(**{name: from_plain(type_, plain[name])
                       for name, type_ in get_type_hints(kind).items()})
    if get_origin(kind) is tuple:
        kinds = arguments[:1] * len(plain) if arguments[-1] is Ellipsis else arguments
        return tuple(map(from_plain, kinds, plain))
    if get_origin(kind) is dict:
        return {name: from_plain(arguments[1], value) for name, value in plain.items()}
    if NoneType in get_args(kind):
        return from_plain(arguments[0], plain)
    return plain


def _place(directory: Path, key: str) -> Path:
    return directory / f'{key}.npz'
