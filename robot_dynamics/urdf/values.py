# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Unchecked values of a URDF; non-numeric values, and values too large for any arm, are NaN.

`parser.parse_urdf` rejects invalid URDFs; this module is for other readers of a URDF.
"""

import math
import xml.etree.ElementTree as ElementTree

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.validation import LARGEST_VALUE


def rotation(rpy: FloatArray) -> FloatArray:
    """Return the rotation matrix (3, 3) of roll, pitch and yaw [rad] about fixed axes."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr]])


def pose(element: ElementTree.Element) -> tuple[FloatArray, FloatArray]:
    """Return rotation (3, 3) and translation (3,) [m] of the `<origin>` in an element."""
    origin = element.find('origin')
    return rotation(vector(origin, 'rpy', '0 0 0')), vector(origin, 'xyz', '0 0 0')


def number(element: ElementTree.Element | None, attribute: str) -> float:
    """Return the number in an attribute."""
    try:
        value = float('' if element is None else element.get(attribute, ''))
    except ValueError:
        return math.nan
    return value if abs(value) <= LARGEST_VALUE else math.nan


def vector(element: ElementTree.Element | None, attribute: str, default: str) -> FloatArray:
    """Return the three numbers (3,) in an attribute."""
    text = default if element is None else element.get(attribute, default)
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.zeros(0)
    good = values.shape == (3,) and bool((np.abs(values) <= LARGEST_VALUE).all())
    return values if good else np.full(3, math.nan)
