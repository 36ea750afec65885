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
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.joints.angle_wrapping import nearest_turn
from robot_dynamics.validation import check_scalar

SETTLING_TIME = 7.0
"""[1/ω] after which the effect of the initial state is below 1 %."""
_HELD = np.array([[False], [False], [True]])
"""Of position, velocity and effort: what a drive holds."""


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

    def update(self, sample: FloatArray, dt: float, held: bool | BoolArray = False) -> FloatArray:
        """
        Return y at a sample dt [s] after the previous one; the first sample is a steady state.

        `held` states that the signal had the value of this sample since the previous sample, such
        as an effort that a drive holds; otherwise the signal is interpolated linearly.
        """
        if self.value is None:
            self.value, self.rate = sample.copy(), np.zeros_like(sample)
            self._sample = sample
            return self.value
        before = np.where(held, sample, self._sample)
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


class StateFilter:
    """One filter for position, velocity and effort of an arm, and its acceleration."""

    def __init__(self, cutoff: float, is_continuous: BoolArray) -> None:
        """`cutoff` [Hz] > 0, `is_continuous` (n,); raises InvalidInputError."""
        self.low_pass, self._is_continuous = LowPass(cutoff), is_continuous
        self.restart()

    def restart(self) -> None:
        """Reset the filter; the next state is a first one."""
        self.low_pass.restart()
        self._last: FloatArray | None = None
        self._settled = 0.0

    @property
    def state(self) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """The filtered position, velocity and acceleration, each (n,); None before a state."""
        value, rate = self.low_pass.value, self.low_pass.rate
        return None if value is None else (value[0], value[1], rate[1])

    def update(
        self, dt: float, q: FloatArray, v: FloatArray, effort: FloatArray,
    ) -> FloatArray | None:
        """
        Return the filtered effort (n,) at a state dt [s] after the previous one.

        Steps of whole turns of the position are removed. Returns None until the filter has
        settled, `LowPass.settling_time` after the first state.
        """
        if self._last is not None:
            self._settled += dt
            q = nearest_turn(q, self._last, self._is_continuous)
        self._last = q
        found = self.low_pass.update(np.stack([q, v, effort]), dt, _HELD)
        return None if self._settled < self.low_pass.settling_time else found[2]
