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

"""Where the mesh files are that a URDF names."""

import os
from pathlib import Path


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
        prefixes = [
            Path(prefix, 'share')
            for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if prefix]
        candidates = [place / inside for place in (*above, *prefixes)]
    else:
        return None
    return next(filter(_is_file, candidates), None)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # a name that is none, as it is too long
        return False
