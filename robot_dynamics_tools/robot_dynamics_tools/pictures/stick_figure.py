# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""An arm as a line from joint to joint, seen from the side."""

from collections.abc import Collection

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel

_SAME = 1e-6
"""[m]"""


def tool_link(arm: ArmModel, without: Collection[int] = ()) -> str:
    """
    Return the link with the most joints between it and the base; of several, the last.

    Links on the joints `without` (numbers of Pinocchio) do not count.
    """
    parents = {link: arm.link_frame(link).parentJoint for link in arm.link_names}
    depths = {link: len(arm.pinocchio_model.supports[joint])
              for link, joint in parents.items() if joint not in without}
    return [link for link, depth in depths.items() if depth == max(depths.values())][-1]


class StickFigure:
    """Poses of an arm as lines from its base to a link. Not for two threads at a time."""

    def __init__(self, arm: ArmModel, link: str) -> None:
        """Raise InvalidInputError for an unknown link."""
        frame = arm.link_frame(link, 'link')
        self._arm, self._link = arm, arm.pinocchio_model.getFrameId(link, pin.FrameType.BODY)
        self._joints = list(arm.pinocchio_model.supports[frame.parentJoint])[1:]
        self._data = arm.pinocchio_model.createData()

    def points(self, q: FloatArray) -> FloatArray:
        """Return the joints' origins and that of the link at q (n,), in the base frame (k, 3)."""
        model, data = self._arm.pinocchio_model, self._data
        pin.framesForwardKinematics(model, data, self._arm.coordinates.position(q))
        return np.array([
            *(data.oMi[joint].translation for joint in self._joints),
            data.oMf[self._link].translation])

    def tip(self, q: FloatArray) -> FloatArray:
        """Return the origin of the link at many positions (m, n), in the base frame (m, 3) [m]."""
        model, data = self._arm.pinocchio_model, self._data
        points = np.empty((len(q), 3))
        for point, row in zip(points, self._arm.coordinates.position(q)):
            pin.forwardKinematics(model, data, row)
            point[:] = pin.updateFramePlacement(model, data, self._link).translation
        return points


def side_lines(arm: ArmModel, q: FloatArray) -> FloatArray:
    """Return the lines (m, k, 2) [m] of an arm at q (m, n), from joint 1, as `side_view` sees."""
    figure = StickFigure(arm, tool_link(arm))
    lines = np.array([figure.points(one) for one in q])
    return np.asarray((lines - lines[:, :1]) @ side_view(arm, lines).T)


def side_view(arm: ArmModel, points: FloatArray) -> FloatArray:
    """
    Return the axes (2, 3), to the side and up, of the view in which points (..., 3) spread most.

    The upward axis is against gravity, or along z without gravity; the side axis is perpendicular.
    """
    g = np.asarray(arm.pinocchio_model.gravity.linear)
    size = float(np.linalg.norm(g))
    up = -g / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
    flat = points.reshape(-1, 3)
    flat = flat - np.outer(flat @ up, up)
    spread, axes = np.linalg.eigh(np.cov(flat.T))
    side = axes[:, int(np.argmax(spread))] if spread.max() > _SAME else np.cross(
        up, np.eye(3)[int(np.abs(up).argmin())])
    side = side - (side @ up) * up
    side = side / np.linalg.norm(side)
    # Of both directions, the one in which the axes of the base frame are positive.
    return np.array([side if side[int(np.abs(side).argmax())] > 0.0 else -side, up])
