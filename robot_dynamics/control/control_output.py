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

from collections.abc import Callable
from typing import NamedTuple

from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm_dynamics import EffortTerms
from robot_dynamics.trajectories.interpolation import Reference


class NonFiniteEffortError(InvalidInputError):
    """A state for which the model has no finite effort."""


class ControlOutput(NamedTuple):
    """
    The efforts for one state, each (n,) [N·m] or [N], or None if it does not exist.

    `gravity_compensation` and `computed_torque` are the total efforts at the joints. `command` and
    `terms` exclude the efforts that the robot adds on its own, of which `robot_gravity` is g(q)
    without a load. `hold` is the command that holds the arm still; a command starts from it.
    `command` and `hold` are efforts of the drives (`drive_effort`), the others torques.
    `clamped` marks the joints of `command` that met their effort limit. `gain_scale` is s if the
    command has lower gains than `computed_torque` (`gain_softening`). All numbers are finite.
    """

    gravity_compensation: FloatArray
    robot_gravity: FloatArray
    computed_torque: FloatArray | None
    command: FloatArray | None
    hold: FloatArray
    clamped: BoolArray
    gain_scale: float = 1.0
    sample: Callable[[], Reference] | None = None
    velocity: FloatArray | None = None
    """The velocity (n,) that was used, measured or differentiated (`stable_gains`)."""
    is_far: bool = False
    """Whether the following error of a joint exceeds its limit."""
    terms: EffortTerms | None = None

    @property
    def reference(self) -> Reference | None:
        """Return the reference that is followed, or None."""
        return None if self.sample is None else self.sample()


def non_finite_effort(
    q: FloatArray, gravity: FloatArray, computed_torque: FloatArray | None,
) -> NonFiniteEffortError:
    """Return the error of a position (n,) with these efforts, each (n,)."""
    return NonFiniteEffortError(
        f'the efforts at position {q.tolist()} are not finite: gravity {gravity.tolist()}, '
        f'computed torque {computed_torque}')
