# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Placement of the labels of the viewer in the image: no overlap, and the side of their anchor."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, TYPE_CHECKING

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray

if TYPE_CHECKING:
    import viser

CHARACTER = 6.3
"""Width of a character of a label on the screen [pixel], rounded up."""
LINE = 16.0
"""Height of a label on the screen [pixel]."""
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

    @property
    def focal_length(self) -> float:
        """Focal length [pixel]."""
        return float(0.5 * self.height / np.tan(0.5 * self.field_of_view))

    def project(self, points: FloatArray) -> FloatArray:
        """Return column, row [pixel] and depth [m] of points (m, 3), (3, m)."""
        x, y, z = ((points - self.position) @ self.rotation).T
        scale = self.focal_length / np.maximum(z, BEHIND)
        return np.array([0.5 * self.width + scale * x, 0.5 * self.height + scale * y, z])


def spread(view: View | None, points: FloatArray, texts: Sequence[str]) -> list[str]:
    """
    Raise points (m, 3) in place until the labels at them do not overlap; return their anchors.

    A label extends down and to the right of its point, or to the left if it would exceed the right
    edge of the image, where a panel of the page begins.
    """
    anchors = ['top-left'] * len(texts)
    taken: list[tuple[float, float, float]] = []
    if view is None:
        return anchors
    for i, (column, row, depth) in enumerate(view.project(points).T.tolist()):
        if depth < BEHIND:
            continue
        width, top = CHARACTER * len(texts[i]), row
        if column + width > view.width:
            anchors[i] = 'top-right'
            column -= width
        for left, right, other in sorted(taken, key=lambda one: -one[2]):  # from below
            if left < column + width and column < right and abs(other - top) < LINE:
                top = other - LINE
        taken.append((column, column + width, top))
        points[i] -= (row - top) * depth / view.focal_length * view.rotation[:, 1]
    return anchors


def view_of(camera: 'viser.CameraHandle') -> View | None:
    """Return the view of a camera of viser; None if its image has no size."""
    if not camera.image_width or not camera.image_height:
        return None
    rotation = pin.Quaternion(*camera.wxyz.tolist()).matrix()
    return View(
        camera.position, rotation, camera.fov, camera.image_width, camera.image_height)


def newest_view(clients: 'Iterable[viser.ClientHandle]') -> View | None:
    """Return the view of the client of viser whose camera moved last; None without a client."""
    cameras = [client.camera for client in clients]
    return view_of(max(cameras, key=lambda one: float(one.update_timestamp))) if cameras else None
