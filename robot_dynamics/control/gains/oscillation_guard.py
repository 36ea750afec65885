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
residual with the variance (2 + a²) σ². Oscillations of several frequencies, as those of coupled
joints with elastic gearboxes, look like noise in this test. They count if the mean amplitude of
the half-waves of a WINDOW is LOUD times that of the quietest window before, and is sustained.

Coupled joints oscillate together. Factors that differ among them can let them oscillate at any
gain: elastic joints with rotors J see the gains J⁻¹ M S, which have complex eigenvalues if the
factors S differ. Joints that oscillate with at least SHARE of the amplitude are lowered together.

An oscillation that does not depend on the gains, such as that of a machine nearby or of a filter,
has not decreased when they reach LEAST: if it is smaller than HARMLESS, they are then restored,
and only a larger oscillation of this joint counts.
"""

import math

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
WINDOW, LEAST_COUNT = 0.2, 4
"""[s] over which amplitudes are averaged, and the least number of half-waves in it."""
LOUD, FORGETTING = 4.0, 0.02
"""Mean amplitude of an oscillation by that of the quietest window, and its increase per window."""
STEP, LEAST = 0.7, 0.1
"""Factor of the bandwidth after an event, and the smallest product of these factors."""
SETTLING = 1.0
"""[s] after the last change of a factor until an oscillation at LEAST is judged."""
SAME, HIGHER = 0.5, 3.0
"""Amplitude at LEAST, by the largest before, of an oscillation that does not depend on the gains,
and the threshold after it, by that amplitude."""
SHARE, HARMLESS = 0.2, 0.1
"""Least amplitude of a joint that is lowered with another, by that of the other, and [rad/s] or
[m/s] up to which an oscillation at LEAST is left to gains that are restored."""
_MEMORY, _LEAST_WEIGHT, _LARGEST_WEIGHT = 0.1, 0.02, 0.1
"""[s] and weights of a state in the estimate of the noise."""


class _Noise:
    """The moments of the samples of one signal."""

    def __init__(self) -> None:
        self.xx = self.xy = self.yy = 0.0

    def take(self, weight: float, before: float, x: float, after: float) -> None:
        """Take three successive samples."""
        y = before + after
        self.xx += weight * (x * x - self.xx)
        self.xy += weight * (x * y - self.xy)
        self.yy += weight * (y * y - self.yy)

    def explains(self, x: float) -> bool:
        """Return whether white noise can explain a sample."""
        residual = self.yy * self.xx - self.xy**2  # σ² (2 + a²) xx, with a = xy / xx
        return x * x * (2.0 * self.xx**2 + self.xy**2) <= NOISE_FACTOR**2 * self.xx * residual


class _HalfWaves:
    """The half-waves of a signal."""

    def __init__(self) -> None:
        self.sign, self.since, self.peak, self.before = 0, 0.0, 0.0, 0.0
        self.count = 0
        """Successive short half-waves."""
        self.peaks: list[float] = []
        self.times: list[float] = []

    def begin(self, now: float, x: float) -> bool:
        """Begin a half-wave; return whether the one before it was short."""
        duration, self.since = now - self.since, now
        self.before, self.peak = self.peak, abs(x)
        self.sign = 1 if x > 0.0 else -1
        if not 0.0 < duration <= LONGEST:
            self.count, self.peaks, self.times = 0, [], []
            return False
        self.count += 1
        self.peaks.append(self.before)
        self.times.append(duration)
        return True

    def amplitude(self, now: float) -> float:
        """Return that of the last two half-waves, 0 if they are older than LONGEST."""
        return max(self.peak, self.before) if now <= self.since + LONGEST else 0.0

    @property
    def frequency(self) -> float:
        """[Hz], of the last half-waves."""
        times = self.times[-HALF_WAVES // 2:]
        return 0.5 * len(times) / sum(times)


class _Regular(_HalfWaves):
    """HALF_WAVES successive half-waves of similar amplitudes."""

    def is_event(self, now: float, x: float) -> bool:
        """Begin a half-wave; return whether those before it are a sustained oscillation."""
        if not self.begin(now, x):
            return False
        del self.peaks[:-HALF_WAVES], self.times[:-HALF_WAVES]
        half = HALF_WAVES // 2
        first, second = self.peaks[:half], self.peaks[half:]
        return len(second) == half and max(second) >= SUSTAINED * max(first) and (
            min(second) >= REGULAR * max(second))


class _Irregular(_HalfWaves):
    """Half-waves whose mean amplitude is compared with that of the quietest WINDOW."""

    def __init__(self) -> None:
        super().__init__()
        self._begin, self._before, self._quietest = 0.0, 0.0, math.inf

    def begin_at_rest(self, now: float) -> None:
        """Begin with a signal that has no half-waves."""
        self._begin = now

    def is_event(self, now: float, x: float) -> bool:
        """Begin a half-wave; return whether a WINDOW ended that is a sustained oscillation."""
        if self.sign == 0 and now > self._begin + LONGEST:
            self._quietest = FLOOR
        if not self.begin(now, x):
            self._begin, self._before = now, 0.0
            return False
        if now < self._begin + WINDOW or len(self.peaks) < LEAST_COUNT:
            return False
        mean, before = sum(self.peaks) / len(self.peaks), self._before
        is_event = before > LOUD * self._quietest and mean >= SUSTAINED * before
        self._quietest = min((1.0 + FORGETTING) * self._quietest, mean)
        self._begin, self._before = now, mean
        if not is_event:
            self.peaks, self.times = [], []
        return is_event


class _Joint:
    """What is known of the oscillations of one joint."""

    def __init__(self) -> None:
        self.noise, self.regular, self.irregular = _Noise(), _Regular(), _Irregular()
        self.least, self.largest = FLOOR, 0.0

    def forget(self) -> None:
        """Forget the half-waves before the present ones."""
        for waves in self.regular, self.irregular:
            waves.count, waves.peaks, waves.times = 0, [], []

    def frequency(self, now: float, x: float, ripple: float) -> float:
        """Return that of an oscillation which a sample completes [Hz], 0 without one."""
        found, is_small = 0.0, abs(x) < self.least or abs(x) < ripple
        for waves in self.regular, self.irregular:
            if is_small or x * waves.sign > 0.0:
                waves.peak = max(waves.peak, abs(x))
            elif (waves is self.irregular or not self.noise.explains(x)) and (
                    waves.is_event(now, x)):
                found = waves.frequency
        return found


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
        if not before:
            for one in self._joints:
                one.irregular.begin_at_rest(now)
            return False
        if max(x) < FLOOR and min(x) > -FLOOR:
            return False
        weight = min(max(dt / _MEMORY, _LEAST_WEIGHT), _LARGEST_WEIGHT)
        events = []
        for j, (one, x_0, x_1, x_2) in enumerate(zip(self._joints, before, last, x)):
            one.noise.take(weight, x_0, x_1, x_2)
            frequency = one.frequency(now, x_2, ripple)
            if frequency:
                events.append((one.irregular.amplitude(now), j, frequency))
        return bool(events) and self._lower(now, *max(events))

    def _lower(self, now: float, amplitude: float, event: int, frequency: float) -> bool:
        """Lower the gains of joints, or restore them if they do not cause the oscillation."""
        joints = [
            (j, one, size) for j, one in enumerate(self._joints)
            if (size := one.irregular.amplitude(now)) >= SHARE * amplitude and (
                j == event or one.irregular.count >= HALF_WAVES)]
        scale = self.scale.copy()
        for j, one, size in joints:
            one.largest = max(one.largest, size)
            if STEP * scale[j] >= LEAST:
                scale[j] *= STEP
        if (scale == self.scale).all():
            if now < self._changed + SETTLING or not all(
                    SAME * one.largest <= size <= HARMLESS for _, one, size in joints):
                return False
            for j, one, size in joints:
                scale[j], one.least, one.largest = 1.0, HIGHER * size, 0.0
        for j, one, _ in joints:
            self.frequency[j] = frequency
            one.forget()
        self.scale, self._changed = scale, now
        return True
