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

"""What the controller returns for one state: the efforts, or an error if they are not finite."""

from contextlib import AbstractContextManager
from typing import Any

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.control.effort_bounds import EffortBounds, RobotEffort
from robot_dynamics.control.laws import LawInput, LawOutput
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.drive_effort import DriveEffort
from robot_dynamics.model.arm_dynamics import EffortTerms, UncheckedArmDynamics
from robot_dynamics.trajectories.interpolation import Reference


class NonFiniteEffortError(InvalidInputError):
    """A state for which the model has no finite effort."""


class ControlOutput:
    """
    The efforts for one state, each (n,) [N·m] or [N].

    Efforts that are not part of the command are computed when they are read.
    """

    __slots__ = (
        '_bounds', '_drive', '_lock', '_robot', '_state', '_unloaded', 'clamped', 'command',
        'law', 'scale')

    def __init__(
        self, state: LawInput, law: LawOutput, robot: RobotEffort, bounds: EffortBounds,
        drive: DriveEffort | None, unloaded: UncheckedArmDynamics, lock: AbstractContextManager[Any], scale: float,
    ) -> None:
        self._state, self._robot, self._bounds, self._drive = state, robot, bounds, drive
        self._unloaded, self._lock = unloaded, lock
        self.law = law
        """The efforts of the law, before any limit."""
        self.scale = scale
        """The smallest fraction of the bandwidth to which the gains were scaled down."""
        self.command: FloatArray | None = None
        """
        The effort to command, None for none.

        It is within the effort limits, an effort of the drives (`drive_effort`), and excludes the
        efforts that the robot adds on its own.
        """
        self.clamped: BoolArray = bounds.no_joint
        """Marks the joints of `command` that met their effort limit."""

    @property
    def gravity_compensation(self) -> FloatArray:
        """The gravity-compensation torque g(q) with the load."""
        with self._lock:
            return self._state.gravity

    @property
    def robot_gravity(self) -> FloatArray:
        """The gravity-compensation torque without a load."""
        with self._lock:
            if self._unloaded is self._state.dynamics:
                return self._state.gravity
            return self._unloaded.rigid_body.gravity(self._state.q)

    @property
    def computed_torque(self) -> FloatArray | None:
        """The effort of the law that follows the reference, None without a reference."""
        return None if self._state.trajectory is None else self.law.effort

    @property
    def velocity(self) -> FloatArray | None:
        """The velocity (n,) that was used, measured or from positions; None if it is unknown."""
        return self._state.v

    @property
    def is_far(self) -> bool:
        """Whether the following error of a joint exceeds its limit."""
        return self.law.is_far

    @property
    def no_joint(self) -> BoolArray:
        """The value of `clamped` if no joint met its limit."""
        return self._bounds.no_joint

    @property
    def has_reference(self) -> bool:
        """Whether a reference is followed."""
        return self._state.trajectory is not None

    @property
    def reference(self) -> Reference | None:
        """The reference that is followed, or None."""
        return None if self._state.trajectory is None else self._state.reference

    def hold(self) -> FloatArray:
        """Return the command that holds the arm still; a command starts from it."""
        with self._lock:
            effort = self.hold_torque()
            return effort if self._drive is None else self._drive.command(effort)

    def hold_torque(self) -> FloatArray:
        """Return the same as torques at the joints."""
        robot = self._robot
        return self._bounds.bounded(robot.without_gravity(self._state.gravity), robot)[0]

    @property
    def terms(self) -> EffortTerms | None:
        """The terms of the command, or None if they are not finite."""
        with self._lock, np.errstate(over='ignore', invalid='ignore'):
            terms = self._robot.command_terms(self.law.terms())
            # The effort is valid even if the energy overflows.
            return terms if all(np.isfinite(part).all() for part in terms) else None


def non_finite_effort(
    q: FloatArray, gravity: FloatArray, effort: FloatArray,
) -> NonFiniteEffortError:
    """Return the error of a position (n,) with these efforts, each (n,)."""
    return NonFiniteEffortError(
        f'the efforts at position {q.tolist()} are not finite: gravity {gravity.tolist()}, '
        f'command {effort.tolist()}')
