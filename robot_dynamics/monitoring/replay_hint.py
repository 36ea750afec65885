# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Recognition of a replayed recording by the stamps of its states.

`ros2 bag play` publishes states under the stamps of the recording at the pace of the recording:
their age is constant and larger than that of any live state.
"""

from robot_dynamics.arrays import NANOSECONDS_PER_SECOND

LEAST_SPAN = 1.0
"""[s] of stamps over which the age must be constant."""
LEAST_STATES = 10
"""Number of states in this span."""
LARGEST_JITTER = 0.2
"""Largest difference [s] between the largest and the smallest age in this span."""
OLDEST_RECORDING = 1_000_000_000 * NANOSECONDS_PER_SECOND
"""[ns] since 1970; a smaller stamp is that of a simulation, whose time starts at 0."""


class ReplayHint:
    """Examines states that are too old for live states; stamps and times in [ns]."""

    def __init__(self) -> None:
        self.text = ''
        """The hint while the states seem to come from a replay, otherwise empty."""
        self._states = 0
        self._first = self._least = self._largest = 0

    def reset(self) -> None:
        """Forget all states: a live one has arrived."""
        self.text, self._states = '', 0

    def examine(self, stamp: int, clock: int) -> bool:
        """
        Examine an old state; `clock` is the time of this computer.

        Return whether the replay was recognised with this state.
        """
        age = clock - stamp
        least, largest = min(self._least, age), max(self._largest, age)
        if not self._states or stamp < self._first or (
                largest - least > LARGEST_JITTER * NANOSECONDS_PER_SECOND):
            self.text = ''
            self._states, self._first, self._least, self._largest = 1, stamp, age, age
            return False
        self._states, self._least, self._largest = self._states + 1, least, largest
        if self.text or stamp < OLDEST_RECORDING or self._states < LEAST_STATES or (
                stamp - self._first < LEAST_SPAN * NANOSECONDS_PER_SECOND):
            return False
        self.text = (
            f'all joint states are {age / NANOSECONDS_PER_SECOND:.1f} s old, a constant age, as '
            'of a replayed recording: play it with `ros2 bag play --clock` and start this node '
            'with `use_sim_time:=true`; if a robot publishes them, synchronise its clock')
        return True
