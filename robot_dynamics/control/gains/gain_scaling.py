# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The fraction of the bandwidth of the feedback at which it is stable.

A law states its closed loop ë + D ė + K e = 0 as matrices of acceleration per error, M⁻¹ K and
M⁻¹ D (`ControlLaw.closed_loop`). Joint j crosses over at ω_x with ω_x⁴ = K_jj² + D_jj² ω_x², with
the phase margin φ = atan(D_jj ω_x / K_jj): 2.06 ω and 76° for a damping ratio of 1. The coupling
of the joints raises their frequencies by at most the largest eigenvalue ρ of K whose diagonal is
normalised to 1.

The bandwidth is scaled by the largest s <= 1, with K s² and D s, at which

    s ρ ω_x T_d <= DELAY_LAG min(1, φ / 76°)    and    s ρ ω_x s T_n <= NOISE_LAG.

T_d is half a period of the states, LOOP_DELAY, and the delay of the velocity (`gate`). T_n is that
of the rate limit τ̇ of the effort: noise σ of the velocity becomes M D s σ in the effort. If it
exceeds the changes that the limit permits, the limit acts as a low-pass with the time constant
s T_n = M D s σ / (0.8 τ̇): 0.8 is the expected change of a slew-limited value with normal noise.
A measured velocity has more noise than the difference quotient of the positions, or less delay.
The quotient is used (`choice`) if it has the larger s after the first BLOCK / 4 states, and as
long as it has. The measured one is not left later, because an oscillation looks like noise.

