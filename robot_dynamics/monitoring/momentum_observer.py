# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The generalised-momentum observer, which estimates the external effort on the joints.

With the momentum p = M(q) q̇, the manipulator equation reads ṗ = τ + Cᵀ q̇ − g − τ_f + τ_ext: the
only unknown term is τ_ext. The residual

    r = K (p(t) − p(0) − ∫ (τ + Cᵀ q̇ − g − τ_f + r) dt)     so that    ṙ = K (τ_ext − r)

follows τ_ext like a first-order low-pass filter, independently for each joint, without
acceleration and without inverting M. Sources: A. De Luca and R. Mattone, "Actuator failure
detection and isolation using generalized momenta", ICRA 2003; "Sensorless robot collision
detection and hybrid force/motion control", ICRA 2005; S. Haddadin, A. De Luca, A. Albu-Schäffer,
"Robot collisions: a survey on detection, isolation, and identification", IEEE Trans. Robotics
33(6), 2017, section V-E.
"""

import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.validation import check_scalar


class MomentumObserver:
    """The filter of the observer, for n joints; `estimate` (n,) is r [N·m] or [N]."""

    def __init__(self, joint_count: int, bandwidth: float) -> None:
        """Start at r = 0; `bandwidth` [Hz] > 0 is K / 2π. Raises InvalidInputError."""
        self.estimate: FloatArray = np.zeros(joint_count)
        self.set_bandwidth(bandwidth)

    def set_bandwidth(self, bandwidth: float) -> None:
        """Continue from the current estimate with another bandwidth [Hz]."""
        self.gain = 2.0 * math.pi * check_scalar(
            'bandwidth', bandwidth, 0.0, exclusive_minimum=True)

    def restart(self) -> None:
        """Reset the estimate: r = 0."""
        self.estimate = np.zeros_like(self.estimate)

    def update(self, momentum_change: FloatArray, impulse: FloatArray, dt: float) -> FloatArray:
        """
        Return the estimate dt [s] after the previous one.

        `momentum_change` (n,) is the change of p over dt, `impulse` (n,) is the integral
        ∫ (τ + Cᵀq̇ − g − τ_f) dt over dt, both [N·m·s] or [N·s]. Their difference divided by dt is
        the mean of τ_ext. The step is the exact solution for a constant τ_ext, so that it is
        stable at any K dt.
        """
        fraction = -math.expm1(-self.gain * dt)
        mean = (momentum_change - impulse) / dt
        self.estimate = self.estimate + fraction * (mean - self.estimate)
        return self.estimate
