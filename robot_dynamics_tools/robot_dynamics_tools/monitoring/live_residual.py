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
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics_tools.estimation.model_terms import model_terms
from robot_dynamics_tools.monitoring.low_pass import StateFilter

NOISE_BANDWIDTH = 0.25 * math.pi * math.sqrt(2.0)
"""Equivalent noise bandwidth of the filter, as a multiple of its cut-off."""


class LiveResidual(StateFilter):
    """Compares the measured effort of an arm with its model, state by state."""

    def __init__(self, dynamics: ArmDynamics, bandwidth: float) -> None:
        """Filter at `bandwidth` [Hz] > 0, the cut-off; raise InvalidInputError."""
        super().__init__(bandwidth, dynamics.arm.is_continuous)
        self._dynamics = dynamics

    @property
    def noise_bandwidth(self) -> float:
        """The equivalent noise bandwidth of the filter [Hz]."""
        return NOISE_BANDWIDTH * self.low_pass.omega / (2.0 * math.pi)

    def set_dynamics(self, dynamics: ArmDynamics) -> None:
        """Continue with another model of the same joints, for example with an attached load."""
        self._dynamics = dynamics

    def update(
        self, dt: float, q: FloatArray, v: FloatArray, effort: FloatArray,
    ) -> FloatArray | None:
        """
        Return the residual (n,), measured − model, at a state dt [s] after the previous one.

        `effort` (n,) [N·m] or [N] is measured, on the joint side of the gearbox. Returns None
        until the filter has settled, `LowPass.settling_time` after the first state.
        """
        measured, state = super().update(dt, q, v, effort), self.state
        if measured is None or state is None:
            return None
        terms = model_terms(self._dynamics, *(each[None] for each in state))
        return np.asarray(measured - terms.effort[0])