With a damping ratio of 1, without noise: s = 0.5 rad / (2.06 ω T_d), for 20 rad/s and states at
125 Hz 0.5 / (41.2 · 12 ms) = 1.0, at 30 Hz 0.49. If s is below 1, M, C and g are those of the
position q + q̇ (T + LOOP_DELAY)/2 when the effort acts on average.
"""

from collections import deque
from collections.abc import Callable, Sequence
import math
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray

LOOP_DELAY = 0.008
"""[s] allowed for transport and computation, in addition to half a period."""
DELAY_LAG = 0.5
"""[rad] of phase that delays may take at the crossover at a damping ratio of 1."""
NOISE_LAG = 0.1
"""[rad] of phase that the rate limit may take at the crossover."""
CROSSOVER = math.sqrt(2.0 + math.sqrt(5.0))
"""ω_x / ω at a damping ratio of 1."""
USUAL_MARGIN = math.atan(2.0 * CROSSOVER)
"""Phase margin [rad] at a damping ratio of 1."""
USUAL_FREQUENCY = 20.0
"""[rad/s]: references are slowed down for a loop that is scaled to less than this."""
FIRST_PERIOD = 4.0 * LOOP_DELAY
"""Period of the states [s] that is assumed until two intervals are known."""
BLOCK = 32
"""States of which one estimate of the noise is made; the period decreases as slowly."""
_SLEW = math.sqrt(2.0 / math.pi)


Candidates = Sequence[tuple[FloatArray, float]]
"""Velocities (n,) that may be used, the usual one first, and their delays [s]."""


class LoopGains(NamedTuple):
    """
    The closed loop of a law in the workspace: the least favourable of all sampled poses.

    `delay` (n,) [s] is that up to which s is 1, ∞ without feedback; `crossover` [rad/s] is the
    largest ρ ω_x, and `frequency` (n,) is ω [rad/s]; `noise` (n, n) [N·m·s/rad] or [N·s/m] is
    |M D|, the effort per error of the velocity.
    """

    delay: FloatArray
    crossover: float
    frequency: FloatArray
    noise: FloatArray


def loop_gains(
    closed_loop: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    mass_matrices: Sequence[FloatArray] | FloatArray,
) -> LoopGains:
    """Return the gains of a law, given by `ControlLaw.closed_loop`, at these M(q), (n, n) each."""
    found = []
    for M in mass_matrices:
        K, D = closed_loop(M)
        k, d = np.diagonal(K), np.diagonal(D)
        crossover = np.sqrt(0.5 * (d * d + np.sqrt(d**4 + 4.0 * k * k)))
        lag = DELAY_LAG * np.minimum(1.0, np.arctan2(d * crossover, k) / USUAL_MARGIN)
        crossover = max(_coupling(K), _coupling(D)) * crossover
        with np.errstate(divide='ignore', invalid='ignore'):
            delay = np.where(crossover > 0.0, lag / crossover, np.inf)
        found.append((delay, crossover, np.maximum(np.sqrt(k), 0.5 * d), np.abs(M @ D)))
    delays, crossovers, frequencies, noises = zip(*found)
    return LoopGains(
        np.min(delays, axis=0), float(np.max(crossovers, initial=0.0)),
        np.max(frequencies, axis=0), np.max(noises, axis=0))


def _coupling(gains: FloatArray) -> float:
    """Return the largest eigenvalue of gains (n, n) whose diagonal is normalised to 1."""
    own = np.diagonal(gains)
    if not (gains - np.diag(own)).any():
        return 1.0
    scale = np.sqrt(np.where(own > 0.0, own, 1.0))
    return max(1.0, float(np.abs(np.linalg.eigvals(gains / np.outer(scale, scale))).max()))


class StableGains:
    """The scale of the gains that rate and noise of the states allow."""

    def __init__(self, n: int) -> None:
        """Scale the gains of n joints."""
        self.scale: FloatArray = np.ones(n)
        """Factors of the bandwidth of the joints, (n,) in (0, 1]."""
        self.least = 1.0
        """The smallest of these factors."""
        self.lag = 0.0
        """
        The mean time [s] from a state to the middle of the period in which its effort acts.

        It is 0 for fast states, whose gains are not lowered: the arm hardly moves in that time.
        """
        self.reference_scale = 1.0
        """Factor by which references are slowed down, in (0, 1]."""
        self.period = 0.0
        """[s] between the states, the shorter of two intervals: a single long one is a gap."""
        self.noise: FloatArray = np.zeros(n)
        """The standard deviation of the velocity in use (n,)."""
        self.choice = 0
        """The index of the candidate to use."""
        self.is_known = False
        """Whether the noise is known."""
        self._rated_period = 0.0
        self._delays: list[float] = [0.0]
        self._noises: FloatArray = np.zeros((1, n))
        """Delay [s], and standard deviation (n,) of each candidate."""
        self._gains: LoopGains
        self._effort_rate: FloatArray = np.full(n, math.inf)
        self._interval = math.inf
        self._block: deque[list[FloatArray]] = deque(maxlen=BLOCK)
        """Candidates (n,) of each state, NaN after a gap."""

    def set_loop_gains(self, gains: LoopGains, effort_rate: FloatArray) -> None:
        """
        Scale a loop with these gains from now on; sets `scale`.

        `effort_rate` (n,) [N·m/s] or [N/s] is the rate limit of the effort.
        """
        self._gains, self._effort_rate = gains, effort_rate
        self._set_scale()

    def take(self, dt: float, candidates: Candidates) -> bool:
        """
        Take the velocities of a state; return whether a scale has changed.

        The state is dt [s] after the last one, 0 if that is unknown.
        """
        block, last, period = self._block, self._interval, self.period
        self._delays = [delay for _, delay in candidates]
        if dt > 0.0:
            shorter, self._interval = min(dt, last), dt
            if last < math.inf:
                self.period = max(shorter, period - (period - shorter) / BLOCK)
        is_next = 0.0 < dt < 2.0 * self.period
        block.append([v if is_next else v * math.nan for v, _ in candidates])
        if len(block) == (BLOCK if self.is_known else BLOCK // 4):
            self._take_noise()
        elif period > 0.0 and self.period <= self._rated_period:
            return False
        return self._set_scale()

    def _take_noise(self) -> None:
        """Average the variance with that of a block of states; choose a candidate."""
        # The second difference of white noise has 6 times its variance, and little of a motion.
        second = np.diff(np.array(self._block), 2, axis=0)
        second = second[np.isfinite(second).all(axis=(1, 2))]
        if len(second):
            variance = (second * second).mean(axis=0) / 6.0
            before = self._noises**2 if self.is_known else variance
            self._noises = np.sqrt(0.5 * (before + variance))
            if self.choice or not self.is_known:
                least = [self._scale_with(k).min(initial=1.0) for k in range(len(variance))]
                self.choice, self.is_known = least.index(max(least)), True
        self._block.clear()

    def __str__(self) -> str:
        noise = float(self.noise.max(initial=0.0))
        return (f'joint states at {1.0 / max(self.period, 1e-9):.0f} Hz, velocity noise of up to '
                f'{round(noise, 6):.2g} per second')

    def _set_scale(self) -> bool:
        """Evaluate the scales; return whether they have changed."""
        before, self._rated_period = self.scale, self.period or FIRST_PERIOD
        self.scale, self.noise = self._scale_with(self.choice), self._noises[self.choice]
        self.least = float(self.scale.min(initial=1.0))
        self.lag = 0.5 * (self.period + LOOP_DELAY) if self.least < 1.0 else 0.0
        bandwidth = self.scale * np.maximum(self._gains.frequency / USUAL_FREQUENCY, 1.0)
        self.reference_scale = float(bandwidth.min(initial=1.0))
        return bool((self.scale != before).any())

    def _scale_with(self, choice: int) -> FloatArray:
        """Return the scales (n,) with a candidate."""
        gains, noise = self._gains, self._noises[choice]
        delay = LOOP_DELAY + 0.5 * self._rated_period + self._delays[choice]
        effort = np.sqrt((gains.noise * noise)**2 @ np.ones_like(noise))
        phase = gains.crossover * float(np.max(effort / (_SLEW * self._effort_rate), initial=0.0))
        of_noise = math.sqrt(NOISE_LAG / phase) if phase > NOISE_LAG else 1.0
        return np.minimum(gains.delay / delay, of_noise)
