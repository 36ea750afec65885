# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Effort limits of a command, with regard to the efforts that the robot adds on its own."""

import math
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.joints.effort_calibration import EffortCalibration
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.model.arm_dynamics import EffortTerms

_FAR = 1e6
"""[N·m] or [N]: an effort is at most this far from all limits."""


class RobotEffort(NamedTuple):
    """The efforts that the robot adds to a command on its own, (n,) [N·m] or [N], or None."""

    gravity: FloatArray | None
    friction: FloatArray | None

    def without_gravity(self, effort: FloatArray) -> FloatArray:
        """Return an effort at the joints minus the gravity torque that the robot adds."""
        return effort if self.gravity is None else effort - self.gravity

    def command(self, effort: FloatArray) -> FloatArray:
        """Return the command for an effort at the joints."""
        effort = self.without_gravity(effort)
        return effort if self.friction is None else effort - self.friction

    def effort(self, command: FloatArray) -> FloatArray:
        """Return the effort at the joints for a command: the inverse of `command`."""
        effort = command if self.gravity is None else command + self.gravity
        return effort if self.friction is None else effort + self.friction

    def command_terms(self, terms: EffortTerms) -> EffortTerms:
        """Return the terms of the command for the terms of an effort at the joints."""
        if self.gravity is None and self.friction is None:
            return terms
        gravity = terms.gravity - self.gravity if self.gravity is not None else terms.gravity
        friction = terms.friction - self.friction if self.friction is not None else terms.friction
        return terms._replace(
            gravity=gravity, friction=friction, effort=self.command(terms.effort))


NOTHING = RobotEffort(None, None)


def robot_effort(
    convention: EffortConvention, gravity: FloatArray, friction: FloatArray | None,
    drive: EffortCalibration | None = None,
) -> RobotEffort:
    """
    Return the g(q) and friction (n,) that a robot adds on its own, or `NOTHING`.

    The robot adds them as efforts of its drives, which deliver `drive.scale` times as much.
    """
    if not convention.robot_compensates:
        return NOTHING
    if drive is not None:
        gravity = drive.scale * gravity
        friction = drive.scale * friction if friction is not None else None
    return RobotEffort(
        gravity if convention.compensates_gravity else None,
        friction if convention.compensates_friction else None)


class EffortBounds:
    """
    Effort limits of an arm (n,), plain and scaled; infinite for a joint without a limit.

    They are torques at the joints within which the efforts of the drives are within the effort
    limits of the URDF, and within `scale` times these limits.
    """

    def __init__(
        self, limit: FloatArray, scale: float = 1.0, drive: EffortCalibration | None = None,
    ) -> None:
        """`limit` (n,) are the effort limits of the arm [N·m] or [N]."""
        self._limit = limit
        if drive is None:
            self.scaled = limit.copy()
            self.scaled[np.isfinite(limit)] *= scale
        else:
            self.scaled = drive.torque_limit(scale)
        self.center, self.clearance = [0.0] * len(limit), -1.0
        """An effort, and the distance from it up to which no joint meets its scaled limit."""
        self.no_joint = np.zeros(len(limit), dtype=bool)
        """(n,) of False: no joint met its limit."""
        self.no_joint.setflags(write=False)

    def is_clear(self, effort: FloatArray) -> bool:
        """Return whether an effort (n,) is finite and within the scaled limits."""
        values = effort.tolist()
        if math.dist(values, self.center) <= self.clearance:
            return True
        clearance = float((self.scaled - np.abs(effort)).min(initial=_FAR))
        if not clearance >= 0.0:
            return False
        self.center, self.clearance = values, 0.999 * clearance  # not beyond a limit by rounding
        return True

    def bounded(
        self, command: FloatArray, robot: RobotEffort, holding: FloatArray | None = None,
    ) -> tuple[FloatArray, BoolArray]:
        """
        Return the command within its limits, and which joints (n,) met their limit.

        The effort at the joints is the sum of the command and the gravity torque that the robot
        adds; it stays within the limits. (Friction that the robot adds is neglected.) If gravity
        alone exceeds the limit of a joint, the command need not counteract it: the command may be
        0, or reduce the load. `holding` is the command that holds the arm: if the scaled limits
        are too low for it, they are extended to it. Without it the scale does not apply.
        """
        limit = self._limit
        low, high = -limit, limit
        if holding is not None:
            low = np.maximum(low, np.minimum(-self.scaled, holding))
            high = np.minimum(high, np.maximum(self.scaled, holding))
        if robot.gravity is not None:
            low = np.maximum(low, np.minimum(-limit - robot.gravity, 0.0))
            high = np.minimum(high, np.maximum(limit - robot.gravity, 0.0))
        bounded = np.minimum(np.maximum(command, low), high)
        return bounded, bounded != command
