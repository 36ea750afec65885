# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The fraction of the bandwidth of the feedback at which it is stable.

A law states its closed loop ë + D ė + K e = 0 as matrices of acceleration per error, M⁻¹ K and
M⁻¹ D (`ControlLaw.closed_loop`). Joint j crosses over at ω_x with ω_x⁴ = K_jj² + D_jj² ω_x², with
the phase margin φ = atan(D_jj ω_x / K_jj): 2.06 ω and 76° for a damping ratio of 1. The coupling
of the joints raises their frequencies by at most the largest eigenvalue ρ of K whose diagonal is
normalised to 1. Two delays reduce the margin:

- sampling and transport: half a period of the states, LOOP_DELAY, and the delay of the velocity
  (`gate`);
- the rate limit of the effort. Noise σ of the velocity is amplified to M D σ. If this noise
  exceeds the changes that the limit τ̇ permits, the limit acts as a low-pass with the time
  constant M D σ / (0.8 τ̇): the expected change of a slew-limited value whose input has normal
  noise.

The bandwidth of joint j is scaled by s_j, with K s² and D s, so that each phase lag at s ω_x ρ
stays below its bound, which is proportional to φ. If s is below 1, M, C and g are those of the
position q + q̇ (T + LOOP_DELAY)/2 when the effort acts on average.
"""

from collections.abc import Callable, Sequence
import math
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray

LOOP_DELAY = 0.008
"""[s] allowed for transport and computation, in addition to half a period."""
DELAY_LAG = 0.5
"""[rad] of phase that sampling and transport may take at the crossover at a damping ratio of 1."""
NOISE_LAG = 0.1
"""[rad] of phase that the rate limit may take at the crossover."""
CROSSOVER = math.sqrt(2.0 + math.sqrt(5.0))
"""ω_x / ω at a damping ratio of 1."""
USUAL_MARGIN = math.atan(2.0 * CROSSOVER)
"""Phase margin [rad] at a damping ratio of 1."""
USUAL_FREQUENCY = 20.0
"""[rad/s]: references are slowed down for a loop that is scaled to less than this."""
_SLEW = math.sqrt(2.0 / math.pi)
LEAST = 0.05
"""Smallest fraction s for noise; with noise that requires less, the loop is no longer stable."""
UNKNOWN = 0.5
"""Factor of s that is used until the quality of the states is known."""
FIRST_PERIOD = 0.035
"""Period of the states [s] that is assumed until two states are known."""
_FORGETTING, _SPARSE_FORGETTING = 0.02, 0.1
"""Weights of a new state in the estimates: if every state is used, and if only few are."""
_TURN, _FEW = 16, 6
"""States between two estimates, and before the first evaluation; fewer suffice without noise."""
_SPARSE = 3
"""Consecutive states of each turn that are used while the noise does not matter."""
_QUIET_TURN = 64
"""States between two evaluations while the noise does not matter."""
GAP, GAPS, PAUSE = 1.7, 3, 0.5
"""An interval that is GAP times the period is the period only after GAPS of them in a row, and
never above PAUSE [s]."""
_QUIET = 3.0
"""The fraction s that the noise permits if the noise is negligible."""
_STEP = 1.1
"""Ratio of two periods, or of two scales, below which the scale stays unchanged."""


class LoopGains(NamedTuple):
    """
    The closed loop of a law in the workspace: the least favourable of all sampled poses.

    `crossover` ω_x and `frequency` ω (n,) [rad/s]; `lag` (n,) [rad] is the allowed phase lag;
    `noise` (n, n) [N·m·s/rad] or [N·s/m] is |M D|, the effort per error of the velocity.
    """

    crossover: FloatArray
    frequency: FloatArray
    lag: FloatArray
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
        margin = np.arctan2(d * crossover, k)
        rho = max(_coupling(K), _coupling(D))
        found.append(LoopGains(
            rho * crossover, np.maximum(np.sqrt(k), 0.5 * d),
            DELAY_LAG * np.minimum(1.0, margin / USUAL_MARGIN), np.abs(M @ D)))
    crossover, frequency, lag, noise = (np.array(values) for values in zip(*found))
    worst = np.argmax(crossover / np.maximum(lag, 1e-9), axis=0)[np.newaxis]
    crossover, frequency, lag = (
        np.take_along_axis(values, worst, axis=0)[0] for values in (crossover, frequency, lag))
    return LoopGains(crossover, frequency, lag, noise.max(axis=0))


def _coupling(gains: FloatArray) -> float:
    """Return the largest eigenvalue of gains (n, n) whose diagonal is normalised to 1."""
    own = np.diagonal(gains)
    if not (gains - np.diag(own)).any():
        return 1.0
    scale = np.sqrt(np.where(own > 0.0, own, 1.0))
    return max(1.0, float(np.abs(np.linalg.eigvals(gains / np.outer(scale, scale))).max()))


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
        little of its motion.
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
        """The standard deviation (n,)."""
        return np.asarray(np.sqrt(self._variance))


class StableGains:
    """The scale of the gains that rate and noise of the states allow."""

    def __init__(self, n: int) -> None:
        """Scale the gains of n joints."""
        self.scale: FloatArray = np.ones(n)
        """Factors of the bandwidth of the joints, (n,) in (0, 1]."""
        self.least = 1.0
        """The smallest of these factors."""
        self.reference_scale = 1.0
        """Factor by which references are slowed down, in (0, 1]."""
        self.period = 0.0
        """[s] between the states: a single long interval is a gap, not their rate."""
        self.is_known = False
        """Whether enough states have been received; fewer suffice without noise."""
        self._taken: tuple[float, FloatArray] | None = None
        """Period and velocity of the last state, until `evaluate`."""
        self._velocity_delay = 0.0
        self._gains: LoopGains | None = None
        self._effort_rate: FloatArray = np.full(n, math.inf)
        self._noise = Noise(n)
        self._count = self._long = 0
        self._is_noisy = True
        self._free_period, self._rated_period = math.inf, 0.0

    def set_loop_gains(self, gains: LoopGains | None, effort_rate: FloatArray) -> None:
        """
        Scale a loop with these gains from now on, None for no scaling; sets `scale`.

        `effort_rate` (n,) [N·m/s] or [N/s] is the rate limit of the effort.
        """
        self._gains, self._effort_rate = gains, effort_rate
        self._free_period = math.inf if gains is None else longest_period(gains)
        self._set_scale(is_forced=True)

    def take(self, dt: float, v: FloatArray, velocity_delay: float = 0.0) -> None:
        """
        Take the velocity (n,) of a state dt [s] after the last one, 0 if that is unknown.

        `velocity_delay` [s] is the delay of v.
        """
        if self._gains is None or dt <= 0.0:
            self._taken = None
            return
        self._long = self._long + 1 if dt > GAP * self.period > 0.0 else 0
        if 0 < self._long < GAPS or dt >= PAUSE:
            self._taken = None
            self._noise.restart()
            return
        self._velocity_delay = velocity_delay
        self._taken = dt, v

    def evaluate(self, bounces: bool = False) -> bool:
        """
        Take the noise of the last state; return whether a scale has changed.

        If the arm bounces off a surface, the changes of its velocity are no noise.
        """
        if self._taken is None:
            return False
        (dt, v), self._taken = self._taken, None
        self._count += 1
        rest = self.period - dt
        self.period = period = dt if rest < 0.0 else dt + (1.0 - _FORGETTING) * rest
        phase = self._count % _TURN
        if bounces:
            self._noise.restart()
            return False
        if self._is_noisy:
            self._noise.take(v, _FORGETTING)
            is_due = phase == 2 or not self.is_known
        else:
            is_due = self._count % _QUIET_TURN == 2
            if phase < _SPARSE:  # three consecutive states are enough for one estimate
                if phase == 0:
                    self._noise.restart()
                self._noise.take(v, _SPARSE_FORGETTING)
        if not (is_due or period > self._free_period and period > _STEP * self._rated_period):
            return False
        self._rated_period = period
        return self._set_scale()

    @property
    def noise(self) -> FloatArray:
        """The standard deviation of the velocity (n,)."""
        return self._noise.deviation

    def __str__(self) -> str:
        noise = float(self.noise.max(initial=0.0))
        return (f'joint states at {1.0 / max(self.period, 1e-9):.0f} Hz, velocity noise of up to '
                f'{round(noise, 6):.2g} per second')

    @property
    def lag(self) -> float:
        """
        The mean time [s] from a state to the middle of the period in which its effort acts.

        It is 0 for fast states, whose gains are not lowered: the arm hardly moves in that time.
        """
        return 0.5 * (self.period + LOOP_DELAY) if self.least < 1.0 else 0.0

    def _set_scale(self, is_forced: bool = False) -> bool:
        """Evaluate the scales; return whether they have changed."""
        was_known, gains = self.is_known, self._gains
        if gains is None:
            self.scale, self.least, self.reference_scale = np.ones_like(self.scale), 1.0, 1.0
            return False
        full = self._scaled(gains, self.period or FIRST_PERIOD, self._scale_of_noise(gains))
        scale = full if self.is_known else UNKNOWN * full
        least = float(scale.min(initial=1.0))
        usual = np.minimum(gains.frequency, USUAL_FREQUENCY)
        with np.errstate(divide='ignore', invalid='ignore'):
            share = np.where(usual > 0.0, full * gains.frequency / usual, 1.0)
        reference_scale = min(1.0, float(share.min(initial=1.0)))
        is_forced = is_forced or self.is_known != was_known
        if not is_forced and _is_same(least, self.least) and _is_same(
                reference_scale, self.reference_scale):
            return False
        self.scale, self.least, self.reference_scale = scale, least, reference_scale
        return True

    def _scaled(self, gains: LoopGains, period: float, of_noise: float) -> FloatArray:
        """Return the factors s (n,) at a period of the states [s]."""
        delay = LOOP_DELAY + 0.5 * period + self._velocity_delay
        with np.errstate(divide='ignore', invalid='ignore'):
            of_delay = np.where(gains.crossover > 0.0, gains.lag / (gains.crossover * delay), 1.0)
        return np.asarray(np.minimum(np.minimum(of_delay, of_noise), 1.0))

    def _scale_of_noise(self, gains: LoopGains) -> float:
        """Return the factor s that the noise permits."""
        effort = np.sqrt((gains.noise * self._noise.deviation) ** 2 @ np.ones_like(self.scale))
        lag = float(gains.crossover.max(initial=0.0)) * float(
            np.max(effort / (_SLEW * self._effort_rate), initial=0.0))
        scale = math.sqrt(NOISE_LAG / lag) if lag > 0.0 else math.inf
        self.is_known = self._count >= (_TURN if scale < _QUIET else _FEW)
        was_noisy, self._is_noisy = self._is_noisy, scale < 1.0 or not self.is_known
        if self._is_noisy and not was_noisy:
            self._noise.restart()
        return max(scale, LEAST) if self.is_known else 1.0


def _is_same(scale: float, other: float) -> bool:
    """Return whether two scales are about equal; 1 equals itself only."""
    return scale == other or max(scale, other) < 1.0 and 1.0 / _STEP < scale / other < _STEP


def longest_period(gains: LoopGains) -> float:
    """Return the period of the states [s] above which these gains are lowered, 0: any period."""
    with np.errstate(divide='ignore', invalid='ignore'):
        delay = np.where(gains.crossover > 0.0, gains.lag / gains.crossover, math.inf)
    return max(2.0 * (float(delay.min(initial=math.inf)) - LOOP_DELAY), 0.0)
