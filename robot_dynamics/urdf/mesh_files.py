# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Search for the mesh files that a URDF names, and restrictions on which of them are opened.

A URDF in a file that the user selected may name any file. A URDF from a topic may come from any
publisher: its meshes are opened only below share directories of packages and declared directories.
"""

from collections.abc import Sequence
import os
from pathlib import Path

from robot_dynamics.exceptions import ModelError
from robot_dynamics.urdf.document import find_dtd

LARGEST_MESH = 200_000_000
"""Largest size [bytes] of a mesh file."""


def find_mesh(name: str, directory: Path) -> Path | None:
    """
    Return the file of a mesh, or None if it does not exist; `directory` is that of the URDF.

    `package://NAME/…` is searched for in the directory of the URDF, in the directories above, and
    in AMENT_PREFIX_PATH of the environment; a relative name is relative to the URDF's directory.
    """
    scheme, separator, rest = name.partition('://')
    if not separator or scheme == 'file':
        candidates = [directory / (rest if separator else name)]
    elif scheme == 'package':
        places = (directory, *directory.parents, *_share_directories())
        candidates = [place / rest.lstrip('/') for place in places]
    else:
        return None
    return next(filter(os.path.isfile, candidates), None)


def find_untrusted_mesh(name: str, declared: Sequence[Path] = ()) -> Path:
    """
    Return the file of a mesh of a URDF that came over a topic.

    The file must be below a directory `share` of the environment's AMENT_PREFIX_PATH, whose links
    are trusted as part of the installation, or, with links resolved, below one of the `declared`
    directories, in which relative names and packages are searched as well. Raises ModelError for
    any other file.
    """
    scheme, separator, rest = name.partition('://')
    shares = _share_directories()
    if scheme == 'package' and separator:
        candidates = [place / rest.lstrip('/') for place in (*shares, *declared)]
    elif not separator or scheme == 'file':
        path = Path(rest if separator else name)
        candidates = [path, *(place / path for place in declared)]
    else:
        raise ModelError(f'mesh {name!r} is of an unknown kind, expected package:// or file://')
    candidates = [Path(os.path.normpath(path)) for path in candidates]  # without ..
    opened = [path for path in candidates if any(map(path.is_relative_to, shares))
              or any(Path(os.path.realpath(path)).is_relative_to(os.path.realpath(place))
                     for place in declared)]
    if not opened:
        raise ModelError(
            f'mesh {name!r} of a description from a topic is not opened, expected a file below '
            'the share directory of a package or a declared directory (--mesh-path)')
    found = next(filter(os.path.isfile, opened), None)
    if found is None:
        raise ModelError(f'mesh {name!r} is not found')
    return found


def check_mesh_file(path: Path) -> None:
    """Raise ModelError if a mesh file is too large, or is Collada with a DTD; raise OSError."""
    size = path.stat().st_size
    if size > LARGEST_MESH:
        raise ModelError(f'it has {size} bytes, expected at most {LARGEST_MESH}')
    if path.suffix.lower() == '.dae' and (dtd := find_dtd(path.read_bytes())):
        raise ModelError(
            f'it has a document type declaration (DTD), {dtd!r}, expected Collada without one')


def _share_directories() -> list[Path]:
    return [
        Path(os.path.normpath(prefix), 'share')
        for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
        if os.path.isabs(prefix)]
