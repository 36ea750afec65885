# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Effort limits of a command, beside what the robot adds by itself."""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.model.arm_dynamics import EffortTerms


class RobotEffort(NamedTuple):
    """What the robot adds to a command by itself, each (n,) [N·m] or [N], None for nothing."""

    gravity: FloatArray | None
    friction: FloatArray | None

    def without_gravity(self, effort: FloatArray) -> FloatArray:
        """Return an effort at the joints less the gravity that the robot adds."""
        return effort if self.gravity is None else effort - self.gravity

    def command(self, effort: FloatArray) -> FloatArray:
        """Return the command for an effort at the joints."""
        effort = self.without_gravity(effort)
        return effort if self.friction is None else effort - self.friction

    def command_terms(self, terms: EffortTerms) -> EffortTerms:
        """Return the terms of the command for those of an effort at the joints."""
        if self.gravity is None and self.friction is None:
            return terms
        gravity = terms.gravity if self.gravity is None else terms.gravity - self.gravity
        friction = terms.friction if self.friction is None else np.zeros_like(terms.friction)
        return terms._replace(
            gravity=gravity, friction=friction, effort=self.command(terms.effort))


NOTHING = RobotEffort(None, None)


def robot_effort(
    convention: EffortConvention, gravity: FloatArray, friction: FloatArray | None,
) -> RobotEffort:
    """Return what a robot adds of g(q) and friction (n,) automatically; or `NOTHING`."""
    if not convention.robot_compensates:
        return NOTHING
    return RobotEffort(
        gravity if convention.compensates_gravity else None,
        friction if convention.compensates_friction else None)


class EffortBounds:
    """Effort limits of the URDF (n,), and the same times a scale; infinite where there is none."""

    def __init__(self, limit: FloatArray, scale: float = 1.0) -> None:
        self._limit = limit
        self.scaled = limit.copy()
        self.scaled[np.isfinite(limit)] *= scale
        self.least = float(self.scaled.min(initial=np.inf))
        """The smallest of the scaled limits."""
        self.no_joint = np.zeros(len(limit), dtype=bool)
        """(n,): no joint met its limit."""
        self.no_joint.setflags(write=False)

    def bounded(
        self, command: FloatArray, robot: RobotEffort, hold: FloatArray | None = None,
    ) -> tuple[FloatArray, BoolArray]:
        """
        Return the command within its limit, and which joints (n,) met it.

        The effort at the joints stays within its limits: it is the command and the gravity that
        the robot adds. (Friction that it adds is neglected.) Where gravity alone is beyond the
        limit, the command need not push against it: it may be 0, or reduce the load. A scale of
        the effort limits that is too low for `hold`, the command that holds the arm, extends to
        it; without `hold` the scale does not apply.
        """
        limit = self._limit
        low, high = -limit, limit
        if hold is not None:
            low = np.maximum(low, np.minimum(-self.scaled, hold))
            high = np.minimum(high, np.maximum(self.scaled, hold))
        if robot.gravity is not None:
            low = np.maximum(low, np.minimum(-limit - robot.gravity, 0.0))
            high = np.minimum(high, np.maximum(limit - robot.gravity, 0.0))
        bounded = np.minimum(np.maximum(command, low), high)
        return bounded, bounded != command
