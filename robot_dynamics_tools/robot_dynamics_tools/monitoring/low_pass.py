# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A causal second-order low-pass filter that also returns the derivative, for uneven stamps.

    ÿ = ω² (u − y) − √2 ω ẏ

is a Butterworth filter with the cut-off ω: y follows u, and ẏ is exactly the derivative of y. Its
group delay is √2 / ω at low frequencies. Between two samples u is a straight line, or constant at
the later sample. Both cases have a closed-form solution, so that a step of any length is exact and
stable. Source: A. V. Oppenheim and A. S. Willsky, *Signals and Systems*, 2nd edition,
section 6.5.2 (second-order systems), here with the damping ratio 1/√2.
"""

import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.validation import check_scalar

SETTLING_TIME = 7.0
"""[1/ω] after which the effect of the initial state is below 1 %."""


class LowPass:
    """Second-order low-pass filters of several signals, all with the same cut-off."""

    def __init__(self, cutoff: float) -> None:
        """`cutoff` [Hz] > 0; without a value until the first sample. Raises InvalidInputError."""
        self.value: FloatArray | None = None
        """y, of the shape of the samples."""
        self.rate: FloatArray = np.zeros(0)
        """ẏ, of the shape of the samples, in the unit of y per second."""
        self._sample: FloatArray = np.zeros(0)
        self.set_cutoff(cutoff)

    def set_cutoff(self, cutoff: float) -> None:
        """Continue from the current state with another cut-off [Hz]."""
        self.omega = 2.0 * math.pi * check_scalar('cutoff', cutoff, 0.0, exclusive_minimum=True)

    @property
    def settling_time(self) -> float:
        """The time [s] until the effect of the initial state is below 1 %."""
        return SETTLING_TIME / self.omega

    def restart(self) -> None:
        """Reset the filter; the next sample is a first one."""
        self.value = None

    def update(self, sample: FloatArray, dt: float, held: bool = False) -> FloatArray:
        """
        Return y at a sample dt [s] after the previous one; the first sample is a steady state.

        `held` states that the signal had the value of this sample since the previous sample, such
        as an effort that a drive holds; otherwise the signal is interpolated linearly.
        """
        if self.value is None:
            self.value, self.rate = sample.copy(), np.zeros_like(sample)
            self._sample = sample
            return self.value
        before = sample if held else self._sample
        slope = (sample - before) / dt
        lag = math.sqrt(2.0) / self.omega
        # The steady response to a straight line is the same line, √2/ω late; the rest decays.
        y, rate = self.value - (before - lag * slope), self.rate - slope
        d = self.omega / math.sqrt(2.0)
        decay, c, s = math.exp(-d * dt), math.cos(d * dt), math.sin(d * dt)
        self.value = sample - lag * slope + decay * ((c + s) * y + s / d * rate)
        self.rate = slope + decay * ((c - s) * rate - 2.0 * d * s * y)
        self._sample = sample
        return self.value
