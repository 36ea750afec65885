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

A state is judged by its stamp, by its age where stamps follow the clock of the node, and by how
far the joints have moved since. What persists is believed in the end: after RESYNC states in a row
that fit each other, but not what came before them, time and place start anew from there.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.validation import FloatArray

BoolArray = npt.NDArray[np.bool_]

RESYNC = 10
SAME_CLOCK = 1_000_000_000
"""[ns] within which the first stamp must be of the clock for ages to be watched."""
LONGEST_GAP = 500_000_000
"""[ns] between two states after which time has jumped rather than passed."""
PLAY = 0.05
"""[rad] or [m] that a joint may move between two states, whatever its speed."""
SPEED_FACTOR = 1.5


class ImplausibleStateError(InvalidInputError):
    """A state that cannot follow the one before; `reason` names the kind."""

    def __init__(self, reason: str, words: str) -> None:
        super().__init__(words)
        self.reason = reason


class Judgement(NamedTuple):
    """Whether a state is news (else a repetition), and whether time starts anew with it."""

    is_news: bool
    restarts: bool


class _Seen(NamedTuple):
    stamp: int
    q: FloatArray


class StateWatch:
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
        self._last: _Seen | None = None
        self._refused: list[_Seen] = []
        self.watches_age: bool | None = None
        """Whether stamps are of the node's clock; None before the first state."""

    def judge(
        self, stamp: int, clock: int, q: FloatArray, v: FloatArray | None,
    ) -> Judgement:
        """
        Return what the state is, at the time `clock` of the node.

        Raises ImplausibleStateError, reason 'too old', 'from the future', 'frozen stamp',
        'stamp went back' or 'jump'.
        """
        seen = _Seen(stamp, q)
        self._check_age(stamp, clock)
        last = self._last
        if last is None:
            self._last = seen
            return Judgement(True, True)
        if stamp == last.stamp and np.array_equal(q, last.q):
            return Judgement(False, False)
        try:
            self._check_follows(last, seen, v)
        except ImplausibleStateError:
            if not self._is_believed(seen, v):
                raise
            self._last = seen
            return Judgement(True, True)
        self._refused.clear()
        self._last = seen
        return Judgement(True, stamp - last.stamp > LONGEST_GAP)

    def _check_age(self, stamp: int, clock: int) -> None:
        age = clock - stamp
        if self.watches_age is None:
            self.watches_age = abs(age) < SAME_CLOCK
        if not self.watches_age or self.max_age == 0.0:
            return
        if age > 1e9 * self.max_age:
            raise ImplausibleStateError(
                'too old', f'header.stamp is {1e-9 * age:.3f} s old, expected at most '
                f'{self.max_age:g} s (state_max_age)')
        if -age > 1e9 * self.max_age:
            raise ImplausibleStateError(
                'from the future', f'header.stamp is {-1e-9 * age:.3f} s ahead of the clock, '
                f'expected at most {self.max_age:g} s (state_max_age)')

    def _check_follows(self, last: _Seen, seen: _Seen, v: FloatArray | None) -> None:
        dt = 1e-9 * (seen.stamp - last.stamp)
        if dt == 0.0:
            raise ImplausibleStateError(
                'frozen stamp', 'header.stamp is that of the state before, but position differs, '
                'expected a stamp of its own for each state')
        if dt < 0.0:
            raise ImplausibleStateError(
                'stamp went back', f'header.stamp is {-dt:.3f} s before that of the state before, '
                'expected it later')
        speed = self._velocity_limit if v is None else np.maximum(
            self._velocity_limit, np.abs(v))
        way = seen.q - last.q
        moved = np.abs(np.where(self._wraps, way - 2.0 * np.pi * np.round(
            way / (2.0 * np.pi)), way))
        too_far = moved > PLAY + SPEED_FACTOR * speed * dt
        if too_far.any():
            j = int(np.argmax(too_far))
            raise ImplausibleStateError(
                'jump', f'position of {self._names[j]!r} is {seen.q[j]:g}, {moved[j]:g} away from '
                f'that of {dt:.3f} s before, expected at most {PLAY:g} and {SPEED_FACTOR:g} times '
                'the way at its velocity limit; is there a second publisher of joint_states?')

    def _is_believed(self, seen: _Seen, v: FloatArray | None) -> bool:
        """Tell whether the states that were refused last, and this one, fit each other."""
        if self._refused:
            try:
                self._check_follows(self._refused[-1], seen, v)
            except ImplausibleStateError:
                self._refused.clear()
        self._refused.append(seen)
        if len(self._refused) < RESYNC:
            return False
        self._refused.clear()
        return True
