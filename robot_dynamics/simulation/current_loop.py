# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The electrical side of simulated actuators: a current loop with current and voltage limits.

The drive converts a joint effort to a current set-point i*, and its loop controls the current with
the time constant T_c, as long as the required voltage is within the limit:

    di/dt = (i* − i) / T_c    while |R i + K_e ω + L (i* − i) / T_c| ≤ V_max,
    L di/dt = ±V_max − R i − K_e ω    otherwise.

Both equations are linear. With ω at the middle of a step, current and mean current over the step
have a closed form, for any ratio of L/R and T_c to the step (an exponential integrator; M.
Hochbruck and A. Ostermann, Acta Numerica 19, 2010, section 2). If the voltage is at its limit, the
back-EMF brakes the motor like viscous friction, which may be stiff relative to the step:
`CurrentLoopStep.implicit` handles this case.
"""

from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.actuator import Actuators


class CurrentLoopStep(NamedTuple):
    """The mean joint effort over a step, and its decrease per [rad/s] of velocity, (n,)."""

    effort: FloatArray
    damping: FloatArray

    def implicit(self, before: FloatArray, M: FloatArray, h: float) -> FloatArray:
        """
        Return the effort (n,) over the step of h [s] including its own effect on the velocity.

        `before` (n,) is the effort of the previous step, whose acceleration predicted the
        velocity. For a single motor this is the implicit midpoint rule, which is stable for every
        step.
        """
        n = len(before)
        feedback = 0.5 * h * self.damping[:, None] * np.linalg.inv(M)
        change = np.linalg.solve(np.eye(n) + feedback, self.effort - before)
        return np.asarray(before + change, dtype=np.float64)


class CurrentLoop:
    """The motors of n joints with their current (n,) [A]; starts without current."""

    def __init__(self, actuators: Actuators) -> None:
        self.actuators = actuators
        self.current = np.zeros_like(actuators.gear_ratio)
        self._inert = actuators.inductance > 0.0
        self._loop_gain = actuators.inductance / actuators.current_time_constant
        self._back_emf = actuators.back_emf_constant * actuators.gear_ratio

    def effort_over_step(
        self, effort: FloatArray, v: FloatArray, h: float,
    ) -> CurrentLoopStep:
        """
        Return the mean joint effort (n,) over a step of h [s], and advance the current.

        `effort` is the commanded effort, v is the velocity of the motors in the middle of the
        step, divided by the gear ratio. The drive does not know the acceleration: the effort of
        the rotor is scaled by the efficiency as well.
        """
        motors, unknown = self.actuators, np.zeros_like(v)
        wanted = np.clip(
            motors.current(motors.motor_torque(effort, v, unknown)),
            -motors.current_limit, motors.current_limit)
        mean, fraction = self._settle(wanted, v, h)
        effort = motors.effort(motors.torque_constant * mean, v, unknown)
        with np.errstate(divide='ignore', invalid='ignore'):
            per_ampere = np.where(mean == 0.0, 0.0, effort / mean)
            damping = np.where(fraction > 0.0, fraction * per_ampere * self._back_emf / (
                motors.resistance), 0.0)
        return CurrentLoopStep(effort, damping)

    def _settle(
        self, wanted: FloatArray, v: FloatArray, h: float,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the mean current (n,) over h [s], and the factor by which back-EMF reduces it."""
        motors = self.actuators
        i, charge, rest, fraction = self._saturated(wanted, v, h)
        i, more = _relax(i, wanted, motors.current_time_constant, rest)
        mean = (charge + more) / h
        if self._inert.all():
            self.current = i
            return np.asarray(mean), fraction
        low, high = motors.current_range(v)  # without inductance, at once
        direct = np.clip(wanted, low, high)
        by_voltage = direct != wanted  # `wanted` is already within the current limit
        self.current = np.where(self._inert, i, direct)
        return np.where(self._inert, mean, direct), np.where(self._inert, fraction, by_voltage)

    def _saturated(
        self, wanted: FloatArray, v: FloatArray, h: float,
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """
        Return current, its integral, and the remaining time [s], after the voltage saturation.

        The last value is d(mean current)/d(steady current at this voltage), both over h.
        """
        motors, i = self.actuators, self.current
        back_emf = self._back_emf * v
        demand = motors.resistance * i + back_emf + self._loop_gain * (wanted - i)
        saturated = self._inert & (np.abs(demand) > motors.voltage_limit)
        charge, rest, fraction = np.zeros_like(v), np.full_like(v, h), np.zeros_like(v)
        if not saturated.any():
            return i, charge, rest, fraction
        i = i.copy()
        for j in np.flatnonzero(saturated):
            R, gain = motors.resistance[j], self._loop_gain[j]
            limit = np.copysign(motors.voltage_limit[j], demand[j])
            asymptote, electric = (limit - back_emf[j]) / R, motors.inductance[j] / R
            # the time at which the demand of the loop returns to the limit
            leave = (limit - back_emf[j] - gain * wanted[j]) / (R - gain) if gain != R else np.inf
            rest_of_way = (leave - asymptote) / (i[j] - asymptote)
            until = min(h, -electric * np.log(rest_of_way)) if 0.0 < rest_of_way < 1.0 else h
            i[j], charge[j] = _relax(i[j], asymptote, electric, until)
            rest[j] = h - until
            fraction[j] = (until - electric * (1.0 - np.exp(-until / electric))) / h
        return i, charge, rest, fraction


def _relax(i: Any, target: Any, time_constant: Any, t: Any) -> tuple[Any, Any]:
    """Return the current after t, and its integral, for an exponential approach to a target."""
    decay = np.exp(-t / time_constant)
    return (target + (i - target) * decay,
            target * t + (i - target) * time_constant * (1.0 - decay))
