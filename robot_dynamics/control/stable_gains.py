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
The velocity that the feedback uses, and the fraction of its bandwidth at which it is stable.

PD feedback with natural frequency ω and damping ratio 1 crosses over at ω_x = √(2 + √5) ω, with a
phase margin of 76°. Two delays reduce the margin:

- sampling and transport: half a period of the states, LOOP_DELAY, and the delay of an estimated
  velocity (`velocity_estimate`);
- the rate limit of the effort. Noise σ of the velocity is amplified to M K_d σ. If this noise
  exceeds the changes that the limit τ̇ permits, the limit acts as a low-pass with the time
  constant M K_d σ / (0.8 τ̇): the expected change of a slew-limited value whose input has normal
  noise.

The bandwidth is scaled by the fraction s, with K_p s² and K_d s, so that each phase lag at s ω_x
stays below its bound. If the noise of the measured velocity would lower the gains, the difference
of the measured positions replaces it, provided that the difference has less noise; it is late by
half a period. If s is below 1, M, C and g are those of the position half a period ahead, q + q̇
T/2.
"""

from collections.abc import Sequence
import math

import numpy as np
from robot_dynamics.arrays import FloatArray, wrap_to_pi
from robot_dynamics.control.control_law import Gains

LOOP_DELAY = 0.008
"""[s] allowed for transport and computation, in addition to half a period."""
DELAY_LAG = 0.5
"""[rad] of phase that sampling and transport may take at the crossover."""
NOISE_LAG = 0.1
"""[rad] of phase that the rate limit may take at the crossover."""
CROSSOVER = math.sqrt(2.0 + math.sqrt(5.0))
LESS = 0.5
"""The noise of the position difference must be below this fraction of that of the velocity."""
_SLEW = math.sqrt(2.0 / math.pi)
LEAST = 0.05
"""Smallest fraction s; with noise that requires a smaller one, the loop is no longer stable."""
UNKNOWN = 0.5
"""Factor of s that is used until the quality of the states is known."""
_FORGETTING, _SPARSE_FORGETTING = 0.02, 0.1
"""Weights of a new state in the estimates: if every state is used, and if only few are."""
_TURN, _FEW = 16, 6
"""States between two estimates, and before the first evaluation; fewer suffice without noise."""
_QUIET_TURN = 64
"""States between two evaluations while the noise does not matter."""
PAUSE = 0.5
"""[s]: a longer single gap between two states is a pause of the source, not its period."""
_QUIET = 3.0
"""The fraction s that the noise permits if the noise is negligible."""


class Noise:
    """Running estimate of the standard deviation of white noise on a signal (n,)."""

    def __init__(self, n: int) -> None:
        self._before = self._last = self._variance = np.zeros(n)
        self._consecutive = self._updates = 0

    def restart(self) -> None:
        """Treat the next sample as not following the last one; keep the estimate."""
        self._consecutive = 0

    def take(self, x: FloatArray, forgetting: float) -> None:
        """
        Take a sample, which replaces at least the fraction `forgetting` of the estimate.

        The second difference of a signal contains six times the variance of its white noise, and
        almost none of its motion.
        """
        before, last, self._before, self._last = self._before, self._last, self._last, x
        self._consecutive += 1
        if self._consecutive > 2:
            self._updates += 1
            d = x - 2.0 * last + before
            weight = max(forgetting, 1.0 / self._updates)
            self._variance = self._variance + weight * (d * d / 6.0 - self._variance)

    @property
    def deviation(self) -> FloatArray:
        """The standard deviation, (n,)."""
        return np.asarray(np.sqrt(self._variance))


class StateQuality:
    """The period of the states, the noise of their velocities, and the better velocity."""

    def __init__(self, joint_kinds: Sequence[str]) -> None:
        n = len(joint_kinds)
        self.period = 0.0
        """[s]; follows a longer period at once, and a shorter one in about 50 states."""
        self.differs = False
        """Whether the velocity is the difference of positions."""
        self.velocity_delay = 0.0
        """Delay [s] of the given velocity: 0 for a measured one."""
        self._measured, self._difference = Noise(n), Noise(n)
        self._turns = np.array([kind == 'continuous' for kind in joint_kinds], dtype=bool)
        self._q: FloatArray | None = None
        self._count = 0
        self._is_noisy, self._is_paused = True, False
        self.is_due = False
        """Whether the gains should be evaluated again."""
        self.is_known = False
        """Whether enough states have been received; fewer suffice without noise."""

    def velocity(self, dt: float, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return the velocity to use at a state dt [s] after the last, (n,) each."""
        last, self._q = self._q, q
        if dt <= 0.0 or last is None:
            return v
        was_paused, self._is_paused = self._is_paused, dt >= PAUSE
        if self._is_paused and not was_paused:
            self._measured.restart()
            self._difference.restart()
            return v
        rest = self.period - dt
        self.period = min(dt, 1.0) if rest < 0.0 else dt + (1.0 - _FORGETTING) * rest
        self._count += 1
        phase = self._count % _TURN
        if not self._is_noisy:
            self.is_due = self._count % _QUIET_TURN == 2
            if phase < 3:  # three consecutive states are enough for one estimate
                if phase == 0:
                    self._measured.restart()
                self._measured.take(v, _SPARSE_FORGETTING)
            return v
        self.is_due = phase == 2 or not self.is_known
        self._measured.take(v, _FORGETTING)
        moved = q - last
        if self._turns.any():
            moved = np.where(self._turns, wrap_to_pi(moved), moved)
        difference = moved / dt
        self._difference.take(difference, _FORGETTING)
        if not self.is_known:
            self.differs = bool(
                LESS * self._difference.deviation.sum() < self._measured.deviation.sum())
        return difference if self.differs else v

    def __str__(self) -> str:
        noise = float(self._measured.deviation.max(initial=0.0))
        source = 'differences of the positions' if self.differs else (
            'estimated velocities' if self.velocity_delay else 'measured velocities')
        return (f'joint states at {1.0 / max(self.period, 1e-9):.0f} Hz, velocity noise of up to '
                f'{noise:.2g} per second, {source} in use')

    @property
    def lag(self) -> float:
        """The time [s] from a state to the middle of the period in which its effort acts."""
        return 0.5 * self.period

    def stable_scale(
        self, gains: Gains, mass: FloatArray, effort_rate: FloatArray,
    ) -> float:
        """
        Return the fraction s in (0, 1] of the bandwidth at which the feedback is stable.

        `mass` (n, n) is the largest |M|; `effort_rate` (n,) [N·m/s] or [N/s] is infinite if there
        is no limit. Also chooses the velocity.
        """
        omega = _natural_frequency(gains)
        if omega == 0.0:
            return 1.0

        def largest_scale(noise: FloatArray) -> float:
            effort = np.sqrt((mass * (gains.kd * noise)) ** 2 @ np.ones(len(noise)))
            lag = CROSSOVER * omega * float(np.max(effort / (_SLEW * effort_rate), initial=0.0))
            return math.sqrt(NOISE_LAG / lag) if lag > 0.0 else math.inf

        measured = self._measured.deviation
        if not np.isfinite(measured).all():  # after implausibly large velocities
            self._measured = Noise(len(measured))
            self._count, self.is_known, self.differs = 0, False, False
            measured = self._measured.deviation
        scale = largest_scale(measured)
        delay = 0.5 * self.period + LOOP_DELAY + self.velocity_delay
        self.is_known = self._count >= (_TURN if scale < _QUIET else _FEW)
        was_noisy, self._is_noisy = self._is_noisy, scale < 1.0 or not self.is_known
        if self._is_noisy and not was_noisy:
            self._measured.restart()
            self._difference.restart()
        if not self.is_known:
            scale = math.inf
        elif self._is_noisy and was_noisy:
            of_difference = largest_scale(self._difference.deviation)
            self.differs = self.differs or LESS * of_difference**2 > scale**2
            if self.differs:
                scale, delay = of_difference, self.period + LOOP_DELAY
        else:
            self.differs = False
        scale = max(min(scale, DELAY_LAG / (CROSSOVER * omega * delay), 1.0), LEAST)
        return scale if self.is_known else UNKNOWN * scale


def longest_period(gains: Gains) -> float:
    """Return the period of the states [s] above which these gains are lowered, 0: any period."""
    omega = _natural_frequency(gains)
    if omega == 0.0:
        return math.inf
    return max(2.0 * (DELAY_LAG / (CROSSOVER * omega) - LOOP_DELAY), 0.0)


def slowest_rate(gains: Gains) -> float:
    """Return the rate of the joint states [Hz] below which these gains are lowered, 0: no rate."""
    period = longest_period(gains)
    return 1.0 / period if period > 0.0 else math.inf


def _natural_frequency(gains: Gains) -> float:
    return max(math.sqrt(float(gains.kp.max(initial=0.0))),
               0.5 * float(gains.kd.max(initial=0.0)))
