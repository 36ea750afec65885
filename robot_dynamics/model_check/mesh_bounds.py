# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The bounding box of a mesh file: STL, OBJ, Collada and the other formats that `coal` reads.

The box is that of the triangles: vertices of an OBJ that belong to no triangle do not count. In a
Collada file `coal` applies the transforms of the nodes, and ignores its up axis and its length
unit. The unit is applied here, so that the box is the one that RViz shows. The parser of Collada
does not end for some malformed files, so it runs in a child process with limits.
"""

from contextlib import suppress
import json
import os
from pathlib import Path
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import coal
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import ModelError
from robot_dynamics.urdf.mesh_files import check_mesh_file, find_mesh, find_untrusted_mesh

COLLADA_TIMEOUT = 30.0
"""[s] to read a Collada file."""
_COLLADA_MEMORY = 4 << 30
"""[bytes]"""
_READ_COLLADA = f"""
import json, resource, sys
resource.setrlimit(resource.RLIMIT_AS, ({_COLLADA_MEMORY}, {_COLLADA_MEMORY}))
import coal, numpy
mesh = coal.MeshLoader(coal.BV_AABB).load(sys.argv[1], numpy.full(3, float(sys.argv[2])))
mesh.computeLocalAABB()
print(json.dumps([mesh.aabb_local.min_.tolist(), mesh.aabb_local.max_.tolist()]))
"""


class MeshReader:
    """Finds the mesh files that a URDF names (`mesh_files`), and reads each once."""

    def __init__(self, directory: Path | None) -> None:
        """`directory` is that of the URDF, None for a URDF that came over a topic."""
        self._directory = None if directory is None else directory.resolve()
        self._known: dict[str, FloatArray | None] = {}

    def bounds(self, name: str) -> FloatArray | None:
        """Return the lower and upper corner (2, 3) of a mesh; None if it cannot be read."""
        if name not in self._known:
            path = None
            with suppress(ModelError):  # a mesh of a description from a topic is not opened
                path = find_untrusted_mesh(name) if self._directory is None else find_mesh(
                    name, self._directory)
            self._known[name] = None if path is None else bounding_box(path)
        return self._known[name]


def bounding_box(path: Path) -> FloatArray | None:
    """Return the lower and upper corner (2, 3) of a mesh file; None if it cannot be read."""
    try:
        check_mesh_file(path)
        corners = _collada_box(path) if path.suffix.lower() == '.dae' else _box(path)
    except (ElementTree.ParseError, ModelError, OSError, RuntimeError, ValueError,
            subprocess.SubprocessError):
        return None
    return corners if np.isfinite(corners).all() else None


def _box(path: Path) -> FloatArray:
    mesh = coal.MeshLoader(coal.BV_AABB).load(str(path), np.ones(3))
    mesh.computeLocalAABB()
    return np.array([mesh.aabb_local.min_, mesh.aabb_local.max_])


def _collada_box(path: Path) -> FloatArray:
    """Return the corners of a Collada file; raise SubprocessError beyond the limits."""
    done = subprocess.run(
        [sys.executable, '-c', _READ_COLLADA, str(path), repr(_collada_unit(path))],
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, sys.path))},
        stdin=subprocess.DEVNULL, capture_output=True, check=True, timeout=COLLADA_TIMEOUT)
    return np.array(json.loads(done.stdout.splitlines()[-1]))


def _collada_unit(path: Path) -> float:
    """Return the length unit of a Collada file [m]."""
    unit = ElementTree.parse(path).find('{*}asset/{*}unit')
    return 1.0 if unit is None else float(unit.get('meter', 1.0))
