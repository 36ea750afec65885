# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The meaning of `effort` in the joint states of a robot, and the efforts that the robot adds.

With u the commanded effort, τ the effort at the joint and g the gravity term of the robot's own
model (the arm of the URDF, without payloads that only this package knows):

    τ = u + [the robot compensates gravity] g(q) + [it compensates friction] τ_f(q̇)
    measured = τ,   τ − g(q),   K_t i = τ / N,   or the current i

The last two are on the motor side of the gearbox. The losses depend on the direction of power. In
a static hold there is no power, and because of the friction of the gears, the motor torque has any
value between η τ / N and τ / (η N). At rest, the gearbox is therefore assumed to be lossless,
which is within this range for every η, and is its geometric mean.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.actuator import Actuators
from robot_dynamics.validation import check_choice, check_unique, check_vector

MEASURED_EFFORTS = (
    'joint_torque', 'joint_torque_without_gravity', 'motor_torque', 'motor_current', 'none')
"""The possible meanings of `effort` in joint states."""
MOTOR_SIDE = ('motor_torque', 'motor_current')
"""The meanings that require actuators."""
ROBOT_COMPENSATIONS = ('gravity', 'friction')
"""The efforts that a robot may add to the commanded effort on its own."""


@dataclass(frozen=True)
class EffortConvention:
    """The efforts that a robot measures and adds; checked by `make_effort_convention`."""

    measured_effort: str = 'joint_torque'
    robot_compensates: tuple[str, ...] = ()
    robot_gravity: tuple[float, ...] | None = None
    """Gravity (3,) in the base frame [m/s²] that the robot compensates; None: the true one."""

    @property
    def compensates_gravity(self) -> bool:
        return 'gravity' in self.robot_compensates

    @property
    def compensates_friction(self) -> bool:
        return 'friction' in self.robot_compensates

    @property
    def lacks_gravity(self) -> bool:
        """Return whether the measured effort excludes gravity."""
        return self.measured_effort == 'joint_torque_without_gravity'


def make_effort_convention(
    measured_effort: str, robot_compensates: Sequence[str], has_actuators: bool,
    robot_gravity: Sequence[float] = (),
) -> EffortConvention:
    """
    Return a checked convention.

    Raises InvalidInputError for an unknown choice, for a repeated one, and for a motor-side effort
    without actuators, because K_t and N are then unknown. `robot_gravity` has 3 values, or none if
    the robot compensates the true gravity.
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
    gravity = tuple(check_vector('robot_gravity', robot_gravity, 3, ('x', 'y', 'z')).tolist()) if (
        len(robot_gravity)) else None
    return EffortConvention(measured_effort, tuple(robot_compensates), gravity)


def joint_effort_at_rest(
    measured_effort: str, effort: FloatArray, actuators: Actuators | None,
) -> FloatArray:
    """
    Return a measured effort (..., n) on the joint side of the gearbox [N·m] or [N].

    Gravity that the robot excludes is not added. Raises InvalidInputError for a motor-side effort
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
    Return the effort that a robot reports for a joint effort (n,) at the velocity v.

    The result is empty for `none`. The losses of the gearbox are those of
    `Actuators.motor_torque`; the contribution of the rotor is omitted.
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
    Return the joint effort (n,) for the effort that a robot reports at the velocity v.

    `gravity` (n,) is g(q) of the robot's own model. Raises InvalidInputError for a motor-side
    effort without actuators, and for `none`.
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
