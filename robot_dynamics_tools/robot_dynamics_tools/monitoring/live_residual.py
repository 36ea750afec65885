# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The residual, measured minus modelled effort, while the arm runs.

`ros2 dynamics analyze` computes the same difference from a recording.
A recording is filtered forwards and backwards, without delay. Live data have no later samples:
position, velocity and effort pass the same causal filter (`low_pass`), whose derivative of the
velocity is the acceleration. Measured and modelled effort therefore refer to the same instant,
√2/ω ago, and to the same frequency band.
"""

import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.angle_wrapping import nearest_turn
from robot_dynamics.model.arm_dynamics import ArmDynamics, model_terms
from robot_dynamics_tools.monitoring.low_pass import LowPass

NOISE_BANDWIDTH = 0.25 * math.pi * math.sqrt(2.0)
"""Equivalent noise bandwidth of the filter, as a multiple of its cut-off."""


class LiveResidual:
    """Compares the measured effort of an arm with its model, state by state."""

    def __init__(self, dynamics: ArmDynamics, bandwidth: float) -> None:
        """Filter at `bandwidth` [Hz] > 0, the cut-off; raise InvalidInputError."""
        self._dynamics = dynamics
        self._position, self._velocity = LowPass(bandwidth), LowPass(bandwidth)
        self._effort = LowPass(bandwidth)
        self._is_continuous = dynamics.arm.is_continuous
        self._last: FloatArray | None = None
        self._settled = 0.0

    def set_bandwidth(self, bandwidth: float) -> None:
        """Continue with another cut-off [Hz]."""
        for low_pass in (self._position, self._velocity, self._effort):
            low_pass.set_cutoff(bandwidth)

    @property
    def noise_bandwidth(self) -> float:
        """The equivalent noise bandwidth of the filter [Hz]."""
        return NOISE_BANDWIDTH * self._velocity.omega / (2.0 * math.pi)

    @property
    def state(self) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """The filtered position, velocity and acceleration, each (n,); None before a state."""
        q, v = self._position.value, self._velocity.value
        return None if q is None or v is None else (q, v, self._velocity.rate)

    def set_dynamics(self, dynamics: ArmDynamics) -> None:
        """Continue with another model of the same joints, for example with an attached load."""
        self._dynamics = dynamics

    def restart(self) -> None:
        """Reset the filter; the next state is a first one."""
        for low_pass in (self._position, self._velocity, self._effort):
            low_pass.restart()
        self._last, self._settled = None, 0.0

    def update(
        self, dt: float, q: FloatArray, v: FloatArray, effort: FloatArray,
    ) -> FloatArray | None:
        """
        Return the residual (n,), measured − model, at a state dt [s] after the previous one.

        `effort` (n,) [N·m] or [N] is measured, on the joint side of the gearbox. Returns None
        until the filter has settled, `LowPass.settling_time` after the first state.
        """
        if self._last is not None:
            self._settled += dt
        q_f = self._position.update(self._unwound(q), dt)
        v_f = self._velocity.update(v, dt)
        measured = self._effort.update(effort, dt, held=True)
        if self._settled < self._velocity.settling_time:
            return None
        terms = model_terms(
            self._dynamics, q_f[None], v_f[None], self._velocity.rate[None])
        return np.asarray(measured - terms.effort[0])

    def _unwound(self, q: FloatArray) -> FloatArray:
        """Return the position without steps of whole turns in the encoder readings."""
        self._last = q if self._last is None else nearest_turn(q, self._last, self._is_continuous)
        return self._last
