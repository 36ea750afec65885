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
The bounding box of a mesh file: STL, OBJ, Collada and the other formats that `coal` reads.

The box is that of the triangles: vertices of an OBJ that belong to no triangle do not count. In a
Collada file `coal` applies the transforms of the nodes, and ignores its up axis and its length
unit. The unit is applied here, so that the box is the one that RViz shows.
"""

from pathlib import Path
import xml.etree.ElementTree as ElementTree

import coal
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.urdf.mesh_files import find_mesh


class MeshReader:
    """Finds the mesh files that a URDF names (`mesh_files`), and reads each once."""

    def __init__(self, directory: Path) -> None:
        """`directory` is that of the URDF."""
        self._directory = directory.resolve()
        self._known: dict[str, FloatArray | None] = {}

    def bounds(self, name: str) -> FloatArray | None:
        """Return the lower and upper corner (2, 3) of a mesh; None if it cannot be read."""
        if name not in self._known:
            path = find_mesh(name, self._directory)
            self._known[name] = None if path is None else bounding_box(path)
        return self._known[name]


def bounding_box(path: Path) -> FloatArray | None:
    """Return the lower and upper corner (2, 3) of a mesh file; None if it cannot be read."""
    try:
        scale = np.full(3, _collada_unit(path) if path.suffix.lower() == '.dae' else 1.0)
        mesh = coal.MeshLoader(coal.BV_AABB).load(str(path), scale)
    except (ElementTree.ParseError, OSError, RuntimeError, ValueError):
        return None
    mesh.computeLocalAABB()
    corners = np.array([mesh.aabb_local.min_, mesh.aabb_local.max_])
    return corners if np.isfinite(corners).all() else None


def _collada_unit(path: Path) -> float:
    """Return the length unit of a Collada file [m]."""
    unit = ElementTree.parse(path).find('{*}asset/{*}unit')
    return 1.0 if unit is None else float(unit.get('meter', 1.0))
