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

"""
What the `effort` of a robot's joint states is, and what the robot adds to a command by itself.

With u the commanded effort, τ the effort at the joint and g the gravity term of the robot's own
model (the arm of the URDF, without a load that only this package was told of):

    τ = u + [the robot compensates gravity] g(q) + [it compensates friction] τ_f(q̇)
    measured = τ,   τ − g(q),   K_t i = τ / N,   or the current i

The latter two are on the motor's side of the gearbox. Its losses depend on the way that power
takes; in a static hold there is none, and the friction of the gears leaves the motor torque
anywhere between η τ / N and τ / (η N). Read at rest, the gearbox is taken as lossless, which is
within that range for every η, and its middle on a scale of ratios.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.actuator import Actuators
from robot_dynamics.validation import check_choice, check_unique

MEASURED_EFFORTS = (
    'joint_torque', 'joint_torque_without_gravity', 'motor_torque', 'motor_current', 'none')
"""What `effort` in joint states may be."""
MOTOR_SIDE = ('motor_torque', 'motor_current')
"""Those of them that say nothing without actuators."""
ROBOT_COMPENSATIONS = ('gravity', 'friction')
"""What a robot may add by itself to the effort that it is commanded."""


@dataclass(frozen=True)
class EffortConvention:
    """What a robot measures and adds; `make_effort_convention` checks it."""

    measured_effort: str = 'joint_torque'
    robot_compensates: tuple[str, ...] = ()

    @property
    def compensates_gravity(self) -> bool:
        return 'gravity' in self.robot_compensates

    @property
    def compensates_friction(self) -> bool:
        return 'friction' in self.robot_compensates

    @property
    def lacks_gravity(self) -> bool:
        """Tell whether gravity was taken out of the measured effort."""
        return self.measured_effort == 'joint_torque_without_gravity'

    @property
    def expected_ratio(self) -> float:
        """Return by how much of g(q) the measured effort at rest exceeds the command."""
        return float(self.compensates_gravity) - float(self.lacks_gravity)


def make_effort_convention(
    measured_effort: str, robot_compensates: Sequence[str], has_actuators: bool,
) -> EffortConvention:
    """
    Return checked semantics.

    Raises InvalidInputError on an unknown choice, one that stands twice, and on an effort of the
    motor where there are no actuators to know K_t and N from.
    """
    check_choice('measured_effort', measured_effort, MEASURED_EFFORTS)
    for i, compensation in enumerate(robot_compensates):
        check_choice(f'robot_compensates[{i}]', compensation, ROBOT_COMPENSATIONS)
    check_unique('robot_compensates', robot_compensates)
    if measured_effort in MOTOR_SIDE and not has_actuators:
        others = [kind for kind in MEASURED_EFFORTS if kind not in MOTOR_SIDE]
        raise InvalidInputError(
            f'measured_effort is {measured_effort!r}, but there are no actuators: expected '
            f'actuator.torque_constant and actuator.gear_ratio, or one of {others}')
    return EffortConvention(measured_effort, tuple(robot_compensates))


def joint_effort_at_rest(
    measured_effort: str, effort: FloatArray, actuators: Actuators | None,
) -> FloatArray:
    """
    Return a measured effort (..., n) as one on the joint side of the gearbox [N·m] or [N].

    Gravity that the robot took out stays out. Raises InvalidInputError for an effort of the motor
    without actuators, and for `none`.
    """
    if measured_effort == 'none':
        raise InvalidInputError("measured_effort is 'none', expected an effort to convert")
    if measured_effort not in MOTOR_SIDE:
        return effort
    motors = _required(measured_effort, actuators)
    at_motor = effort * motors.torque_constant if measured_effort == 'motor_current' else effort
    return np.asarray(at_motor * motors.gear_ratio)


def measured_from_joint(
    measured_effort: str, effort: FloatArray, v: FloatArray, gravity: FloatArray,
    actuators: Actuators | None,
) -> FloatArray:
    """
    Return what a robot reports of a joint effort (n,) at the velocity v; for `none` an empty one.

    The losses of the gearbox are those of `Actuators.motor_torque`; the rotor's share is left out.
    """
    if measured_effort == 'none':
        return np.zeros(0)
    if measured_effort == 'joint_torque_without_gravity':
        return np.asarray(effort - gravity)
    if measured_effort not in MOTOR_SIDE:
        return effort
    motors = _required(measured_effort, actuators)
    torque = motors.motor_torque(effort, v, np.zeros_like(v))
    return motors.current(torque) if measured_effort == 'motor_current' else torque


def joint_from_measured(
    measured_effort: str, effort: FloatArray, v: FloatArray, gravity: FloatArray,
    actuators: Actuators | None,
) -> FloatArray:
    """
    Return the joint effort (n,) of what a robot reports at the velocity v: the way back.

    `gravity` (n,) is g(q) of the robot's own model. Raises InvalidInputError for an effort of the
    motor without actuators, and for `none`.
    """
    if measured_effort == 'joint_torque_without_gravity':
        return np.asarray(effort + gravity)
    if measured_effort not in MOTOR_SIDE:
        return joint_effort_at_rest(measured_effort, effort, actuators)
    motors = _required(measured_effort, actuators)
    torque = effort * motors.torque_constant if measured_effort == 'motor_current' else effort
    return motors.effort(torque, v, np.zeros_like(v))


def _required(measured_effort: str, actuators: Actuators | None) -> Actuators:
    if actuators is None:
        raise InvalidInputError(
            f'measured_effort is {measured_effort!r}, expected actuators to convert it with')
    return actuators
