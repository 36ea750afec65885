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
Where the mesh files are that a URDF names, and which of them are opened.

A URDF in a file that the user named may name any file. One that came over a topic may be of
anybody: its meshes are opened only below the share directories of packages and declared ones.
"""

from collections.abc import Sequence
import os
from pathlib import Path

from robot_dynamics.exceptions import ModelError
from robot_dynamics.urdf.document import find_dtd

LARGEST_MESH = 200_000_000
"""Bytes of a mesh file."""


def find_mesh(name: str, directory: Path) -> Path | None:
    """
    Return the file of a mesh, None where there is none; `directory` is that of the URDF.

    `package://NAME/…` is looked for beside the URDF, in the directories above it, and in the
    environment's AMENT_PREFIX_PATH; a relative name belongs to the URDF's own directory.
    """
    scheme, separator, rest = name.partition('://')
    if not separator or scheme == 'file':
        candidates = [directory / (rest if separator else name)]
    elif scheme == 'package':
        inside = Path(rest.lstrip('/'))
        above = [directory, *directory.parents]
        candidates = [place / inside for place in (*above, *_share_directories())]
    else:
        return None
    return next(filter(_is_file, candidates), None)


def find_untrusted_mesh(name: str, declared: Sequence[Path] = ()) -> Path:
    """
    Return the file of a mesh of a URDF that came over a topic.

    The file is below a directory `share` of the environment's AMENT_PREFIX_PATH, where links are
    those of the installation, or with links resolved below one of the `declared` directories,
    which relative names and packages belong to as well. Raises ModelError for any other file.
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
              or any(_resolved(path).is_relative_to(_resolved(place)) for place in declared)]
    if not opened:
        raise ModelError(
            f'mesh {name!r} of a description from a topic is not opened, expected a file below '
            'the share directory of a package or a declared directory (--mesh-path)')
    found = next(filter(_is_file, opened), None)
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


def _resolved(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError):  # links in a circle, or no name
        return Path(os.devnull)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that is none, as it is too long
        return False
