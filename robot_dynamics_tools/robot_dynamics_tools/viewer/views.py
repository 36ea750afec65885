# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The views of the pages of the viewer: each shows the whole arm until its user moves it.

Labels are placed in the image without overlap, on the side of their anchor.
"""

from collections.abc import Iterable, Sequence
import time
from typing import Any, NamedTuple, TYPE_CHECKING

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
FIELD_OF_VIEW = 0.8
"""Vertical [rad]."""
ASPECT = 0.75
"""Width / height of the image that is assumed until a page reports its own."""
NARROW, COVERED = 600, 1.8
"""On a page of less pixels in width a panel covers this height of the arm below it."""
LOOSE, PATIENCE = 1.5, 3.0
"""A camera this many times as far as necessary comes closer after this time [s]."""
FILLED, LARGEST = 0.8, 0.95
"""Fractions of the image that the arm fills: at first, and before the camera moves back."""


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
    return View(camera.position, rotation, camera.fov, camera.image_width, camera.image_height)


def newest_view(clients: 'Iterable[viser.ClientHandle]') -> View | None:
    """Return the view of the client of viser whose camera moved last; None without a client."""
    cameras = [client.camera for client in clients]
    return view_of(max(cameras, key=lambda one: float(one.update_timestamp))) if cameras else None


def _camera_axes(forward: tuple[float, float, float]) -> FloatArray:
    """Return the axes right, down and forward of a level camera as columns (3, 3)."""
    z = np.array(forward) / np.linalg.norm(forward)
    x = np.cross(z, (0.0, 0.0, 1.0))
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


_AXES = _camera_axes((-0.95, 1.45, -0.35))


def framed(points: FloatArray, aspect: float) -> tuple[FloatArray, FloatArray]:
    """Return the position of the nearest camera that shows points (m, 3), and a point it faces."""
    x, y, z = (points @ _AXES).T
    centre, depths = [], []
    slope = FILLED * np.tan(0.5 * FIELD_OF_VIEW)
    for side, tangent in ((x, aspect * slope), (y, slope)):
        high, low = float((side - tangent * z).max()), float((-side - tangent * z).max())
        centre.append(0.5 * (high - low))
        depths.append(-0.5 * (high + low) / tangent)
    return _AXES @ (*centre, min(depths)), _AXES @ (*centre, float(z.mean()))


def with_room_below(points: FloatArray) -> FloatArray:
    """Return points (m, 3), and the same lower in the image by COVERED times their height."""
    down = _AXES[:, 1]
    return np.vstack([points, points + COVERED * np.ptp(points @ down) * down])


def shows(view: View, points: FloatArray) -> bool:
    """Return whether points (m, 3) are in the image, with a margin."""
    columns, rows, depths = view.project(points)
    return bool(
        depths.min() > BEHIND and np.abs(2.0 * columns / view.width - 1.0).max() <= LARGEST
        and np.abs(2.0 * rows / view.height - 1.0).max() <= LARGEST)


class Cameras:
    """Places the cameras of the pages of a viser server."""

    def __init__(self, server: 'viser.ViserServer') -> None:
        self._server = server
        self._pages: dict[int, _Page] = {}

    def restart(self, points: FloatArray) -> None:
        """Begin with another arm, which is at points (m, 3)."""
        self._pages = {}
        self._server.initial_camera.fov = FIELD_OF_VIEW
        self._place(self._server.initial_camera, *framed(points, ASPECT))

    def show(self, points: FloatArray) -> None:
        """
        Move each camera that no user has moved, so that points (m, 3) of the arm fill the image.

        A camera moves back at once, and closer after PATIENCE.
        """
        clients = self._server.get_clients()
        self._pages = {key: self._pages.get(key) or _Page() for key in clients}
        for key, client in clients.items():
            page, view = self._pages[key], view_of(client.camera)
            if view is None or page.is_moved(view):
                continue
            aspect = view.width / view.height
            shown = with_room_below(points) if view.width < NARROW else points
            if page.is_loose(view, *framed(shown, aspect)):
                page.points = shown
            elif page.positions and shows(view, shown):
                continue
            else:
                page.points = np.vstack([page.points, shown])
            position, target = framed(page.points, aspect)
            page.positions += [view.position, position]
            with client.atomic():
                client.camera.fov = FIELD_OF_VIEW
                self._place(client.camera, position, target)
            self._place(self._server.initial_camera, position, target)

    def _place(self, camera: Any, position: FloatArray, target: FloatArray) -> None:
        camera.position, camera.look_at = tuple(position.tolist()), tuple(target.tolist())


class _Page:
    """The positions that a camera has had without its user, and the points that it shows."""

    def __init__(self) -> None:
        self.positions: list[FloatArray] = []
        self.points = np.zeros((0, 3))
        self._close_time = time.monotonic()

    def is_moved(self, view: View) -> bool:
        """Return whether the user has moved the camera."""
        return bool(self.positions) and not any(
            np.allclose(view.position, one, atol=1e-3) for one in self.positions)

    def is_loose(self, view: View, nearest: FloatArray, target: FloatArray) -> bool:
        """Return whether the camera has been LOOSE times as far as `nearest` for PATIENCE."""
        now = time.monotonic()
        if np.linalg.norm(view.position - target) < LOOSE * np.linalg.norm(nearest - target):
            self._close_time = now
        return now - self._close_time > PATIENCE
