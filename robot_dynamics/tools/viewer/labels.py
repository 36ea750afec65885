# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Placement of the labels of the viewer: distance between labels, and the side of their anchor."""

from collections.abc import Iterable
from typing import NamedTuple, TYPE_CHECKING

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray

if TYPE_CHECKING:
    import viser

CHARACTER = 6.3
"""Width of a character of a label on the screen [pixel], rounded up."""
BEHIND = 1e-6
"""Smallest distance [m] of a visible point in front of the camera."""


class View(NamedTuple):
    """
    The view of a page: pose of the camera in the base frame, and the size of the image.

    `rotation` (3, 3) has the axes of the camera as columns: right, down and forward.
    """

    position: FloatArray
    rotation: FloatArray
    field_of_view: float
    """Vertical [rad]."""
    width: float
    """[pixel]"""
    height: float
    """[pixel]"""

    def column(self, point: FloatArray) -> float | None:
        """Return the horizontal position [pixel] of a point (3,); None behind the camera."""
        x, _, z = self.rotation.T @ (point - self.position)
        if z < BEHIND:
            return None
        focal_length = 0.5 * self.height / np.tan(0.5 * self.field_of_view)
        return float(0.5 * self.width + focal_length * x / z)


def label_anchor(view: View | None, point: FloatArray, text: str) -> str:
    """
    Return the anchor of a label at a point (3,), for which the text stays within the image.

    The text extends to the right of the point, or to the left if it would exceed the right edge
    of the image, where a panel of the page begins.
    """
    column = None if view is None else view.column(point)
    if view is None or column is None:
        return 'top-left'
    is_too_wide = column + CHARACTER * len(text) > view.width
    return 'top-right' if is_too_wide else 'top-left'


def newest_view(clients: 'Iterable[viser.ClientHandle]') -> View | None:
    """Return the view of the client of viser whose camera moved last; None without a client."""
    cameras = [client.camera for client in clients]
    if not cameras:
        return None
    camera = max(cameras, key=lambda one: float(one.update_timestamp))
    if not camera.image_width or not camera.image_height:
        return None
    rotation = pin.Quaternion(*camera.wxyz.tolist()).matrix()
    return View(
        camera.position, rotation, camera.fov, camera.image_width, camera.image_height)


def spread(point: FloatArray, taken: list[FloatArray], gap: float) -> None:
    """Raise a point (3,) in place until its distance to each of `taken` is at least `gap` [m]."""
    for _ in taken:
        near = [one for one in taken if np.linalg.norm(one - point) < gap]
        if not near:
            break
        point[2] = max(one[2] for one in near) + gap
