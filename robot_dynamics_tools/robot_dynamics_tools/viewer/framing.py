# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The cameras of the pages of the viewer: each shows the whole arm until its user moves it."""

import time
from typing import Any, TYPE_CHECKING

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics_tools.viewer.labels import BEHIND, View, view_of

if TYPE_CHECKING:
    import viser

FIELD_OF_VIEW = 0.8
"""Vertical [rad]."""
ASPECT = 0.75
"""Width / height of the image that is assumed until a page reports its own."""
LOOSE, PATIENCE = 1.5, 3.0
"""A camera this many times as far as necessary comes closer after this time [s]."""
FILLED, LARGEST = 0.8, 0.95
"""Fractions of the image that the arm fills: at first, and before the camera moves back."""


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
            if page.is_loose(view, *framed(points, aspect)):
                page.points = points
            elif page.positions and shows(view, points):
                continue
            else:
                page.points = np.vstack([page.points, points])
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
