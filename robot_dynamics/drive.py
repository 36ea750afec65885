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
The electrical side of simulated actuators: a current loop within its current and voltage.

The drive turns a joint effort into a current to reach, and its loop brings the current there with
the time constant T_c, as long as the voltage for it is within the limit:

    di/dt = (i* − i) / T_c    while |R i + K_e ω + L (i* − i) / T_c| ≤ V_max,
    L di/dt = ±V_max − R i − K_e ω    otherwise.

Both are linear, so that over a step, with ω at its middle, current and mean current follow in
closed form however short L/R and T_c are against the step (an exponential integrator; M. Hochbruck
and A. Ostermann, Acta Numerica 19, 2010, section 2).
"""

import numpy as np
from robot_dynamics.actuator import Actuators
from robot_dynamics.validation import FloatArray


class Drive:
    """The motors of n joints with their current (n,) [A]; starts without current."""

    def __init__(self, actuators: Actuators) -> None:
        self.actuators = actuators
        self.current = np.zeros_like(actuators.gear_ratio)

    def effort_over_step(
        self, effort: FloatArray, v: FloatArray, h: float,
    ) -> FloatArray:
        """
        Return the mean joint effort (n,) over a step of h [s], and advance the current.

        `effort` is what is asked for, v the joints' velocity in the middle of the step. The drive
        does not know the acceleration: what the rotor takes is scaled by the efficiency too.
        """
        motors, unknown = self.actuators, np.zeros_like(v)
        wanted = np.clip(
            motors.current(motors.motor_torque(effort, v, unknown)),
            -motors.current_limit, motors.current_limit)
        mean = self._settle(wanted, v, h)
        return motors.effort(motors.torque_constant * mean, v, unknown)

    def _settle(self, wanted: FloatArray, v: FloatArray, h: float) -> FloatArray:
        """Return the mean current (n,) over h [s] on the way to the wanted one."""
        motors = self.actuators
        low, high = motors.current_range(v)
        inert = motors.inductance > 0.0
        saturated, asymptote, until = self._saturation(wanted, v, h)
        with np.errstate(divide='ignore', invalid='ignore'):
            electric = np.where(saturated, motors.inductance / motors.resistance, 1.0)
        i1, charge1 = _relax(self.current, asymptote, electric, until)
        rest = h - until
        i2, charge2 = _relax(i1, wanted, motors.current_time_constant, rest)
        direct = np.clip(wanted, low, high)
        self.current = np.where(inert, i2, direct)
        return np.asarray(np.where(inert, (charge1 + charge2) / h, direct))

    def _saturation(
        self, wanted: FloatArray, v: FloatArray, h: float,
    ) -> tuple[np.ndarray, FloatArray, FloatArray]:
        """Return which motors lack voltage, the current that they tend to, and until when [s]."""
        motors = self.actuators
        back_emf = motors.back_emf_constant * motors.gear_ratio * v
        gain = motors.inductance / motors.current_time_constant
        demand = motors.resistance * self.current + back_emf + gain * (wanted - self.current)
        limit = np.copysign(motors.voltage_limit, demand)
        saturated = (motors.inductance > 0.0) & (np.abs(demand) > motors.voltage_limit)
        asymptote, until = self.current.copy(), np.zeros_like(v)
        for j in np.flatnonzero(saturated):
            R, L = motors.resistance[j], motors.inductance[j]
            asymptote[j] = (limit[j] - back_emf[j]) / R
            # where the loop's own demand comes back to the limit
            leave = (limit[j] - back_emf[j] - gain[j] * wanted[j]) / (R - gain[j]) if (
                gain[j] != R) else np.inf
            share = (leave - asymptote[j]) / (self.current[j] - asymptote[j])
            until[j] = min(h, -L / R * np.log(share)) if 0.0 < share < 1.0 else h
        return saturated, asymptote, until


def _relax(
    i: FloatArray, target: FloatArray, time_constant: FloatArray, t: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the current after t, and its integral, on an exponential way to a target."""
    decay = np.exp(-t / time_constant)
    return (target + (i - target) * decay,
            target * t + (i - target) * time_constant * (1.0 - decay))
