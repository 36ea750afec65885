# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Agreement of the measured velocities with the measured positions, joint by joint.

The integral of the velocity over a window must equal the displacement. The integral e = ∫ v dt − q
is updated at each state. It is compared with its value at the beginning of several windows every
CHECK seconds, and as soon as it changes by more than noise and encoder resolution can change it.
The tolerance of a window of length W is the sum of

- FLOOR + SLOW W: resolution of the encoders, backlash, offset of the velocity;
- RATIO times the larger of integral and displacement: gear ratio and scale of the velocity;
- NOISE_FACTOR σ √(Σ dt²): white noise of the velocity with the standard deviation σ, estimated
  from its second differences, and from e at rest if the noise is filtered;
- the delay of a filtered velocity. For a filter with the impulse response h ≥ 0 the integral is
  ∫ h(s) d(s) ds, where d(s) is the displacement in the window earlier by s. It therefore lies
  between the smallest and the largest d(s), 0 ≤ s ≤ 40 ms. Only positions decide this tolerance;
  a velocity with the wrong sign does not increase it, nor does one that has become exactly zero;
- the error of the trapezoidal rule after an impact: the change of the velocity in one period.

While the sample of a joint repeats (`repeated_samples`), its velocity is not judged.
"""

from collections.abc import Sequence
import math

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.monitoring.repeated_samples import (
    FLOOR,
    IsHeld,
    NEVER,
    Reference,
    RepeatedSamples,
    REST,
    SLOW,
)
from robot_dynamics.monitoring.velocity_contradiction import describe, reversal_ratio

PRISMATIC = 1.0 / 3.0
"""[m] of a prismatic joint that correspond to 1 rad."""
RATIO = 0.3
NOISE_FACTOR = 6.0
WINDOWS = np.array([0.0, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32])
"""[s]; 0 means the latest stored state."""
_START_WINDOW, _DROP_WINDOW = 2, 4
"""Indices of windows: before the first and within the second, the joint has moved although its
velocity is exactly zero."""
DELAYS = np.array([0.01, 0.02, 0.04])
"""[s] by which a velocity may be late; 40 ms contain 93 % of a first-order filter of 15 ms."""
STEP, CHECK, PAUSE = 0.005, 0.025, 0.1
"""[s] between stored states, between checks, and after which a gap restarts the integral."""
AGREEMENT = 1.0
"""[s] in motion without a contradiction after which a velocity is trusted again."""
UNKNOWN_NOISE, LARGEST_NOISE = 0.2, 0.5
"""[rad/s] of the velocity: assumed until it is known, and tolerated."""
_SLOW_TIME = 0.05
"""[s] in which a slow joint moves by at most FLOOR."""
_FEW, _KNOWN, _LEARNT, _FORGETTING = 8, 32, 128, 1.0 / 32.0
"""Samples of the noise: until then its assumed value applies, each state is checked, and the
estimate is increased; weight of a sample."""
_FULL_TURN = 2.0 * math.pi
_ROWS = 256
_NS = 1e-9
_STEP_NS, _CHECK_NS, _PAUSE_NS = (round(1e9 * each) for each in (STEP, CHECK, PAUSE))
_LARGEST_ALERT = 0.5
_ZERO = 1e-9
"""[rad] or [m] of an integral of zeros, with rounding."""


class MotionConsistency:
    """
    Judges the velocities of n joints state by state; for one thread.

    `doubtful` (n,) marks the joints whose velocity contradicts their position, until it has agreed
    in motion for AGREEMENT seconds. `is_consistent` is true if no joint is doubtful or frozen.
    `reason` describes the last change of a mark to true.
    """

    def __init__(
        self, joint_names: Sequence[str], joint_kinds: Sequence[str],
        is_held: IsHeld | None = None,
    ) -> None:
        """
        Take the joints and their kinds, as `ArmModel` has them.

        `is_held` is None if the joints have no friction.
        """
        n = len(joint_names)
        self._names = tuple(joint_names)
        self._wraps = np.array([kind == 'continuous' for kind in joint_kinds], dtype=bool)
        self._any_wraps = bool(self._wraps.any())
        self._unit = np.array([PRISMATIC if kind == 'prismatic' else 1.0 for kind in joint_kinds])
        self.doubtful: BoolArray = np.zeros(n, dtype=bool)
        self.is_consistent = True
        self.reason = ''
        self._zero = np.zeros(n)
        self._times, self._squared = np.zeros((2, _ROWS))
        self._positions, self._differences = np.zeros((2, _ROWS, n))
        """Stored states: time [s] since `_base_ns`, sum of the squared periods [s²], q and e."""
        self._squares = 0.0
        self._row = 0
        """Number of stored states."""
        self._base_ns, self._stamp_ns = 0, NEVER
        self._q = self._v = self._v_before = self._integral = self._zero
        self._bits, self._is_measured = b'', False
        self._mark, self._alert = [0.0] * n, 0.0
        """e at the last check, and the distance from it that requires a check."""
        self._store_ns = self._check_ns = self._same_ns = 0
        self._variance, self._density = np.zeros((2, n))
        """Of the noise: variance of each velocity, spectral density of its integral at rest."""
        self._rests = np.zeros(n)
        self._count, self._consecutive = 0, 0
        self._rest: tuple[float, FloatArray, FloatArray] | None = None
        self._agreed = np.zeros(n)
        self._repeats = RepeatedSamples(self._names, self._unit, is_held)
        self._all_repeat = False
        self._store_v = self._zero

    @property
    def frozen(self) -> BoolArray:
        """Whether the sample of each joint repeats although the joint moves, (n,)."""
        return self._repeats.frozen

    @property
    def repeats_since_ns(self) -> IntArray:
        """Stamp (n,) [ns] since which the sample of a joint repeats; negative if it does not."""
        return self._repeats.since_ns

    def restart(self) -> None:
        """
        Treat the next state as a first one.

        Doubts about velocities remain, and a joint remains frozen until its sample changes.
        """
        self._stamp_ns, self._row, self._bits = NEVER, 0, b''
        self._repeats.restart()

    def update(
        self, stamp_ns: int, q: FloatArray, v: FloatArray | None,
        reference: Reference = lambda: None,
    ) -> bool:
        """
        Take a state and return `is_consistent`; `v` is None if no velocity is measured.

        `reference` returns the desired position (n,), None without a reference; it is called only
        while a sample repeats. A gap above PAUSE or a stamp that went back restarts the windows;
        a state with the last stamp is ignored. The arrays must not be changed afterwards.
        """
        bits = q.tobytes()
        if bits == self._bits and (v is None or v is self._v or v.tobytes() == self._v.tobytes()):
            self._same_ns = stamp_ns
            if stamp_ns >= self._store_ns and stamp_ns > self._stamp_ns:
                self._store_ns, self._all_repeat = stamp_ns + _STEP_NS, True
                self._follow_repeats(
                    stamp_ns, np.ones_like(self.doubtful), reference,
                    np.full(len(q), self._stamp_ns))
            return self.is_consistent
        dt_ns = stamp_ns - self._stamp_ns
        if dt_ns == 0:
            return self.is_consistent
        if not 0 < dt_ns <= _PAUSE_NS or (v is None) is self._is_measured:
            remains = self.frozen & (q == self._q) & (dt_ns > 0)
            self._begin(stamp_ns, q, v)
            self._repeats.frozen = remains
            self._set_doubtful(self.doubtful)
            self._bits = bits
            return self.is_consistent
        if v is None:
            e = v = self._zero
        else:
            dt = _NS * dt_ns
            self._squares += dt * dt
            self._integral = integral = self._integral + (0.5 * dt) * (v + self._v)
            e = integral - q
            if (stamp_ns >= self._check_ns
                    or not math.dist(e.tolist(), self._mark) <= self._alert):
                e = self._check(stamp_ns, dt, q, v, e)
        if stamp_ns >= self._store_ns or self._all_repeat:
            self._all_repeat = False
            self._store(stamp_ns, q, v, e, reference)
        self._v_before = self._v
        self._stamp_ns, self._bits, self._q, self._v = stamp_ns, bits, q, v
        return self.is_consistent

    def _begin(self, stamp_ns: int, q: FloatArray, v: FloatArray | None) -> None:
        self.restart()
        self._is_measured = v is not None
        if v is None:
            v = self._zero
        self._base_ns = self._stamp_ns = stamp_ns
        self._q = self._integral = q
        self._v = v
        self._mark = [0.0] * len(q)
        self._consecutive, self._rest = 0, None
        self._check_ns = 0
        self._store(stamp_ns, q, v, self._zero, lambda: None)

    def _store(
        self, stamp_ns: int, q: FloatArray, v: FloatArray, e: FloatArray,
        reference: Reference,
    ) -> None:
        """Store a state, and look for repetitions since the one stored before."""
        row = self._row
        if row > 0:
            same = (q == self._positions[row - 1]) & (v == self._store_v)
            if (self._repeats.is_active or True in same.tolist()) and (
                    self._follow_repeats(stamp_ns, same, reference, self._repeat_start(q, v))):
                row = 0
            else:
                dt = _NS * (stamp_ns - self._base_ns) - float(self._times[row - 1])
                rows = max(1, round(_SLOW_TIME / dt))
                moved = np.abs(q - self._positions[max(row - rows, 0)])
                self._repeats.lively += (moved <= FLOOR * self._unit) & ~same
        if row == _ROWS - 1:
            row = _ROWS // 2
            for values in (self._times, self._squared, self._positions, self._differences):
                values[:row] = values[_ROWS - 1 - row:_ROWS - 1]
        self._times[row], self._squared[row] = _NS * (stamp_ns - self._base_ns), self._squares
        self._positions[row], self._differences[row] = q, e
        self._row, self._store_v, self._store_ns = row + 1, v, stamp_ns + _STEP_NS

    def _check(
        self, stamp_ns: int, dt: float, q: FloatArray, v: FloatArray, e: FloatArray,
    ) -> FloatArray:
        """Judge the velocities in all windows that end at this state; return e."""
        if self._any_wraps:
            turns = np.where(
                self._wraps, _FULL_TURN * np.rint((q - self._q) / _FULL_TURN), 0.0)
            if turns.any():
                self._integral = self._integral + turns
                self._positions[:self._row] += turns
                e = self._integral - q
        if self._same_ns > self._stamp_ns and not self._v.any():
            # At rest, the motion began at an unknown time since then.
            most, least = 0.5 * dt * v, 0.5 * _NS * (stamp_ns - self._same_ns) * v
            change = np.clip(q - self._q, np.minimum(least, most), np.maximum(least, most)) - most
            self._integral, e = self._integral + change, e + change
        t, row = _NS * (stamp_ns - self._base_ns), self._row
        if not np.isfinite(e).all():  # velocities beyond the range of the numbers
            self.reason = 'the integral of the velocities is not finite'
            self._set_doubtful(self.doubtful | ~np.isfinite(e))
            self._integral, self._row = q, 0
            return self._zero
        self._times[row], self._positions[row], self._differences[row] = t, q, e
        self._consecutive += 1
        first = np.maximum(
            np.searchsorted(self._times[:row], t - WINDOWS, side='right') - 1, 0)
        length = (t - self._times[first])[:, None]
        difference, moved = e - self._differences[first], q - self._positions[first]
        integral = difference + moved
        variance = np.maximum(self._variance, self._density / dt)
        if self._count < _LEARNT:  # an estimate of a few samples may be far too small
            variance = (1.0 + _KNOWN / max(self._count, 1)) * variance
            if self._count < _FEW:
                variance = np.maximum(variance, (UNKNOWN_NOISE * self._unit)**2)
        variance = np.minimum(variance, (LARGEST_NOISE * self._unit)**2)
        squares = (self._squares - self._squared[first])[:, None]
        noise = np.where(  # zeros have no noise
            np.abs(integral) > _ZERO, NOISE_FACTOR * np.sqrt(variance * squares), 0.0)
        floor = (FLOOR + SLOW * length) * self._unit + noise
        tolerance = floor + RATIO * np.where(  # no error of the scale reverses the sign
            integral * moved < 0.0, 0.0, np.maximum(np.abs(moved), np.abs(integral)))
        agrees = np.abs(difference) <= tolerance
        if not agrees.all():
            sampling = self._sampling_error(first, dt, v)
            # A delayed velocity is not exactly zero while the joint moves on, nor a scaled one,
            # nor is it so for long after the joint has begun to move.
            begun = moved[_DROP_WINDOW] - moved[_START_WINDOW]
            has_dropped = (v == 0.0) & (np.maximum(
                np.abs(integral[_DROP_WINDOW]), np.abs(begun)) > FLOOR * self._unit)
            difference = np.where(
                has_dropped, difference, self._excess(first, integral, moved))
            tolerance = sampling + np.where(
                has_dropped, floor + RATIO * np.abs(integral), tolerance)
            agrees = (np.abs(difference) <= tolerance) | (
                (q == self._q) & (v == self._v))
            if not agrees.all():
                self._find(
                    ~agrees, first, length, integral, moved, difference, tolerance, v)
        if stamp_ns >= self._check_ns:
            self._estimate_noise(t, dt, q, v, e)
            self._check_ns = stamp_ns + (_CHECK_NS if self._count >= _KNOWN else 0)
            is_judged = ((1.0 - RATIO) * np.abs(moved) > floor).any(axis=0)
            self._agreed = np.where(
                agrees.all(axis=0), self._agreed + np.where(is_judged, max(CHECK, dt), 0.0), 0.0)
            self._set_doubtful(self.doubtful & (self._agreed < AGREEMENT))
        self._mark = e.tolist()
        self._alert = min(0.5 * FLOOR * float(self._unit.min()) + 2.0 * math.sqrt(
            0.01 * dt * float(variance.sum())), _LARGEST_ALERT)
        return e

    def _estimate_noise(
        self, t: float, dt: float, q: FloatArray, v: FloatArray, e: FloatArray,
    ) -> None:
        """Update the noise from the second difference of v, and from e while a joint rests."""
        if self._consecutive > 1:
            self._count += 1
            known = SLOW + FLOOR / dt  # a wrong velocity must not hide in the noise that it causes
            d = np.minimum(np.abs(v - 2.0 * self._v + self._v_before), np.minimum(
                3.0 * LARGEST_NOISE * self._unit,
                known * self._unit + 3.0 * np.sqrt(6.0 * self._variance)))
            weight = max(_FORGETTING, 1.0 / self._count)
            self._variance = self._variance + weight * (d * d / 6.0 - self._variance)
        if self._rest is not None:
            t_rest, q_rest, e_rest = self._rest
            rests = np.abs(q - q_rest) <= REST * self._unit
            self._rests = self._rests + rests
            weights = np.where(
                rests, np.maximum(_FORGETTING, 1.0 / np.maximum(self._rests, 1.0)), 0.0)
            self._density = self._density + weights * (
                (e - e_rest)**2 / (t - t_rest) - self._density)
        self._rest = t, q, e
        self._repeats.forget()

    def _sampling_error(self, first: IntArray, dt: float, v: FloatArray) -> FloatArray:
        """Return the error of integral and displacement due to the sampling, (windows, n)."""
        start = max(int(first.min()) - 1, 0)
        times, positions = self._times[start:self._row + 1], self._positions[start:self._row + 1]
        intervals = np.diff(times)[:, None]
        velocity = np.diff(positions, axis=0) / intervals
        speed = np.maximum.accumulate(np.abs(velocity)[::-1])[::-1]
        change = np.zeros_like(positions)
        change[1:-1] = np.maximum(dt, np.maximum(
            intervals[1:], intervals[:-1]) - 2.0 * STEP) * np.abs(np.diff(velocity, axis=0))
        change = np.maximum.accumulate(change[::-1])[::-1]
        at = first - start
        step = np.minimum(np.abs(v - self._v), 2.0 * speed[at] + LARGEST_NOISE * self._unit)
        return np.asarray(change[at] + self._repeats.duration * speed[at] + 0.5 * dt * step)

    def _excess(self, first: IntArray, integral: FloatArray, moved: FloatArray) -> FloatArray:
        """Return the distance of the integral from all delayed displacements, (windows, n)."""
        times, positions = self._times[:self._row + 1], self._positions
        ends = times[np.append(first, self._row)]
        at = np.maximum(ends[:, None] - DELAYS, times[0])
        after = np.clip(np.searchsorted(times, at, side='right'), 1, self._row)
        share = (at - times[after - 1]) / (times[after] - times[after - 1])
        before = positions[after - 1]
        past = before + share[..., None] * (positions[after] - before)
        delayed = past[-1] - past[:-1]
        low = np.minimum(moved, delayed.min(axis=1))
        high = np.maximum(moved, delayed.max(axis=1))
        return np.asarray(integral - np.minimum(np.maximum(integral, low), high))

    def _find(
        self, contradicts: BoolArray, first: IntArray, length: FloatArray,
        integral: FloatArray, moved: FloatArray, difference: FloatArray,
        tolerance: FloatArray, v: FloatArray,
    ) -> None:
        """Mark the joints of which a window, (windows, n), contradicts the displacement."""
        found = contradicts.any(axis=0)
        for j in np.flatnonzero(found & ~self.doubtful & ~self.frozen):
            row = int(np.argmax(np.abs(difference[:, j]) / tolerance[:, j]))
            positions = self._positions[first[row]:self._row + 1, j]
            self.reason = describe(
                self._names[j], float(length[row, 0]), float(integral[row, j]),
                float(moved[row, j]), float(v[j]), reversal_ratio(
                    positions, self._differences[first[row]:self._row + 1, j]))
        self._set_doubtful(self.doubtful | found & ~self.frozen)

    def _follow_repeats(
        self, stamp_ns: int, same: BoolArray, reference: Reference, start_ns: IntArray,
    ) -> bool:
        """Follow repeated samples; return whether a frozen joint is updated again."""
        reason = self._repeats.follow(
            stamp_ns, same, start_ns, self._q, self._v, reference, self._smallest_step)
        self.reason = reason or self.reason
        self._set_doubtful(self.doubtful)
        return self._repeats.has_ended

    def _smallest_step(self) -> FloatArray:
        """Return the smallest displacement (n,) other than 0 between two stored states."""
        steps = np.abs(np.diff(self._positions[:self._row], axis=0))
        return np.asarray(np.where(steps > 0.0, steps, np.inf).min(axis=0, initial=np.inf))

    def _repeat_start(self, q: FloatArray, v: FloatArray) -> IntArray:
        """Return the beginning (n,) [ns] of a repetition that is found now, from the motion."""
        row = self._row
        if row < 2:
            return np.full(len(q), self._stamp_ns)
        before, last = self._times[row - 2:row].tolist()
        with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
            t = before + (q - self._positions[row - 2]) / v
        t = np.where(np.isfinite(t), np.clip(t, before, last), last)
        return np.asarray(self._base_ns + np.rint(t / _NS), dtype=np.int64)

    def _set_doubtful(self, doubtful: BoolArray) -> None:
        self._agreed = np.where(doubtful, self._agreed, 0.0)
        self.doubtful = doubtful
        self.is_consistent = not (doubtful.any() or self.frozen.any())
