# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The unchecked bodies of a URDF: mass, center of mass, inertia, corners and volume of the geometry.

Source: the URDF XML specification, `link` element.
"""

from dataclasses import dataclass
import itertools
import math
from typing import NamedTuple, Protocol
import xml.etree.ElementTree as ElementTree

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.urdf.parser import robot_element
from robot_dynamics.urdf.values import number, pose, vector

_UNIT_CORNERS = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))


class MeshBounds(Protocol):
    """The sizes of the meshes that a URDF names (`model_check.mesh_bounds`)."""

    def bounds(self, name: str) -> FloatArray | None:
        """Return the lower and upper corner (2, 3) of a mesh; None if it cannot be read."""


@dataclass(frozen=True, eq=False)
class LinkBody:
    """
    One link, in its own frame.

    `mass` [kg], `com` (3,) [m] and `inertia` (3, 3) [kg·m²], about the center of mass, are None
    without an `<inertial>`. `corners` (k, 3) [m] are the corners of boxes around its shapes; None
    if there are shapes, none of which could be read. `volumes` [m³] are the sum of the collision
    shapes and the sum of the visual shapes, NaN if one of them could not be read; kinds that the
    link has not are left out. `inertials` is the number of `<inertial>` elements, of which only
    the first is read.
    """

    name: str
    mass: float | None
    com: FloatArray
    inertia: FloatArray
    corners: FloatArray | None
    volumes: tuple[float, ...]
    has_geometry: bool
    inertials: int


class _Extent(NamedTuple):
    """A shape in its frame: `center` and `size` of the box around it, each (3,), and volume."""

    center: FloatArray
    size: FloatArray
    volume: float


def read_bodies(xml: str, meshes: MeshBounds | None = None) -> list[LinkBody]:
    """
    Return the links of a URDF.

    Non-numeric values, and values that are too large for any arm, are NaN. Without `meshes`, no
    mesh is read. Raises ModelError if the text is not a URDF.
    """
    return [_read_body(link, meshes) for link in robot_element(xml).findall('link')]


def read_joint_origins(xml: str) -> dict[str, list[FloatArray]]:
    """Return the origins of the joints of each link to its children, (3,) [m] in its frame."""
    origins: dict[str, list[FloatArray]] = {}
    for joint in robot_element(xml).findall('joint'):
        parent = joint.find('parent')
        if parent is not None:
            origins.setdefault(parent.get('link') or '', []).append(
                vector(joint.find('origin'), 'xyz', '0 0 0'))
    return origins


def _read_body(link: ElementTree.Element, meshes: MeshBounds | None) -> LinkBody:
    inertials = link.findall('inertial')
    mass: float | None = None
    com, inertia = np.zeros(3), np.zeros((3, 3))
    if inertials:
        mass = number(inertials[0].find('mass'), 'value')
        R, com = pose(inertials[0])
        xx, xy, xz, yy, yz, zz = (
            number(inertials[0].find('inertia'), entry)
            for entry in ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz'))
        inertia = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
    collisions, visuals = link.findall('collision'), link.findall('visual')
    extents = [(shapes, _extents(shapes, meshes)) for shapes in (collisions, visuals)]
    corners = next(
        (corners for shapes, known in extents if known
         and (corners := _corners(shapes, known)) is not None), None)
    volumes = tuple(
        sum(extent.volume for extent in known) if known else math.nan
        for shapes, known in extents if shapes)
    return LinkBody(
        link.get('name') or '', mass, com, inertia, corners, volumes,
        bool(collisions or visuals), len(inertials))


def _extents(shapes: list[ElementTree.Element], meshes: MeshBounds | None) -> list[_Extent]:
    """Return the extents of all of these shapes; none if one is unknown."""
    extents = [_extent(shape.find('geometry'), meshes) for shape in shapes]
    known = [extent for extent in extents if extent is not None]
    return known if len(known) == len(extents) else []


def _corners(shapes: list[ElementTree.Element], extents: list[_Extent]) -> FloatArray | None:
    """Return the corners of the boxes around shapes; None if they are not finite."""
    placed = []
    for shape, extent in zip(shapes, extents):
        R, p = pose(shape)
        placed.append((extent.center + _UNIT_CORNERS * extent.size) @ R.T + p)
    corners = np.concatenate(placed)
    return corners if np.isfinite(corners).all() else None


def _extent(
    geometry: ElementTree.Element | None, meshes: MeshBounds | None,
) -> _Extent | None:
    """Return the extent of a shape; the volume of a mesh is that of its bounding box."""
    shape = None if geometry is None else next(iter(geometry), None)
    if shape is None:
        return None
    if shape.tag == 'box':
        size = vector(shape, 'size', '')
        return _Extent(np.zeros(3), size, float(np.prod(size)))
    if shape.tag == 'sphere':
        radius = number(shape, 'radius')
        return _Extent(np.zeros(3), np.full(3, 2.0 * radius), 4.0 / 3.0 * math.pi * radius**3)
    if shape.tag in ('cylinder', 'capsule'):
        radius, length = number(shape, 'radius'), number(shape, 'length')
        cap = radius if shape.tag == 'capsule' else 0.0  # a capsule has a half-sphere at each end
        size = np.array([2.0 * radius, 2.0 * radius, length + 2.0 * cap])
        return _Extent(
            np.zeros(3), size, math.pi * radius**2 * (length + 4.0 / 3.0 * cap))
    bounds = None
    if shape.tag == 'mesh' and meshes is not None:
        bounds = meshes.bounds(shape.get('filename') or '')
    if bounds is None:
        return None
    low, high = bounds * vector(shape, 'scale', '1 1 1')
    size = np.abs(high - low)
    return _Extent((low + high) / 2.0, size, float(np.prod(size)))
