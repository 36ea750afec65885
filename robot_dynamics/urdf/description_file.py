# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Read a robot description from a file or a package, expanding xacro."""

import io
import os
from pathlib import Path
import re

from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import ModelError
from robot_dynamics.urdf.document import check_document, LARGEST_DESCRIPTION
from robot_dynamics.urdf.sample_robots import sample_robot_path, SAMPLE_ROBOTS

_ARGUMENT = re.compile(r'\s+(?=\w+:=)')
"""The space before an argument of xacro after the name of a file."""


def read_description(path: Path, field: str) -> str:
    """
    Return the URDF in a file; `field` names it in errors.

    The path of a .xacro file may end with arguments: `arm.xacro prefix:=left_`. Raises ModelError
    if the file cannot be read, is too large or has a DTD, and MissingDependencyError if xacro is
    needed and missing.
    """
    path, arguments = _split(path)
    where = f'{field} {str(path)!r}'
    try:
        with path.open('rb') as file:
            data = file.read(LARGEST_DESCRIPTION + 1)
        check_document(data, where)
        if path.suffix != '.xacro':
            if arguments:
                raise ModelError(f'{where} has {arguments}, expected a .xacro file')
            return io.StringIO(data.decode(), newline=None).read()
    except FileNotFoundError:
        raise ModelError(
            f'{field} is {str(path)!r}, which cannot be read: there is no such file; expected a '
            f'path, file://, package:// or one of {sorted(SAMPLE_ROBOTS)}') from None
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f'{field} is {str(path)!r}, which cannot be read: {error}') from None
    return _expand_xacro(path, field, arguments)


def urdf_text(urdf: str | os.PathLike[str]) -> str:
    """
    Return the URDF that a user of the library gives: a text with `<`, or else the path of a file.

    Raises ModelError like `read_description`, also for a path at which there is no file.
    """
    if isinstance(urdf, str) and '<' in urdf:
        return urdf
    path = description_path(os.fspath(urdf), 'urdf')
    if not os.path.isfile(_split(path)[0]):
        raise ModelError(
            f'urdf is {os.fspath(urdf)!r}, which is no file, expected the path of a URDF or xacro '
            'file, or the text of a URDF, which contains <')
    return read_description(path, 'urdf')


def read_description_file(file: str, field: str) -> str:
    """Return the URDF in a file, expanding xacro; raise ModelError, naming `field`, on failure."""
    return read_description(description_path(file, field), field)


def description_path(file: str, field: str) -> Path:
    """
    Return the path for a path, `file://`, `package://` or a name of SAMPLE_ROBOTS.

    It ends with the arguments of xacro, if any. Raises ModelError for other texts.
    """
    file, *arguments = _ARGUMENT.split(file)
    if arguments:
        return Path(' '.join([str(description_path(file, field)), *arguments]))
    scheme, separator, rest = file.partition('://')
    if not separator:
        is_name = file in SAMPLE_ROBOTS and not os.path.isfile(file)
        return sample_robot_path(file) if is_name else Path(file).expanduser()
    if scheme == 'file':
        return Path(rest)
    if scheme != 'package':
        raise ModelError(
            f'{field} is {file!r}, expected a path, file:// or package://')
    package, _, inside = rest.partition('/')
    # The ament index: an installed package has a file of its name there.
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '')
    for prefix in filter(None, prefixes.split(os.pathsep)):
        if Path(prefix, 'share/ament_index/resource_index/packages', package).is_file():
            return Path(prefix, 'share', package, inside)
    raise ModelError(
        f'{field} is {file!r}, but there is no package {package!r} in this environment'
        f'{"" if prefixes else ", in which AMENT_PREFIX_PATH is not set"}')


def _split(path: Path) -> tuple[Path, dict[str, str]]:
    """Return a path without the arguments of xacro, and these."""
    name, *arguments = _ARGUMENT.split(str(path))
    return Path(name), dict(pair.split(':=', 1) for pair in arguments)


def _expand_xacro(path: Path, field: str, arguments: dict[str, str]) -> str:
    xacro = optional('xacro', f'{field} is {str(path)!r}, which')
    try:
        return str(xacro.process_file(str(path), mappings=arguments).toxml())
    except Exception as error:  # a document can make xacro raise any exception
        raise ModelError(f'{field}: xacro cannot expand {str(path)!r}: {error}') from None
