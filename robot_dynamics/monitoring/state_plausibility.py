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
Whether a measured state can be what comes after the one before it.

A state is judged by its stamp, by its age where stamps are of the clock of this computer, and by
how far the joints have moved since. Where it cannot follow, time and place start anew from it (a
robot or a simulator was set back); only if several publishers speak of these joints is it refused,
as nobody can tell which of them to believe.
"""

from collections.abc import Callable
import math
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.whole_turns import nearest_turn

SAME_CLOCK = 3600.0
"""[s] within which the first stamp is taken to be of the clock of this computer."""
LONGEST_GAP = 30.0
"""[s] between two states after which nothing is known any more."""
_LONGEST_GAP_NS = int(1e9 * LONGEST_GAP)
PLAY = 0.05
"""[rad] or [m] that a joint may move between two states, whatever its speed."""
SPEED_FACTOR = 1.5


class ImplausibleStateError(InvalidInputError):
    """A state that cannot follow the one before; `reason` names the kind."""

    def __init__(self, reason: str, words: str, is_conflict: bool = False) -> None:
        """`is_conflict` tells of publishers that contradict each other."""
        super().__init__(words)
        self.reason, self.is_conflict = reason, is_conflict


class StateVerdict(NamedTuple):
    """
    What a state is: news, `dt` [s] after the state before, None where that is not known.

    `restart` says why time or place start anew with it, and is empty where they go on. A state
    with the stamp of the one before is no news, whatever else it says. `stamp` [ns] is the time
    of the state; what it was for the state before is now less by `time_shift` [ns].
    """

    is_new: bool
    dt: float | None = None
    restart: str = ''
    stamp: int = 0
    time_shift: int = 0


class StateMonitor:
    """Judges the states of n joints one after the other; stamps and times in [ns]."""

    def __init__(
        self, joint_names: tuple[str, ...], velocity_limit: FloatArray, max_age: float,
        wraps: BoolArray,
    ) -> None:
        """
        `velocity_limit` (n,) is infinite for none; `max_age` [s], 0 for any.

        `wraps` (n,) tells which joints turn without end, so that a whole turn is no way.
        """
        self._names, self._velocity_limit, self._wraps = joint_names, velocity_limit, wraps
        self.max_age = max_age
        self.has_age: Callable[[], bool] = lambda: True
        """Asked before a state is refused for its age: tells whether stamps have one at all."""
        self._q = np.zeros(len(joint_names))
        self._stamp: int | None = None
        self._received = 0
        self._is_same_clock = self._is_unstamped = False

    def judge(
        self, stamp: int, clock: int, q: FloatArray, v: FloatArray | None,
        has_several_publishers: Callable[[], bool],
    ) -> StateVerdict:
        """
        Return what the state is; `clock` is the time of this computer, never that of /clock.

        A stamp of 0 is none, and the clock stands in for it; unless it was the first of a
        simulation, whose stamps then go on from 0.
        `has_several_publishers` is asked where the state does
        not follow. Raises ImplausibleStateError, reason 'too old', 'from the future', 'stamp went
        back' or 'jump'.
        """
        if self._is_usual(stamp, clock, q):
            dt = 1e-9 * (stamp - self._stamp)  # type: ignore[operator]
            self._stamp, self._q, self._received = stamp, q, clock
            return StateVerdict(True, dt, '', stamp)
        if self._stamp is not None and not 0 <= clock - self._received <= _LONGEST_GAP_NS:
            self._stamp = None
        is_unstamped, shift = stamp == 0, 0
        if is_unstamped:
            stamp = clock
        elif self._is_unstamped and self._stamp is not None:  # stamps begin
            shift = self._stamp if stamp < 1e9 * SAME_CLOCK else 0
            self._stamp = None
        age = 1e-9 * (clock - stamp)
        is_same_clock = self._is_same_clock if self._stamp is not None else (
            abs(age) < SAME_CLOCK)
        if is_same_clock and self.max_age > 0.0:
            self._check_age(age)
        judgement = self._follows(stamp, q, v, has_several_publishers)
        if judgement.is_new:
            self._stamp, self._q, self._received = stamp, q, clock
            self._is_same_clock, self._is_unstamped = is_same_clock, is_unstamped
        is_new, dt, restart, *_ = judgement
        return StateVerdict(is_new, dt, '' if shift else restart, stamp, shift)

    @property
    def is_other_clock(self) -> bool:
        """Tell whether stamps are those of a simulation, or of any other clock than this one's."""
        return not self._is_same_clock

    def _is_usual(self, stamp: int, clock: int, q: FloatArray) -> bool:
        """
        Tell in a few steps, for the common case, that a state follows the one before.

        It is one of the same clock, neither old nor from the future, soon after the one before,
        and the arm has hardly moved. Whatever is not is looked at in full.
        """
        last = self._stamp
        return (
            last is not None and last < stamp <= last + _LONGEST_GAP_NS and self._is_same_clock
            and not self._is_unstamped and 0 <= clock - self._received <= _LONGEST_GAP_NS
            and (self.max_age <= 0.0 or abs(clock - stamp) <= 1e9 * self.max_age)
            and self._has_hardly_moved(q))

    def _check_age(self, age: float) -> None:
        if abs(age) <= self.max_age or not self.has_age():
            return
        expected = (f'expected at most {self.max_age:g} s (state_max_age), by the clock of this '
                    'computer')
        if age > self.max_age:
            raise ImplausibleStateError(
                'too old', f'header.stamp is {age:.3f} s old, {expected}')
        raise ImplausibleStateError(
            'from the future', f'header.stamp is {-age:.3f} s in the future, {expected}')

    def _follows(
        self, stamp: int, q: FloatArray, v: FloatArray | None,
        has_several_publishers: Callable[[], bool],
    ) -> StateVerdict:
        if self._stamp is None:
            return StateVerdict(True, restart='first state')
        if stamp == self._stamp:
            return StateVerdict(False)
        dt = 1e-9 * (stamp - self._stamp)
        if stamp - self._stamp > _LONGEST_GAP_NS:
            return StateVerdict(True, restart='stamp jumped ahead')
        if dt > 0.0 and self._has_hardly_moved(q):
            return StateVerdict(True, dt)
        try:
            with np.errstate(over='ignore', invalid='ignore'):  # any finite number is measured
                self._check_follows(dt, q, v)
        except ImplausibleStateError as error:
            if has_several_publishers():
                raise
            return StateVerdict(True, dt if dt > 0.0 else None, error.reason)
        return StateVerdict(True, dt)

    def _has_hardly_moved(self, q: FloatArray) -> bool:
        """Tell in one step, for the common case, whether the way is PLAY at most."""
        return math.dist(q.tolist(), self._q.tolist()) <= PLAY

    def _check_follows(self, dt: float, q: FloatArray, v: FloatArray | None) -> None:
        crowd = 'there are several publishers of joint_states'
        if dt < 0.0:
            raise ImplausibleStateError(
                'stamp went back', f'header.stamp is {-dt:.3f} s before that of the state before, '
                f'expected it later; {crowd}', is_conflict=True)
        speed = self._velocity_limit if v is None else np.maximum(
            self._velocity_limit, np.abs(v))
        moved = np.abs(nearest_turn(q, self._q, self._wraps) - self._q)
        too_far = moved > PLAY + SPEED_FACTOR * speed * dt
        if too_far.any():
            j = int(np.argmax(too_far))
            raise ImplausibleStateError(
                'jump', f'position of {self._names[j]!r} is {q[j]:g}, {moved[j]:g} away from '
                f'that of {dt:.3f} s before, expected at most {PLAY:g} and {SPEED_FACTOR:g} times '
                f'the way at its velocity limit; {crowd}', is_conflict=True)
