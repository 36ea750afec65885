# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Effort limits of a command, with regard to the efforts that the robot adds on its own."""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.control.safety.effort_limiter import Range
from robot_dynamics.joints.effort_calibration import EffortCalibration
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.model.arm_dynamics import EffortTerms


class RobotEffort(NamedTuple):
    """The efforts that the robot adds to a command on its own, (n,) [N·m] or [N], or 0."""

    gravity: FloatArray | float
    friction: FloatArray | float

    def command(self, effort: FloatArray) -> FloatArray:
        """Return the command for an effort at the joints."""
        return effort - self.gravity - self.friction

    def command_terms(self, terms: EffortTerms) -> EffortTerms:
        """Return the terms of the command for the terms of an effort at the joints."""
        return terms._replace(
            gravity=terms.gravity - self.gravity, friction=terms.friction - self.friction,
            effort=self.command(terms.effort))


NOTHING = RobotEffort(0.0, 0.0)


def robot_effort(
    convention: EffortConvention, gravity: FloatArray, friction: FloatArray | float,
    drive: EffortCalibration | None = None,
) -> RobotEffort:
    """
    Return the g(q) and friction (n,) that a robot adds on its own.

    The robot adds them as efforts of its drives, which deliver `drive.scale` times as much.
    """
    scale = 1.0 if drive is None else drive.scale
    return RobotEffort(
        scale * gravity if convention.compensates_gravity else 0.0,
        scale * friction if convention.compensates_friction else 0.0)


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
        self.range = Range(-self.scaled, self.scaled)

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
        limit, gravity = self._limit, robot.gravity
        low = np.maximum(-limit, np.minimum(-limit - gravity, 0.0))
        high = np.minimum(limit, np.maximum(limit - gravity, 0.0))
        if holding is not None:
            low = np.maximum(low, np.minimum(-self.scaled, holding))
            high = np.minimum(high, np.maximum(self.scaled, holding))
        bounded = np.minimum(np.maximum(command, low), high)
        return bounded, bounded != command
