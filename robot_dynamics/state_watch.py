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
far the joints have moved since. Where it cannot follow, time and place start anew from it (a robot
or a simulator was set back), unless several publishers speak of these joints: then one of them
must not be believed, and the state is refused.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.validation import FloatArray

BoolArray = npt.NDArray[np.bool_]

SAME_CLOCK = 1_000_000_000
"""[ns] within which the first stamp must be of the clock for ages to be watched."""
LONGEST_GAP = 10_000_000_000
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
    """
    Whether a state is news, and why time and place start anew with it, empty where they go on.

    A state with the stamp of the one before is no news, whatever else it says.
    """

    is_news: bool
    restart: str = ''


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
        self._stamp: int | None = None
        self._q = np.zeros(len(joint_names))
        self.watches_age: bool | None = None
        """Whether stamps are of the node's clock; None before the first state."""

    def judge(
        self, stamp: int, clock: int, q: FloatArray, v: FloatArray | None,
        is_crowded: Callable[[], bool],
    ) -> Judgement:
        """
        Return what the state is, at the time `clock` of the node.

        `is_crowded` tells whether there are several publishers; it is asked where the state does
        not follow. Raises ImplausibleStateError, reason 'too old', 'from the future', 'stamp went
        back' or 'jump'.
        """
        self._check_age(stamp, clock)
        if self._stamp is None:
            self._stamp, self._q = stamp, q
            return Judgement(True, 'first state')
        if stamp == self._stamp:
            return Judgement(False)
        try:
            self._check_follows(1e-9 * (stamp - self._stamp), q, v)
            restart = 'time jumped' if stamp - self._stamp > LONGEST_GAP else ''
        except ImplausibleStateError as error:
            if is_crowded():
                raise
            restart = error.reason
        self._stamp, self._q = stamp, q
        return Judgement(True, restart)

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

    def _check_follows(self, dt: float, q: FloatArray, v: FloatArray | None) -> None:
        if dt < 0.0:
            raise ImplausibleStateError(
                'stamp went back', f'header.stamp is {-dt:.3f} s before that of the state before, '
                'expected it later; there are several publishers of joint_states')
        speed = self._velocity_limit if v is None else np.maximum(
            self._velocity_limit, np.abs(v))
        way = q - self._q
        moved = np.abs(np.where(
            self._wraps, way - 2.0 * np.pi * np.round(way / (2.0 * np.pi)), way))
        too_far = moved > PLAY + SPEED_FACTOR * speed * dt
        if too_far.any():
            j = int(np.argmax(too_far))
            raise ImplausibleStateError(
                'jump', f'position of {self._names[j]!r} is {q[j]:g}, {moved[j]:g} away from '
                f'that of {dt:.3f} s before, expected at most {PLAY:g} and {SPEED_FACTOR:g} times '
                'the way at its velocity limit; there are several publishers of joint_states')
