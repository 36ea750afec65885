# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Plausibility of a measured state after the previous state.

A state is judged by its stamp, by the clock of this computer, and by the distance that the joints
have moved since the previous state. Stamps belong to one of three clocks:

- the clock of this computer, if they are within SAME_CLOCK of it: a state is rejected if its age
  is above `max_age`;
- the clock of another computer: a state is rejected if the offset of that clock differs from its
  first offset by more than `max_age`;
- simulated time, if they are before SIMULATED_BEFORE: simulated time may run slowly or pause.

A state whose stamp or position cannot follow the last one is missing: an older message, or a
corrupted sample. Only if CONFIRMATIONS states have followed each other from there on (because a
robot or a simulator was reset), the estimates restart with the last of them. If the topic has
several publishers, and states that follow the old ones arrive in the meantime, the publishers
contradict each other.
"""

from collections.abc import Callable
import math
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.angle_wrapping import nearest_turn
from robot_dynamics.validation import LARGEST_VALUE

SAME_CLOCK = 3600.0
"""[s] within which a stamp is assumed to be of the clock of this computer."""
SIMULATED_BEFORE = 1e9
"""[s] since 1970: stamps before this time, in 2001, are simulated time."""
LONGEST_GAP = 30.0
"""[s] between two states after which the previous state is no longer used."""
_LONGEST_GAP_NS = int(1e9 * LONGEST_GAP)
JUMP = 1.0
"""[s] by which a stamp may run ahead of the clock between two states, without a `max_age`."""
_JUMP_NS = int(1e9 * JUMP)
DRIFT = 1e-3
"""Rate [s/s] at which the offset of the clock of another computer is tracked."""
PLAY = 0.05
"""[rad] or [m] that a joint may move between two states at any velocity."""
SPEED_FACTOR, LARGEST_SPEED = 1.5, 100.0
"""Plausible speed by the velocity limit, which is at most LARGEST_SPEED [rad/s] or [m/s]."""
CONFIRMATIONS = 5
"""States that must confirm an implausible state."""
CONTRADICTION = 100
"""Consecutive good states after which a contradiction between publishers has ended."""


class ImplausibleStateError(InvalidInputError):
    """A state that cannot follow the previous one; `reason` names the kind of error."""

    def __init__(self, reason: str, words: str, is_conflict: bool = False) -> None:
        """`is_conflict` is true if publishers contradict each other."""
        super().__init__(words)
        self.reason, self.is_conflict = reason, is_conflict


class StateVerdict(NamedTuple):
    """
    The verdict on a state: whether it is new, and `dt` [s] since the previous state (or None).

    `restart` states why the estimates restart with this state; it is empty if they continue. A
    state with the stamp of the previous one is not new, whatever else it contains. `stamp` [ns] is
    the time of the state; the time of the previous state decreases by `time_shift` [ns].
    """

    is_new: bool
    dt: float | None = None
    restart: str = ''
    stamp: int = 0
    time_shift: int = 0


class StatePlausibility:
    """Judges the states of n joints one after the other; stamps and times in [ns]."""

    def __init__(
        self, joint_names: tuple[str, ...], velocity_limit: FloatArray, max_age: float,
        wraps: BoolArray,
    ) -> None:
        """
        `velocity_limit` (n,) is infinite for no limit; a `max_age` [s] of 0 permits any age.

        `wraps` (n,) marks the continuous joints, for which a whole turn is no distance.
        """
        self._names, self._wraps = joint_names, wraps
        self._speed = SPEED_FACTOR * np.minimum(velocity_limit, LARGEST_SPEED)
        self.max_age = max_age
        self.has_age: Callable[[], bool] = lambda: True
        """Called before a state is rejected for its age: returns whether stamps have an age."""
        self._q = np.zeros(len(joint_names))
        self._values: list[float] = []
        """The last position as a list, whose distance is faster to compute."""
        self._stamp: int | None = None
        self._received = 0
        self._is_same_clock = self._is_unstamped = False
        self._is_simple = False
        """Whether the last state was of the clock of this computer, and uncontradicted."""
        self.is_other_clock = True
        """Whether stamps are of a simulation, or of the clock of another computer."""
        self._offset = 0.0
        """Delay [s] of the clock of the stamps relative to the clock of this computer."""
        self._challenger: tuple[int, FloatArray, int] | None = None
        """Stamp and position of the newest rejected state, and the count of those before it."""
        self._has_several = False
        """Whether there were several publishers when it was rejected."""
        self.is_lock_step = False
        """Whether a simulation waits for each answer: no state is rejected, and 0 is a stamp."""
        self._contradiction = 0
        """Number of good states until a contradiction between publishers has ended."""

    def judge(
        self, stamp: int, clock: int, q: FloatArray,
        has_several_publishers: Callable[[], bool], steady: int | None = None,
    ) -> StateVerdict:
        """
        Return the verdict on a state; `clock` is the time of this computer, never that of /clock.

        `steady` [ns] is the time of a steady clock; if it is omitted, it is `clock`.

        A stamp of 0 means that there is no stamp; `clock` then replaces it, unless 0 was the first
        stamp of a simulation, whose stamps then continue from 0.
        `has_several_publishers` is called if the state cannot follow the previous one. Raises
        ImplausibleStateError with the reason 'too old', 'from the future', 'stamp jumped ahead',
        'stamp went back' or 'jump'.
        """
        if steady is None:
            steady = clock
        last = self._stamp
        if self._is_simple and last is not None:  # the usual case; others are checked in full
            passed_ns, largest = steady - self._received, 1e9 * self.max_age or _JUMP_NS
            if (last < stamp <= last + passed_ns + largest and 0 <= passed_ns <= _LONGEST_GAP_NS
                    and (self.max_age <= 0.0 or abs(clock - stamp) <= largest)
                    and math.dist(values := q.tolist(), self._values) <= PLAY):
                self._stamp, self._q, self._received, self._values = stamp, q, steady, values
                return StateVerdict(True, 1e-9 * (stamp - last), '', stamp)
        self._is_simple = False
        passed = 1e-9 * (steady - self._received)
        if not 0.0 <= passed <= LONGEST_GAP:
            self._stamp = None
        is_unstamped, shift = stamp == 0 and not self.is_lock_step, 0
        if is_unstamped:
            stamp = clock
        elif self._is_unstamped and self._stamp is not None:  # stamps begin
            shift = self._stamp if stamp < 1e9 * SAME_CLOCK else 0
            self._stamp = None
        age = 1e-9 * (clock - stamp)
        is_same_clock = abs(age) < SAME_CLOCK or self._stamp is not None and self._is_same_clock
        if self.max_age > 0.0:
            self._check_clock(stamp, age, is_same_clock)
        judgement = self._follows(stamp, passed, q, has_several_publishers)
        if judgement.is_new:
            self._follow_offset(age, passed, bool(judgement.restart))
            self._stamp, self._q, self._received, self._values = stamp, q, steady, q.tolist()
            self._is_same_clock, self._is_unstamped = is_same_clock, is_unstamped
            self.is_other_clock = not is_same_clock
        self._is_simple = self._is_same_clock and not self._is_unstamped and (
            self._challenger is None and not self._contradiction)
        is_new, dt, restart, *_ = judgement
        return StateVerdict(is_new, dt, '' if shift else restart, stamp, shift)

    def _check_clock(self, stamp: int, age: float, is_same_clock: bool) -> None:
        """Raise ImplausibleStateError for a stamp that is too far from its clock."""
        if is_same_clock:
            excess, clock = age, 'by the clock of this computer'
        elif self._stamp is None or stamp < 1e9 * SIMULATED_BEFORE:
            return
        else:
            excess, clock = age - self._offset, 'by the offset of its clock so far'
        if abs(excess) <= self.max_age or not self.has_age():
            return
        expected = f'expected at most {self.max_age:g} s (state_max_age), {clock}'
        if excess > 0.0:
            raise ImplausibleStateError(
                'too old', f'header.stamp is {excess:.3f} s old, {expected}')
        raise ImplausibleStateError(
            'from the future', f'header.stamp is {-excess:.3f} s in the future, {expected}')

    def _follow_offset(self, age: float, interval: float, is_first: bool) -> None:
        most = math.inf if is_first else DRIFT * interval
        self._offset += min(max(age - self._offset, -most), most)

    def _follows(
        self, stamp: int, passed: float, q: FloatArray,
        has_several_publishers: Callable[[], bool],
    ) -> StateVerdict:
        if self._stamp is None:
            self._check_is_possible(q)
            return StateVerdict(True, restart='first state')
        if stamp == self._stamp:
            return StateVerdict(False)
        dt = 1e-9 * (stamp - self._stamp)
        try:
            with np.errstate(over='ignore', invalid='ignore'):  # any finite number can be measured
                self._check_follows(dt, passed, q)
        except ImplausibleStateError as error:
            self._check_is_possible(q)
            self._has_several = has_several_publishers()
            if not (self.is_lock_step or self._is_confirmed(stamp, q)):
                raise
            self._challenger = None
            return StateVerdict(True, dt if error.reason == 'jump' else None, error.reason)
        if self._challenger is not None:
            self._challenger = None
            if self._has_several:
                self._contradiction = CONTRADICTION
        self._contradiction = max(self._contradiction - 1, 0)
        return StateVerdict(True, dt)

    def _check_is_possible(self, q: FloatArray) -> None:
        """Raise ImplausibleStateError for a position (n,) that no arm has."""
        j = int(np.argmax(np.abs(q)))
        if not abs(q[j]) <= LARGEST_VALUE:
            raise ImplausibleStateError(
                'jump', f'position of {self._names[j]!r} is {q[j]:g}, expected at most '
                f'{LARGEST_VALUE:g}; it is not used')

    def _is_confirmed(self, stamp: int, q: FloatArray) -> bool:
        """Return whether enough states that did not follow the old ones follow each other."""
        if self._contradiction > 0:
            return False
        count = 0
        if self._challenger is not None:
            before, q_before, count = self._challenger
            way = PLAY + self._speed * (1e-9 * (stamp - before))
            follows = 0 <= stamp - before <= _LONGEST_GAP_NS and bool(
                (np.abs(q - q_before) <= way).all())
            count = count + 1 if follows else 0
        self._challenger = stamp, q, count
        return count >= CONFIRMATIONS

    def _has_hardly_moved(self, q: FloatArray) -> bool:
        """Return in one step, for the common case, whether the distance is at most PLAY."""
        return math.dist(q.tolist(), self._q.tolist()) <= PLAY

    def _check_follows(
        self, dt: float, passed: float, q: FloatArray,
    ) -> None:
        is_conflict = self._contradiction > 0
        publishers = 'there are several publishers of joint_states' if is_conflict else (
            'it is not used')
        if dt < 0.0:
            raise ImplausibleStateError(
                'stamp went back', f'header.stamp is {-dt:.3f} s before that of the previous '
                f'state, expected a later stamp; {publishers}', is_conflict)
        largest = self.max_age if self.max_age > 0.0 else JUMP
        if dt > LONGEST_GAP or dt - passed > largest:
            raise ImplausibleStateError(
                'stamp jumped ahead', f'header.stamp is {dt:.3f} s after that of the state '
                f'{passed:.3f} s before, expected at most {largest:g} s more; {publishers}',
                is_conflict)
        if self._has_hardly_moved(q):
            return
        moved = np.abs(nearest_turn(q, self._q, self._wraps) - self._q)
        too_far = ~(moved <= PLAY + self._speed * dt) | (np.abs(q) > LARGEST_VALUE)
        if too_far.any():
            j = int(np.argmax(too_far))
            raise ImplausibleStateError(
                'jump', f'position of {self._names[j]!r} is {q[j]:g}, {moved[j]:g} away from '
                f'that of {dt:.3f} s before, expected at most {PLAY:g} and {SPEED_FACTOR:g} times '
                f'the distance at its velocity limit; {publishers}', is_conflict)
