# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Joints whose sample repeats, and which of them are frozen: no longer updated by their driver.

A joint whose position and velocity are equal bit by bit in successive states is not updated by its
driver, or stands still. Drivers that send each sample several times are known by the duration of
the earlier repetitions. A joint is frozen if its velocity or its reference leaves the sample by
more than a joint at rest can explain.
"""

from collections.abc import Callable, Sequence

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray

FLOOR = 0.003
"""[rad] of difference that encoder resolution and backlash may cause; less at prismatic joints."""
SLOW = 0.02
"""[rad/s] of velocity offset that is tolerated."""
REPEATS = 0.01
"""[s] that a sample may repeat, at least."""
LONGEST_REPEATS = 0.06
"""[s] that a driver may usually repeat its samples; longer repetitions are not learnt."""
CONFIRMATIONS = 3
"""Checks in a row in which the reference has left a joint without a new sample."""
REFERENCE = 0.03
"""[rad] that the reference of a joint that stands still may move while its sample repeats."""
LIVELY = 8
"""
Stored states of a slow joint without a repetition: its noise or motion changes every sample.

They take 40 ms, so that a repetition of half of LONGEST_REPEATS is not one of the driver.
"""
STANDING = 1e-6
"""[rad/s] up to which a joint whose sample repeats stood still."""
REST = 0.0002
"""[rad] that a joint moves at most between two checks at rest."""
NEVER = -1 << 62
_STEPS = 3.0
"""Displacement of a lively joint that its encoder shows, in smallest steps of its positions."""
_FORGETTING = 0.98
_NS = 1e-9

Reference = Callable[[], FloatArray | None]
"""Returns the desired position (n,), None without a reference."""
IsHeld = Callable[[FloatArray, FloatArray], BoolArray]
"""
Returns at which joints (n,) dry friction can hold an arm.

The arguments are the position q and the errors reference minus q, (n,) each [rad] or [m].
"""


class RepeatedSamples:
    """
    The repeated samples of n joints.

    `frozen` (n,) marks the joints whose sample repeats although they move. `since_ns` (n,) is the
    stamp [ns] since which the sample of a joint repeats, negative if it does not. `duration` (n,)
    [s] is how long the driver usually repeats a sample.
    """

    def __init__(
        self, joint_names: Sequence[str], unit: FloatArray, is_held: IsHeld | None,
    ) -> None:
        """Take the names of n joints, and what corresponds to 1 rad at each of them, (n,)."""
        n = len(joint_names)
        self._names, self._unit, self._is_held = tuple(joint_names), unit, is_held
        self.frozen: BoolArray = np.zeros(n, dtype=bool)
        self.since_ns: IntArray = np.full(n, NEVER)
        self.duration = np.zeros(n)
        self.lively = np.zeros(n)
        """Stored states (n,) since the last repetition in which the joint was slow."""
        self.is_active = self.has_ended = False
        """Whether a sample repeats, and whether a frozen joint has just been updated again."""
        self._left: IntArray = np.zeros(n, dtype=np.int64)
        """Checks in a row in which the reference has left a joint without a new sample, (n,)."""
        self._reference: FloatArray | None = None

    def restart(self) -> None:
        """Treat the next state as a first one; a joint remains frozen until its sample changes."""
        self._reference = None
        self.since_ns.fill(NEVER)

    def forget(self) -> None:
        """Let the usual duration of repetitions decay, at each check."""
        self.duration = _FORGETTING * self.duration

    def follow(
        self, stamp_ns: int, same: BoolArray, start_ns: IntArray, q: FloatArray, v: FloatArray,
        reference: Reference, smallest_step: Callable[[], FloatArray],
    ) -> str:
        """
        Take the repetitions of a stored state, and return why a joint is frozen now, if it is.

        `same` (n,) marks the joints whose sample repeats now, `start_ns` (n,) is the beginning of
        a new repetition, and q, v (n,) is the sample. `smallest_step` returns the smallest
        displacement (n,) of the joints before.
        """
        desired, zero = reference(), np.zeros_like(q)
        was_repeating = self.since_ns != NEVER
        if self._reference is None or desired is None:
            moved = zero
            self._reference = desired
        else:
            self._reference = np.where(same & was_repeating, self._reference, desired)
            moved = np.abs(desired - self._reference)
        start, speed = np.where(was_repeating, self.since_ns, start_ns), np.abs(v)
        duration = _NS * (stamp_ns - start)
        ends = ~same & was_repeating & (  # at rest samples repeat anyway
            speed * duration > REST * self._unit)
        self.lively = np.where(same | ~was_repeating, self.lively, 0.0)
        self.duration = np.where(ends & (duration <= LONGEST_REPEATS), np.maximum(
            self.duration, duration), self.duration)
        self.since_ns = np.where(same, start, NEVER)
        self.is_active = bool(same.any())
        excess = duration - np.maximum(REPEATS, 2.0 * self.duration)
        was_moving = speed > STANDING * self._unit
        is_left = same & (moved > np.where(was_moving, FLOOR, REFERENCE) * self._unit)
        if self._is_held is not None and desired is not None and is_left.any():
            is_left &= was_moving | ~self._is_held(q, desired - q)
        self._left = np.where(is_left, self._left + 1, 0)
        is_lively = was_moving & (self.lively >= LIVELY) & (
            duration > 0.5 * LONGEST_REPEATS)
        if is_lively.any():
            is_lively &= speed * duration > _STEPS * smallest_step()
        frozen = same & (self.frozen | (excess > 0.0) & (
            ((speed - SLOW * self._unit) * excess > FLOOR * self._unit) |
            (self._left >= CONFIRMATIONS) | is_lively))
        reason = ''
        for j in np.flatnonzero(frozen & ~self.frozen):
            reason = (
                f'position and velocity of {self._names[j]!r} have not changed for '
                f'{1e3 * duration[j]:.0f} ms: velocity {v[j]:.2g}, reference moved by '
                f'{moved[j]:.2g}')
        self.has_ended = bool((self.frozen & ~frozen).any())
        self.frozen = frozen
        return reason
