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
The bounding box of a mesh file: STL, binary or text, and OBJ.

Other formats (Collada has transforms and units of its own) are left to those who draw them.
"""

from pathlib import Path

import numpy as np
from robot_dynamics.urdf.mesh_files import find_mesh
from robot_dynamics.validation import FloatArray

_STL_HEADER = 84
_STL_TRIANGLE = np.dtype([('normal', '<f4', 3), ('corners', '<f4', (3, 3)), ('attribute', '<u2')])


class MeshReader:
    """Finds the mesh files that a URDF names (`mesh_files`), and reads each once."""

    def __init__(self, directory: Path) -> None:
        """`directory` is that of the URDF."""
        self._directory = directory.resolve()
        self._known: dict[str, FloatArray | None] = {}

    def bounds(self, name: str) -> FloatArray | None:
        """Return the lower and upper corner (2, 3) of a mesh; None where it cannot be read."""
        if name not in self._known:
            path = find_mesh(name, self._directory)
            self._known[name] = None if path is None else bounding_box(path)
        return self._known[name]


def bounding_box(path: Path) -> FloatArray | None:
    """Return the lower and upper corner (2, 3) of a mesh file; None where it cannot be read."""
    readers = {'.stl': _stl_vertices, '.obj': _obj_vertices}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        return None
    try:
        vertices = reader(path.read_bytes())
    except (OSError, ValueError, IndexError):
        return None
    if vertices.ndim != 2 or vertices.shape[1] != 3 or not len(vertices):
        return None
    if not np.isfinite(vertices).all():
        return None
    return np.array([vertices.min(axis=0), vertices.max(axis=0)])


def _stl_vertices(content: bytes) -> FloatArray:
    count = int.from_bytes(content[_STL_HEADER - 4:_STL_HEADER], 'little')
    # Some binary files begin with "solid" as text files do, so that their size must tell.
    if len(content) == _STL_HEADER + count * _STL_TRIANGLE.itemsize:
        triangles = np.frombuffer(content, _STL_TRIANGLE, count, _STL_HEADER)
        return np.asarray(triangles['corners'], dtype=np.float64).reshape(-1, 3)
    return _vertices_after(b'vertex', content)


def _obj_vertices(content: bytes) -> FloatArray:
    return _vertices_after(b'v', content)


def _vertices_after(keyword: bytes, content: bytes) -> FloatArray:
    rows = [line.split()[1:4] for line in content.splitlines()
            if line.lstrip().startswith(keyword) and line.split()[0] == keyword]
    return np.array([[float(word) for word in row] for row in rows], dtype=np.float64)
