# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Oscillations of the loop: the gains are lowered while a joint oscillates.

Elastic gearboxes, drives that are late and stiff contacts make a loop oscillate whose model is
stable. A stable loop never shows HALF_WAVES successive half-waves of the velocity error, each
shorter than LONGEST, whose second half is SUSTAINED. The bandwidth of all joints is then
multiplied by STEP, again if the oscillation persists: factors that differ among coupled joints
could let them oscillate at any gain.

The full gains are tried again after a hold time. It is HOLD, and doubles if the oscillation
returns within the doubled time; the factor is then the one that was calm. If the position error of
a joint has changed by MOVED, a contact has ended or a load pulls: the full gains act at once, and
the hold time is HOLD again.
"""

from collections import deque
from collections.abc import Sequence
import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.gain_scaling import CROSSOVER, StableGains, USUAL_FREQUENCY

HALF_WAVES = 8
SUSTAINED = 0.9
"""Mean peak of the second half by that of the first, at least."""
LONGEST = 0.5 * math.pi / (CROSSOVER * USUAL_FREQUENCY)
"""[s], the half-wave at twice the crossover of the usual gains: 13 Hz. The compensation of
friction oscillates more slowly (10 Hz at joints without rotors); lower gains do not calm it."""
REST_SPEED = 0.02
"""[rad/s] or [m/s] up to which a joint is at rest; a half-wave must exceed it."""
NOISE_FACTOR = 3.0
"""Standard deviations of the noise of the velocity that a half-wave must exceed: at 1 kHz, one in
20 half-waves of white noise above 3 is shorter than LONGEST."""
STEP = 0.7
LEAST = 0.1
"""Factor of the bandwidth after HALF_WAVES, and the smallest product of these factors."""
HOLD = 1.0
"""[s] without an oscillation, until the full gains are tried again."""
MOVED = REST_SPEED * HOLD
"""[rad] or [m]"""

_Waves = deque[tuple[float, float]]
"""The time [s] and the peak of successive half-waves of one joint."""


class Oscillation:
    """The common factor of the bandwidth of all joints, which oscillations lower."""

    def __init__(self, joint_names: Sequence[str], gains: StableGains) -> None:
        """`gains` have the noise of the velocities."""
        self.factor = 1.0
        """In [LEAST, 1]."""
        self._names, self._gains, self._cause = joint_names, gains, ''
        self._waves: list[_Waves] = [deque(maxlen=HALF_WAVES) for _ in joint_names]
        self._event, self._hold = 0.0, HOLD
        """Time [s] of the last oscillation, and time after it with lower gains."""
        self._trial, self._calm = -math.inf, 1.0
        """Time [s] of the last restoration, and the factor before it."""
        self._error: FloatArray = np.zeros(len(joint_names))
        """Position errors (n,) at the last oscillation."""

    def take(self, now: float, error: FloatArray, velocity_error: FloatArray) -> bool:
        """Take the errors of a state (n,) at a time [s]; return whether `factor` changes."""
        before, noise = self.factor, (NOISE_FACTOR * self._gains.noise).tolist()
        if before < 1.0:
            self._restore(now, error)
        for name, waves, x, least in zip(
                self._names, self._waves, velocity_error.tolist(), noise):
            if abs(x) > max(REST_SPEED, least) and (frequency := _sustained(waves, now, x)):
                self._cause = f'{name!r} oscillated with {frequency:.0f} Hz'
                self._event, self._error = now, error
                self._lower(now)
                break
        return self.factor != before

    def _lower(self, now: float) -> None:
        returns = self.factor == 1.0 and 0.0 <= now - self._trial < 2.0 * self._hold
        if self.factor == 1.0:
            self._hold = 2.0 * self._hold if returns else HOLD
        self.factor = self._calm if returns else max(STEP * self.factor, LEAST)
        for waves in self._waves:
            waves.clear()

    def _restore(self, now: float, error: FloatArray) -> None:
        """Try the full gains again if it is time, or if a joint has left its position."""
        has_moved = bool((np.abs(error - self._error) > MOVED).any())
        if has_moved or not 0.0 <= now - self._event < self._hold:
            self._trial, self._calm = -math.inf if has_moved else now, self.factor
            self.factor = 1.0

    def __str__(self) -> str:
        """Return which joint oscillated, and the factor; '' with full gains."""
        return '' if self.factor == 1.0 else (
            f'{self._cause}: all gains are at {self.factor:.2f} of their bandwidth')


def _sustained(waves: _Waves, now: float, x: float) -> float:
    """Take a sample beyond the floor; return the frequency of an oscillation [Hz], or 0."""
    begin, peak = waves[-1] if waves else (now, 0.0)
    if x * peak > 0.0:
        waves[-1] = begin, max(peak, x, key=abs)
        return 0.0
    if not 0.0 < now - begin < LONGEST:
        waves.clear()
    found, half = 0.0, HALF_WAVES // 2
    if len(waves) == HALF_WAVES:
        peaks = [abs(one) for _, one in waves]
        if sum(peaks[half:]) >= SUSTAINED * sum(peaks[:half]):
            found = half / (now - waves[0][0])
    waves.append((now, x))
    return found
