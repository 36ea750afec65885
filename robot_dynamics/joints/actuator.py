# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Motors with gearboxes: conversions between joint effort, motor torque, current and voltage.

At each joint an electric motor with rotor inertia J_r drives through a gear ratio N with
efficiency η. In motor quantities, ω = N v:

    electromagnetic torque  K_t i = J_r N a + τ_gear,   voltage  V = R i + L di/dt + K_e ω

The reflected rotor inertia N² J_r is part of M(q), so that a joint effort τ includes N² J_r a. The
rest passes the gearbox, which has losses: τ − N² J_r a = η N τ_gear if the motor drives the joint,
and N τ_gear / η if the joint drives the motor. Source: B. Siciliano et al., *Robotics*, Springer
2009, sections 5.2 and 7.1.1 (motor, reduction); the side on which efficiency acts follows from the
direction of power.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.parameter_field import per_joint_values
from robot_dynamics.validation import check_scalar, is_empty, SMALLEST_DIVISOR

DEFAULT_CURRENT_TIME_CONSTANT = 2e-4
"""[s]"""


@dataclass(frozen=True, eq=False)
class Actuators:
    """
    Motors and gearboxes of n joints, each parameter (n,).

    `torque_constant` K_t [N·m/A], `back_emf_constant` K_e [V·s/rad], `resistance` R [Ω],
    `inductance` L [H], `rotor_inertia` J_r [kg·m²], `gear_ratio` N (motor revolutions per joint
    revolution, or [rad/m]), `efficiency` η, `current_limit` [A] and `voltage_limit` [V], infinite
    for no limit. For the simulation: `current_time_constant` T_c [s] of the drive's current loop;
    `backlash`, the whole gap between the teeth [rad] or [m] on the joint side, and the
    `restitution` e of the teeth.
    """

    torque_constant: FloatArray
    gear_ratio: FloatArray
    back_emf_constant: FloatArray
    resistance: FloatArray
    inductance: FloatArray
    rotor_inertia: FloatArray
    efficiency: FloatArray
    current_limit: FloatArray
    voltage_limit: FloatArray
    current_time_constant: FloatArray
    backlash: FloatArray
    restitution: FloatArray

    @property
    def reflected_inertia(self) -> FloatArray:
        """Return N² J_r, (n,) [kg·m²] or [kg], on the joint side."""
        return np.asarray(self.gear_ratio**2 * self.rotor_inertia)

    def motor_torque(self, effort: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return K_t i, (..., n) [N·m], for a joint effort at velocity v and acceleration a."""
        rotor = self.reflected_inertia * a
        passed = effort - rotor
        return np.asarray(
            rotor / self.gear_ratio + passed / (self.gear_ratio * self._gain(passed, v)))

    def effort(self, motor_torque: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return the joint effort, (..., n) [N·m] or [N], of a motor torque."""
        rotor = self.reflected_inertia * a
        at_gear = motor_torque * self.gear_ratio - rotor
        return np.asarray(rotor + at_gear * self._gain(at_gear, v))

    def current(self, motor_torque: FloatArray) -> FloatArray:
        """Return the current i, (..., n) [A]."""
        return np.asarray(motor_torque / self.torque_constant)

    def voltage(
        self, current: FloatArray, v: FloatArray, current_rate: FloatArray | float = 0.0,
    ) -> FloatArray:
        """Return the voltage V, (..., n) [V], at a current that changes by current_rate [A/s]."""
        return np.asarray(
            self.resistance * current + self.inductance * current_rate
            + self.back_emf_constant * self.gear_ratio * v)

    def current_range(self, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """
        Return the least and the largest steady current (..., n) [A] within both limits.

        The voltage stays within ±V_max at every speed. Beyond the speed K_e |ω| = V_max + R i_max
        no current is within both limits: then both ends are (±V_max − K_e ω) / R, the braking
        current at full voltage, which exceeds the current limit.
        """
        back_emf = self.back_emf_constant * self.gear_ratio * v
        with np.errstate(divide='ignore', invalid='ignore'):
            low, high = (
                np.where(np.isfinite(voltage), (voltage - back_emf) / self.resistance, voltage)
                for voltage in (-self.voltage_limit, self.voltage_limit))
        limit = self.current_limit
        return np.clip(-limit, low, high), np.clip(limit, low, high)

    def effort_range(self, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the torque–speed envelope: efforts (..., n) that are steady at the velocity v."""
        low, high = self.current_range(v)
        zero = np.zeros_like(v)
        one = self.effort(low * self.torque_constant, v, zero)
        other = self.effort(high * self.torque_constant, v, zero)
        # A gearbox that reverses the direction, N < 0, exchanges the two ends.
        return np.minimum(one, other), np.maximum(one, other)

    def load(self, effort: FloatArray, v: FloatArray, a: FloatArray) -> 'ActuatorLoad':
        """Return the currents and voltages of the motors that a joint effort requires."""
        current = self.current(self.motor_torque(effort, v, a))
        voltage = self.voltage(current, v)
        return ActuatorLoad(
            current, voltage, np.abs(current) / self.current_limit,
            np.abs(voltage) / self.voltage_limit)

    def _gain(self, effort: FloatArray, v: FloatArray) -> FloatArray:
        """Return η if the power flows to the joint or is zero (the worse case), else 1/η."""
        absorbs = np.sign(effort) * np.sign(v) < 0.0
        return np.where(absorbs, 1.0 / self.efficiency, self.efficiency)


class ActuatorLoad(NamedTuple):
    """
    Steady current [A] and voltage [V] of each motor, (..., n), and their ratios to the limits.

    A ratio is 0 if there is no limit.
    """

    current: FloatArray
    voltage: FloatArray
    current_ratio: FloatArray
    voltage_ratio: FloatArray


def make_actuators(
    joint_names: Sequence[str], torque_constant: npt.ArrayLike, gear_ratio: npt.ArrayLike, *,
    reflected_inertia: npt.ArrayLike = (), **further: npt.ArrayLike,
) -> Actuators:
    """
    Return checked actuators; each parameter is (n,), one number for all joints, or empty.

    `further` are other parameters of `Actuators`, by their names. Empty means: K_e = K_t (equal in
    SI units), no resistance, inductance or rotor inertia, η = 1, no limits, no backlash, e = 0.
    `reflected_inertia` N² J_r [kg·m²] or [kg] may replace `rotor_inertia` J_r of a joint. Raises
    InvalidInputError, naming field, joint and value, for an unknown parameter, another number of
    values, N = 0, η outside (0, 1], e outside [0, 1], backlash of a rotor without inertia, both
    inertias of one rotor, and a value that must not be negative or zero. Values below
    SMALLEST_DIVISOR count as zero.
    """
    n, names = len(joint_names), [field.name for field in fields(Actuators)]
    given = {'torque_constant': torque_constant, 'gear_ratio': gear_ratio, **further}
    unknown = sorted(set(given) - set(names))
    if unknown:
        raise InvalidInputError(f'actuator.{unknown[0]} is unknown, expected one of {names}')
    nothing, unlimited = np.zeros(n), np.full(n, np.inf)
    otherwise = {
        'back_emf_constant': per_joint_values(
            'actuator.torque_constant', torque_constant, joint_names, nothing),
        'efficiency': np.ones(n), 'current_limit': unlimited, 'voltage_limit': unlimited,
        'current_time_constant': np.full(n, DEFAULT_CURRENT_TIME_CONSTANT)}
    values = {name: per_joint_values(
        f'actuator.{name}', given.get(name, ()), joint_names, otherwise.get(name, nothing))
        for name in names}
    J = make_reflected_inertia(joint_names, reflected_inertia)
    for name, of_motor, of_joint in zip(joint_names, values['rotor_inertia'], J):
        if of_motor != 0.0 and of_joint != 0.0:
            raise InvalidInputError(
                f'actuator.rotor_inertia of {name!r} is {of_motor:g} and '
                f'actuator.reflected_inertia is {of_joint:g}, expected one of them, the other '
                '0 or not set')
    for name in ('torque_constant', 'gear_ratio'):
        if is_empty(given[name]):
            raise InvalidInputError(
                f'actuator.{name} is empty, expected one value for all of {list(joint_names)} or '
                'one value per joint; only actuator.reflected_inertia needs no motor data')
    N_squared = np.maximum(np.square(values['gear_ratio']), SMALLEST_DIVISOR**2)
    values['rotor_inertia'] = values['rotor_inertia'] + J / N_squared
    actuators = Actuators(**values)
    _check(joint_names, actuators)
    return actuators


def make_reflected_inertia(joint_names: Sequence[str], value: npt.ArrayLike) -> FloatArray:
    """
    Return checked reflected rotor inertias (n,) [kg·m²] or [kg] of joints; empty means 0.

    `value` is (n,), one number for all joints, or empty. Raises InvalidInputError, naming the
    joint and the value, for another number of values, and for a negative or non-finite value.
    """
    J = per_joint_values(
        'actuator.reflected_inertia', value, joint_names, np.zeros(len(joint_names)))
    for name, inertia in zip(joint_names, J.tolist()):
        check_scalar(f'actuator.reflected_inertia of {name!r}', inertia, minimum=0.0)
    return J


def _check(names: Sequence[str], actuators: Actuators) -> None:
    eta, e, zero = actuators.efficiency, actuators.restitution, SMALLEST_DIVISOR
    positive = f'a number > 0, at least {zero:g}'
    bad = {
        'torque_constant': (actuators.torque_constant < zero, positive),
        'gear_ratio': (
            np.abs(actuators.gear_ratio) < zero,
            f'a number other than 0, at least {zero:g} in size'),
        'efficiency': ((eta < zero) | (eta > 1.0), f'a number in (0, 1], at least {zero:g}'),
        'current_limit': (actuators.current_limit < zero, positive),
        'voltage_limit': (actuators.voltage_limit < zero, positive),
        'current_time_constant': (actuators.current_time_constant < zero, positive),
        'restitution': ((e < 0.0) | (e > 1.0), 'a number in [0, 1]'),
        'rotor_inertia': (
            (actuators.rotor_inertia < 0.0) | (
                (actuators.rotor_inertia < zero) & (actuators.backlash > 0.0)),
            'a number > 0 where there is backlash (or a reflected_inertia > 0), >= 0 elsewhere'),
        'resistance': (
            (actuators.resistance < 0.0) | (
                (actuators.resistance < zero) & np.isfinite(actuators.voltage_limit)),
            'a number > 0 where there is a voltage_limit, >= 0 elsewhere'),
    }
    for field in fields(actuators):
        values = getattr(actuators, field.name)
        wrong, expected = bad.get(field.name, (values < 0.0, 'a number >= 0'))
        if wrong.any():
            joint = int(np.argmax(wrong))
            raise InvalidInputError(
                f'actuator.{field.name} of {names[joint]!r} is {values[joint]:g}, '
                f'expected {expected}')
