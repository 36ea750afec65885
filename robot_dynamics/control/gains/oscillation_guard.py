# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Joints that oscillate although the model of the loop is stable: how much their gains are lowered.

Elastic gearboxes, friction that yields before it slides, and rotors and delays that are not known
can make a loop oscillate. A stable loop never shows HALF_WAVES successive half-waves of the
velocity error, each shorter than LONGEST, whose amplitude does not decrease. The bandwidth of
such a joint is multiplied by STEP, and again if the oscillation persists.

White noise is no oscillation: a half-wave must exceed NOISE_FACTOR standard deviations σ of it.
Samples x_k of an oscillation of any frequency obey x_{k+1} + x_{k-1} = a x_k; noise adds a
residual with the variance (2 + a²) σ². An oscillation that does not depend on the gains, such as
that of a machine nearby or of a filter, has not decreased when they reach LEAST: they are then
restored, and only a larger oscillation of this joint counts.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray

HALF_WAVES = 8
"""Half-waves of an event."""
LONGEST = 0.065
"""[s], the longest half-wave: that of the crossover of the default gains is 0.076 s."""
SUSTAINED = 0.9
"""Largest peak of the second half of an event, by that of the first half, at least."""
REGULAR = 0.5
"""Smallest peak of the second half, by its largest, at least: peaks of noise differ more."""
FLOOR, RIPPLE = 2.5e-4, 0.05
"""[rad/s] or [m/s] that a half-wave must exceed, and share of the velocity of the reference."""
NOISE_FACTOR = 3.0
"""Standard deviations of the noise of the velocity that a half-wave must exceed."""
STEP, LEAST = 0.7, 0.1
"""Factor of the bandwidth after an event, and the smallest product of these factors."""
SETTLING = 1.0
"""[s] after the last change of a factor until an oscillation at LEAST is judged."""
SAME, HIGHER = 0.5, 3.0
"""Amplitude at LEAST, by the largest before, of an oscillation that does not depend on the gains,
and the threshold after it, by that amplitude."""
_MEMORY, _LEAST_WEIGHT, _LARGEST_WEIGHT = 0.1, 0.02, 0.1
"""[s] and weights of a state in the estimate of the noise."""


class _Joint:
    """The half-waves of the velocity error of one joint, and the moments of its samples."""

    def __init__(self) -> None:
        self.sign, self.since, self.peak = 0, 0.0, 0.0
        self.peaks: list[float] = []
        self.times: list[float] = []
        self.xx = self.xy = self.yy = 0.0
        self.least, self.largest = FLOOR, 0.0

    def is_noise(self, x: float) -> bool:
        """Return whether white noise can explain a sample."""
        residual = self.yy * self.xx - self.xy**2  # σ² (2 + a²) xx, with a = xy / xx
        return x * x * (2.0 * self.xx**2 + self.xy**2) <= NOISE_FACTOR**2 * self.xx * residual

    def begin_half_wave(self, now: float, x: float) -> bool:
        """Begin a half-wave; return whether those before it are a sustained oscillation."""
        duration, self.since = now - self.since, now
        peak, self.peak = self.peak, abs(x)
        self.sign = 1 if x > 0.0 else -1
        if not 0.0 < duration <= LONGEST:
            self.peaks, self.times = [], []
            return False
        self.peaks = [*self.peaks[1 - HALF_WAVES:], peak]
        self.times = [*self.times[1 - HALF_WAVES:], duration]
        half = HALF_WAVES // 2
        first, second = self.peaks[:half], self.peaks[half:]
        return len(second) == half and max(second) >= SUSTAINED * max(first) and (
            min(second) >= REGULAR * max(second))


class OscillationGuard:
    """The factors of the bandwidth of n joints, which oscillations lower."""

    def __init__(self, n: int) -> None:
        self.scale: FloatArray = np.ones(n)
        """Factors (n,) in [LEAST, 1]."""
        self.frequency: FloatArray = np.zeros(n)
        """[Hz] (n,) of the last oscillation of each joint, 0 without one."""
        self._joints = [_Joint() for _ in range(n)]
        self._before: list[float] = []
        self._last: list[float] = []
        self._time = self._changed = 0.0

    def take(self, now: float, error: FloatArray, speed: float = 0.0) -> bool:
        """
        Take the velocity errors (n,) at a time [s]; return whether a factor has changed.

        `speed` [rad/s] or [m/s] is the largest velocity of the reference. A stream of set-points
        causes a ripple of this velocity at its own rate, which is no oscillation of the loop.
        """
        ripple = RIPPLE * speed
        x: list[float] = error.tolist()
        before, last, self._before, self._last = self._before, self._last, self._last, x
        dt, self._time = now - self._time, now
        if not before or max(x) < FLOOR and min(x) > -FLOOR:
            return False
        weight = min(max(dt / _MEMORY, _LEAST_WEIGHT), _LARGEST_WEIGHT)
        has_changed = False
        for j, (one, x_0, x_1, x_2) in enumerate(zip(self._joints, before, last, x)):
            y = x_0 + x_2
            one.xx += weight * (x_1 * x_1 - one.xx)
            one.xy += weight * (x_1 * y - one.xy)
            one.yy += weight * (y * y - one.yy)
            size = abs(x_2)
            if size < one.least or size < ripple or x_2 * one.sign > 0.0:
                if size > one.peak:
                    one.peak = size
            elif not one.is_noise(x_2) and one.begin_half_wave(now, x_2):
                has_changed = self._lower(j, now) or has_changed
        return has_changed

    def _lower(self, j: int, now: float) -> bool:
        """Lower the gains of a joint, or restore them if they do not cause its oscillation."""
        one = self._joints[j]
        amplitude, factor = max(one.peaks), STEP * float(self.scale[j])
        one.largest = max(one.largest, amplitude)
        if factor < LEAST:
            if now < self._changed + SETTLING or amplitude < SAME * one.largest:
                return False
            factor, one.least, one.largest = 1.0, HIGHER * amplitude, 0.0
        self.frequency[j] = 0.25 * HALF_WAVES / sum(one.times[HALF_WAVES // 2:])
        one.peaks, one.times = [], []
        self.scale, self._changed = self.scale.copy(), now
        self.scale[j] = factor
        return True
