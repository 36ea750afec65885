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
SIMULATED_BEFORE = 1_000_000_000 * 10**9
"""[ns] since 1970: stamps before this time, in 2001, are simulated time."""
LONGEST_GAP = 30.0
"""[s] between two states after which the previous state is no longer used."""
JUMP = 1.0
"""[s] by which a stamp may run ahead of the clock between two states, without a `max_age`."""
DRIFT = 1e-3
"""Rate [s/s] at which the offset of the clock of another computer is tracked."""
PLAY = 0.05
"""[rad] or [m] that a joint may move between two states at any velocity."""
SPEED_FACTOR, LARGEST_SPEED = 1.5, 20.0
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
    the time of the state.
    """

    is_new: bool
    dt: float | None = None
    restart: str = ''
    stamp: int = 0


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
        self.is_lock_step = False
        """Whether a simulation waits for each answer: no state is rejected, and 0 is a stamp."""
        self._q: FloatArray = np.zeros(len(joint_names))
        self.unseen: FloatArray = np.zeros(len(joint_names))
        """[s] since the last sample of each joint (n,) whose sample is missing, 0 for others."""
        self._stamp: int | None = None
        self._received = 0
        self._offset = 0.0
        """[s] by which the clock of the stamps is behind that of this computer; 0: the same."""
        self._challenger: tuple[int, FloatArray, int] | None = None
        """Stamp and position of the newest rejected state, and the count of those before it."""
        self._has_several = False
        """Whether there were several publishers when it was rejected."""
        self._contradiction = 0
        """Number of good states until a contradiction between publishers has ended."""

    @property
    def is_other_clock(self) -> bool:
        """Whether stamps are of a simulation, or of the clock of another computer."""
        return self._stamp is None or self._offset != 0.0

    @property
    def clock_offset(self) -> float:
        """[s] by which the clock of another computer is behind; 0 for other stamps."""
        is_known = self._stamp is not None and self._stamp >= SIMULATED_BEFORE and self.has_age()
        return self._offset if is_known else 0.0

    def judge(
        self, stamp: int, clock: int, q: FloatArray,
        has_several_publishers: Callable[[], bool], steady: int | None = None,
    ) -> StateVerdict:
        """
        Return the verdict on a state; `clock` is the time of this computer, never that of /clock.

        `steady` [ns] is the time of a steady clock; if it is omitted, it is `clock`. A stamp of 0
        means that there is no stamp; `clock` then replaces it, but not in lock-step.
        `has_several_publishers` is called if the state cannot follow the previous one. Raises
        ImplausibleStateError with the reason 'too old', 'from the future', 'stamp jumped ahead',
        'stamp went back' or 'jump'.
        """
        steady = clock if steady is None else steady
        if stamp == 0 and not self.is_lock_step:
            stamp = clock
        passed = 1e-9 * (steady - self._received)
        if not 0.0 <= passed <= LONGEST_GAP:
            self._stamp = None
        offset = self._current_offset(stamp, 1e-9 * (clock - stamp), passed)
        if stamp == self._stamp:
            return StateVerdict(False, stamp=stamp)
        dt, restart = None, 'first state'
        if self._stamp is None:
            self._check_is_possible(q)
        else:
            dt = 1e-9 * (stamp - self._stamp)
            restart, words = self._contradicts(dt, passed, q)
            if not restart:
                if self._challenger is not None and self._has_several:
                    self._contradiction = CONTRADICTION
                self._contradiction = max(self._contradiction - 1, 0)
            elif not self.is_lock_step:
                self._has_several = has_several_publishers()
                self._check_is_confirmed(stamp, q, restart, words)
        self._stamp, self._received, self._q, self._offset = stamp, steady, q, offset
        self._challenger = None
        continues = not restart or restart == 'jump' and not self.is_lock_step
        return StateVerdict(True, dt if continues else None, restart, stamp)

    def _current_offset(self, stamp: int, age: float, passed: float) -> float:
        """Return the offset of the clock of a stamp; raise ImplausibleStateError for its age."""
        is_new = self._stamp is None or stamp < SIMULATED_BEFORE  # simulated time has no age
        offset = 0.0 if abs(age) < SAME_CLOCK else age if is_new else self._offset
        excess = age - offset
        if abs(excess) > self.max_age > 0.0 and self.has_age():
            reason, side = ('too old', 'old') if excess > 0.0 else (
                'from the future', 'in the future')
            clock = 'offset of its clock so far' if offset else 'clock of this computer'
            raise ImplausibleStateError(
                reason, f'header.stamp is {abs(excess):.3f} s {side}, expected at most '
                f'{self.max_age:g} s (state_max_age), by the {clock}')
        drift = DRIFT * passed
        return offset + min(max(excess, -drift), drift) if offset else 0.0

    def _check_is_possible(self, q: FloatArray) -> None:
        """Raise ImplausibleStateError for a position (n,) that no arm has."""
        j = int(np.argmax(np.abs(q)))
        if not abs(q[j]) <= LARGEST_VALUE:
            raise ImplausibleStateError(
                'jump', f'position of {self._names[j]!r} is {q[j]:g}, expected at most '
                f'{LARGEST_VALUE:g}; it is not used')

    def _contradicts(self, dt: float, passed: float, q: FloatArray) -> tuple[str, str]:
        """Return why a state cannot follow the last one, and its words; empty if it can."""
        is_near = math.dist(q.tolist(), self._q.tolist()) <= PLAY
        if not is_near:
            self._check_is_possible(q)
        if dt < 0.0:
            return 'stamp went back', (
                f'header.stamp is {-dt:.3f} s before that of the previous state, expected a later '
                'stamp')
        largest = self.max_age or JUMP
        if dt - passed > largest:
            return 'stamp jumped ahead', (
                f'header.stamp is {dt:.3f} s after that of the state {passed:.3f} s before, '
                f'expected at most {largest:g} s more')
        if is_near:
            return '', ''
        moved = np.abs(nearest_turn(q, self._q, self._wraps) - self._q)
        way = self._speed * (dt + self.unseen)
        if self._challenger is not None and math.dist(q, self._challenger[1]) < math.dist(
                q, self._q):  # the arm has not moved to the place of the rejected states
            way = 0.0 * way
        excess = moved - PLAY - way
        j = int(np.argmax(excess))
        return ('', '') if excess[j] <= 0.0 else ('jump', (
            f'position of {self._names[j]!r} is {q[j]:g}, {moved[j]:g} away from that of {dt:.3f} '
            f's before, expected at most {PLAY:g} and {SPEED_FACTOR:g} times the distance at its '
            'velocity limit'))

    def _check_is_confirmed(self, stamp: int, q: FloatArray, reason: str, words: str) -> None:
        """Raise ImplausibleStateError until enough such states have followed each other."""
        is_conflict, count = self._contradiction > 0, 0
        if self._challenger is not None:
            before, q_before, count = self._challenger
            dt = 1e-9 * (stamp - before)
            follows = dt >= 0.0 and bool(
                (np.abs(q - q_before) <= PLAY + self._speed * dt).all())
            count = count + 1 if follows else 0
        self._challenger = stamp, q, count
        if is_conflict or count < CONFIRMATIONS:
            publishers = 'there are several publishers of joint_states' if is_conflict else (
                'it is not used')
            raise ImplausibleStateError(reason, f'{words}; {publishers}', is_conflict)
