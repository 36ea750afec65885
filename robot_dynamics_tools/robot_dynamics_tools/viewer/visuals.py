# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The visuals of the links of a URDF: shapes, their poses and colours.

Source: the URDF XML specification, elements `visual` and `material`.
"""

from dataclasses import dataclass
from typing import NamedTuple
import xml.etree.ElementTree as ElementTree

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.urdf.parser import robot_element
from robot_dynamics.urdf.values import number, pose, vector
from robot_dynamics.validation import LARGEST_VALUE
import trimesh

Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, each in [0, 1]."""


class MeshFile(NamedTuple):
    """The name of a mesh file in the URDF, and its scale (3,)."""

    name: str
    scale: FloatArray


@dataclass(frozen=True, eq=False)
class Visual:
    """One shape of a link, at `rotation` (3, 3) and `place` (3,) [m] in the link's frame."""

    link: str
    rotation: FloatArray
    place: FloatArray
    shape: trimesh.Trimesh | MeshFile
    """Box, sphere or cylinder [m] about the origin, the cylinder along z; or a file."""
    colour: Colour | None


def read_visuals(xml: str) -> list[Visual]:
    """Return the visuals of the links of a URDF that can be drawn; raise ModelError."""
    robot = robot_element(xml)
    palette = {
        material.get('name') or '': colour for material in robot.findall('material')
        if (colour := _colour(material)) is not None}
    visuals = []
    for link in robot.findall('link'):
        for element in link.findall('visual'):
            R, p = pose(element)
            shape = _shape(element.find('geometry'))
            if shape is not None and np.isfinite(R).all() and np.isfinite(p).all():
                material = element.find('material')
                colour = None if material is None else (
                    _colour(material) or palette.get(material.get('name') or ''))
                visuals.append(Visual(link.get('name') or '', R, p, shape, colour))
    return visuals


def _shape(geometry: ElementTree.Element | None) -> trimesh.Trimesh | MeshFile | None:
    """Return a shape, or None if its kind is unknown or its sizes are invalid."""
    element = None if geometry is None else next(iter(geometry), None)
    if element is None:
        return None
    if element.tag == 'box':
        size = vector(element, 'size', '')
        return trimesh.creation.box(size) if (size > 0.0).all() else None
    if element.tag == 'mesh':
        scale, name = vector(element, 'scale', '1 1 1'), element.get('filename')
        return MeshFile(name, scale) if name and np.isfinite(scale).all() else None
    radius = number(element, 'radius')
    if not radius > 0.0:
        return None
    if element.tag == 'sphere':
        return trimesh.creation.icosphere(radius=radius)
    length = number(element, 'length')
    return trimesh.creation.cylinder(radius, length) if (
        element.tag == 'cylinder' and length > 0.0) else None


def _colour(material: ElementTree.Element) -> Colour | None:
    element = material.find('color')
    words = '' if element is None else element.get('rgba', '')
    try:
        values = [float(word) for word in words.split()]
    except ValueError:
        return None
    if len(values) != 4 or not all(abs(value) <= LARGEST_VALUE for value in values):
        return None
    red, green, blue, opacity = (min(max(value, 0.0), 1.0) for value in values)
    return red, green, blue, opacity
