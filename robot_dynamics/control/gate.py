# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
What is known of each joint now: the only place that judges the measured values of a state.

The velocity of a joint is the measured one as long as it agrees with the positions, else the
difference quotient d of the positions over SPAN, or over one period of the states if that is
longer: v = (q_k − q_j) / (t_k − t_j) with t_k − t_j ≥ SPAN. It is late by half of this span
(P. R. Bélanger, "Estimation of angular velocity and acceleration from shaft encoder measurements",
IEEE Int. Conf. Robotics and Automation, 1992). No velocity can therefore drive an arm away, and a
wrong judgement costs only bandwidth:

- A sample further than FAR velocity limits from d, or exactly 0 in motion, is missing: the last
  velocity is used and nothing is learned, for MISSED samples in a row.
- The displacement lies between the integrals of the last velocity and of the present one. What is
  outside adds up, and is forgotten with the time constant MEMORY. If it is more than FLOOR + RATIO
  times the displacement (resolution of encoders, scale of the velocity), the velocity is not used
  until it has agreed in motion for AGREEMENT.

A joint does not stop from one sample to the next. If its position repeats bit by bit although
velocity and last step were above MOVING, its sample is missing: its position is continued with its
last velocity until it changes. After LOST seconds the joint has no signal: the fault brakes it,
and its velocity is assumed to decay with DECAY. A slower joint may stand; it has no signal if its
reference moves on by LEFT where friction cannot hold it, while others move. If the whole state
repeats in motion, there is no new state; at rest its brakes may hold the arm.
"""

from collections import deque
from collections.abc import Callable
from math import exp, pi
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import (
    BoolArray,
    FloatArray,
    NANOSECONDS_PER_SECOND,
    wrap_angle,
    wrap_to_pi,
)

SPAN, LEAST_SPAN = 0.008, 0.002
"""[s]; stamps of a shorter span, after a first state, are too inexact."""
FAR, LARGEST_SPEED, MISSED = 0.5, 20.0, 2
"""Share of the velocity limit, which is at most LARGEST_SPEED [rad/s] or [m/s], and samples."""
FLOOR, RATIO = 0.003, 0.3
"""[rad] or [m], and share of the displacement, that integral and displacement may differ."""
JUMP = 0.05
"""[rad] or [m] that a position may jump, for at most MISSED samples."""
MEMORY, AGREEMENT = 0.1, 1.0
"""[s]"""
MOVING, BRAKING = 0.1, 15.0
"""[rad/s] or [m/s] from which a joint does not stop in one sample, and [rad/s²] or [m/s²] with
which dry friction brakes a joint: slower states need a faster joint."""
LEFT = 0.03
"""[rad] or [m] that the reference of a joint that stands may move."""
LOST, DECAY = 0.05, 20.0
"""[s] for which a joint without a new sample is assumed to move on, and [1/s] with which it then
stops: the damping of a fault with the default gains."""
_SPAN_NS = round(SPAN * NANOSECONDS_PER_SECOND)
_CHECK_NS = 10_000_000
"""[ns] between two looks at the reference."""
_LOST_NS = round(LOST * NANOSECONDS_PER_SECOND)
_PAUSE_NS = NANOSECONDS_PER_SECOND // 2
"""[ns] between two states after which the difference of their positions gives no velocity."""
_MOST = 100
"""Number of stored states within a span."""


class Signals(NamedTuple):
    """
    Position and velocity (n,) in use, and the delay [s] of the velocity.

    `lost` (n,) marks joints without a signal, None for none. The velocity of a first state is 0.
    """

    q: FloatArray
    v: FloatArray
    delay: float = 0.0
    lost: BoolArray | None = None


class Gate:
    """Follows the positions of n joints, state by state; for one thread."""

    def __init__(
        self, wraps: BoolArray, velocity_limit: FloatArray,
        reference: Callable[[], FloatArray | None],
        is_held: Callable[[FloatArray, FloatArray], BoolArray],
    ) -> None:
        """
        Take the velocity limits (n,), infinite for none.

        `wraps` (n,) marks the continuous joints: their positions may jump by a turn. `reference`
        returns the position of the reference (n,), or None. `is_held` returns at which joints (n,)
        friction can hold an arm at q (n,) with a position error (n,).
        """
        self._reference, self._is_held = reference, is_held
        self._left: FloatArray | None = None
        """The reference (n,) when the position of each joint began to repeat."""
        n = len(wraps)
        self._wraps, self._any_wraps = wraps, bool(wraps.any())
        self._far: list[float] = (FAR * np.minimum(velocity_limit, LARGEST_SPEED)).tolist()
        self._agreed = [AGREEMENT] * n
        """[s] in motion for which the velocity of each joint has agreed with its positions."""
        self._integral, self._moved = [0.0] * n, [0.0] * n
        self._before: list[float] | None = None
        """Velocities of the last state."""
        self._missed, self._way = [0] * n, [0.0] * n
        """Samples in a row of each velocity that are missing, and the way in this time."""
        self.has_jumped = False
        """Whether a position jumped away between velocities that agree; the reader resets it."""
        self._states: deque[tuple[int, FloatArray]] = deque(maxlen=_MOST)
        """Stamps [ns] and the positions in use."""
        self._measured: FloatArray = np.full(n, np.nan)
        self._v: FloatArray = np.zeros(n)
        self._missing: BoolArray = np.zeros(n, dtype=bool)
        self._since_ns = np.zeros(n, dtype=np.int64)
        """Stamp (n,) of the last sample of each joint that is missing."""
        self._is_missing = self._is_silent = self._is_fast = False
        self._checked, self._check_ns = self._measured, 0
        """The positions (n,) at the last look at the reference, and the time of the next one."""

    def restart(self) -> None:
        """Treat the next state as a first one."""
        self._states.clear()
        self._integral, self._moved = [0.0] * len(self._far), [0.0] * len(self._far)
        self._missing = np.zeros_like(self._missing)
        self._is_missing = self._is_silent = False
        self._left = self._before = None
        self._check_ns = 0

    @property
    def doubtful(self) -> BoolArray:
        """Whether the measured velocity of each joint is not used, because it is wrong, (n,)."""
        return np.array(self._agreed) < AGREEMENT

    def take(self, stamp_ns: int, q: FloatArray, v: FloatArray | None) -> Signals | None:
        """
        Return the signals at a state (q, v), each (n,), None if the positions repeat as a whole.

        `v` is None if it is not measured.
        """
        states = self._states
        if self._is_silent:
            if (q == self._measured).all():
                return None
            self.restart()
        if states and not 0 <= stamp_ns - states[-1][0] <= _PAUSE_NS:
            self.restart()
        measured, self._measured = self._measured, q
        if not states:
            states.append((stamp_ns, q))
            self._v = np.zeros_like(q)
            return Signals(q, self._v)
        last_ns, last = states[-1]
        if stamp_ns == last_ns:
            return Signals(last, self._v)
        if self._is_fast or self._is_missing or stamp_ns >= self._check_ns:
            same = q == measured
            left = self._left_behind(stamp_ns, q) & same & (not same.all())
            suspects = ~self._missing & (self._moved_fast() & same | left)
            self._is_silent = bool(suspects.any() and same.all())
            if self._is_silent:
                return None
            q = self._continued(stamp_ns, q, same, suspects, left)
        states.append((stamp_ns, q))
        while len(states) > 2 and stamp_ns - states[1][0] >= _SPAN_NS:
            states.popleft()
        begin_ns, begin = states[0]
        moved = q - begin
        if self._any_wraps:
            moved = np.where(self._wraps, wrap_to_pi(moved), moved)
        span = (stamp_ns - begin_ns) / NANOSECONDS_PER_SECOND
        d, lost, delay = self._v, None, 0.5 * span
        if span >= LEAST_SPAN:
            d = moved / span
        if self._is_missing:
            lost = self._missing & (stamp_ns - self._since_ns > _LOST_NS)
            d = np.where(self._missing, self._v, d)
            if not lost.any():
                lost = None
        if v is not None:
            d, is_late = self._agreeing(1e-9 * (stamp_ns - last_ns), d, v, q - last)
            delay = delay if is_late else 0.0
        self._v = d
        self._is_fast = d.dot(d) > MOVING * MOVING
        return Signals(q, d, delay, lost)

    def _agreeing(
        self, dt: float, d: FloatArray, v: FloatArray, moved: FloatArray,
    ) -> tuple[FloatArray, bool]:
        """Return the measured velocities that agree, else d, (n,), and whether d is needed."""
        used, is_late, keep = d.tolist(), False, 1.0 - min(dt / MEMORY, 1.0)
        w, m, agreed, missed = self._integral, self._moved, self._agreed, self._missed
        before = self._before or v.tolist()
        for j, (v_j, d_j, moved_j, far, last, is_missing) in enumerate(zip(
                v.tolist(), used, moved.tolist(), self._far, self._v.tolist(),
                self._missing.tolist())):
            if is_missing:
                v_j = d_j
            elif not -far <= v_j - d_j <= far or v_j == 0.0 and not -MOVING <= d_j <= MOVING:
                missed[j] += 1
                self._way[j] += moved_j
                if missed[j] <= MISSED:
                    used[j] = last
                    continue
                v_j, agreed[j] = d_j, 0.0
            elif missed[j]:
                way, self._way[j] = self._way[j] + moved_j, 0.0
                self.has_jumped |= missed[j] <= MISSED and not -JUMP <= way <= JUMP
                missed[j] = 0
            if not -pi < moved_j <= pi:
                moved_j = wrap_angle(moved_j)
            low, high = (before[j], v_j) if before[j] < v_j else (v_j, before[j])
            w[j] = keep * w[j]
            if moved_j < dt * low:
                w[j] += dt * low - moved_j
            elif moved_j > dt * high:
                w[j] += dt * high - moved_j
            m[j] = keep * m[j] + moved_j
            before[j] = v_j
            tolerance = FLOOR + RATIO * (m[j] if m[j] > 0.0 else -m[j])
            if not -tolerance <= w[j] <= tolerance:
                agreed[j] = 0.0
            elif agreed[j] < AGREEMENT and not missed[j] and not -FLOOR <= m[j] <= FLOOR:
                agreed[j] += dt
            if agreed[j] < AGREEMENT:
                is_late = True
            else:
                used[j] = v_j
        self._before = before
        return np.array(used), is_late

    def _moved_fast(self) -> BoolArray:
        """Return which joints (n,) were so fast in the last step that they cannot stand now."""
        if len(self._states) < 2:
            return np.zeros_like(self._missing)
        (begin_ns, before), (end_ns, q) = self._states[-2], self._states[-1]
        dt = (end_ns - begin_ns) / NANOSECONDS_PER_SECOND
        moved = np.abs(q - before)
        if self._any_wraps:
            moved = np.where(self._wraps, np.abs(wrap_to_pi(moved)), moved)
        return np.asarray(np.minimum(moved, dt * np.abs(self._v)) > dt * max(MOVING, BRAKING * dt))

    def _left_behind(self, stamp_ns: int, q: FloatArray) -> BoolArray:
        """Return which joints (n,) stand although their reference leaves them."""
        none = np.zeros_like(self._missing)
        if stamp_ns < self._check_ns:
            return none
        self._check_ns = stamp_ns + _CHECK_NS
        desired, checked, self._checked = self._reference(), self._checked, q
        if desired is None or self._left is None:
            self._left = desired
            return none
        self._left = np.where(q == checked, self._left, desired)
        left = np.abs(desired - self._left) > LEFT
        return left & ~self._is_held(q, desired - q) if left.any() else none

    def _continued(
        self, stamp_ns: int, q: FloatArray, same: BoolArray, suspects: BoolArray, left: BoolArray,
    ) -> FloatArray:
        """Return the positions (n,) with those of missing joints continued."""
        last_ns, used = self._states[-1]
        found = self._missing & ~same
        if found.any():  # the positions before are moved, so that the velocity is the last one
            shift = np.where(found, q - used - self._v * (1e-9 * (stamp_ns - last_ns)), 0.0)
            for k, (at_ns, before) in enumerate(self._states):
                self._states[k] = at_ns, before + shift
        since_ns = np.where(left, last_ns - _LOST_NS, last_ns)  # a joint that is left is lost
        self._since_ns = np.where(suspects, since_ns, self._since_ns)
        self._missing = self._missing & same | suspects
        self._is_missing = bool(self._missing.any())
        if not self._is_missing:
            return q
        dt = 1e-9 * (stamp_ns - last_ns)
        is_lost = self._missing & (stamp_ns - self._since_ns > _LOST_NS)
        self._v = np.where(is_lost, exp(-DECAY * dt) * self._v, self._v)
        return np.where(self._missing, used + dt * self._v, q)
