# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
States of one arm from messages that contain all of its joints, some, or none.

Several publishers may share the topic `joint_states`: an arm, a gripper, the halves of an arm. A
message with all joints of the arm is a state. Messages with some of the joints are combined: the
state is complete when every joint has a sample of the last half period. It has the newest stamp.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.ros.middleware.cdr_templates import Layout, SensedState, stamp_bytes
from robot_dynamics.validation import check_unique

HALF_PERIOD = 0.55
"""Largest age of a sample in periods: half a period, and a margin for jitter."""
MOST_SOURCES = 32
"""Largest number of stored sources with some of the joints."""
_SMOOTHING = 0.1
"""Weight of a new interval in the period of a source."""
_LONGEST_PERIOD_NS = 2_000_000_000


class OtherJointsError(InvalidInputError):
    """A message without any of these joints, such as from another device on the same topic."""


class ForeignJointsError(InvalidInputError):
    """A message with joints that the embedded arm does not have."""


class _Part:
    """The content of the messages of one source: joints of the arm, and their period [ns]."""

    def __init__(self, names: list[str], joint_names: tuple[str, ...]) -> None:
        used = [name for name in joint_names if name in names]
        check_unique('name', [name for name in names if name in used])
        self.rows: IntArray = np.array([joint_names.index(name) for name in used], dtype=np.intp)
        self.columns: IntArray = np.array([names.index(name) for name in used], dtype=np.intp)
        self.stamp, self.period = -1, 0.0

    def happened(self, stamp: int) -> bool:
        """Take the stamp [ns] of a message; return whether it follows the one before."""
        interval, is_first = stamp - self.stamp, self.stamp < 0
        self.stamp = stamp
        if is_first or not 0 < interval < _LONGEST_PERIOD_NS:
            self.period = 0.0
            return is_first or interval == 0
        weight = _SMOOTHING if self.period else 1.0
        self.period += weight * (interval - self.period)
        return True


class StateAssembly:
    """Assembles the states of one arm."""

    def __init__(self, joint_names: tuple[str, ...], is_exact: bool = False) -> None:
        """With `is_exact`, messages with other joints are errors."""
        n = len(joint_names)
        self._names, self._is_exact = joint_names, is_exact
        self.whole: Layout | None = None
        """The last layout of messages with all joints."""
        self._parts: dict[tuple[str, ...], _Part] = {}
        self._numbers: FloatArray = np.full((3, n), np.nan)
        """The newest samples: position, velocity, effort."""
        self._stamps: IntArray = np.full(n, -1, dtype=np.int64)
        """Their stamps [ns]."""
        self._layouts = tuple(
            Layout(slice(0, n), slice(n, 2 * n), slice(2 * n, end)) for end in (2 * n, 3 * n))
        self.missing: list[str] = []
        """Joints without a sample that is new enough, at the last message with some joints."""

    def take(self, state: SensedState) -> SensedState | None:
        """
        Return the complete state at a message; None if samples are missing.

        Raises OtherJointsError for a message with none of the joints, ForeignJointsError if
        `is_exact` and it has others, InvalidInputError for one that cannot be read.
        """
        if state.layout is self.whole:
            return state
        names = set(state.name)
        if self._is_exact and not names <= set(self._names):
            raise ForeignJointsError(
                f'the joint states contain {list(state.name)}, but no robot_description was given '
                f'and the embedded arm has {list(self._names)} only. Expected a description of '
                'the robot: set robot_description_file, or publish the topic robot_description')
        if names.isdisjoint(self._names):
            raise OtherJointsError(
                f'name has none of {list(self._names)} among its {len(state.name)}')
        if names.issuperset(self._names):
            self.whole = state.layout
            return state
        return self._take_part(state)

    def _take_part(self, state: SensedState) -> SensedState | None:
        key = tuple(state.name)
        part = self._parts.get(key)
        if part is None:
            if len(self._parts) == MOST_SOURCES:
                self._parts.clear()
            part = self._parts[key] = _Part(state.name, self._names)
        if len(state.position) != len(key):
            raise InvalidInputError(
                f'position has {len(state.position)} values, expected {len(key)} as name has')
        numbers, stamps = self._numbers, self._stamps
        if not part.happened(state.stamp_ns):  # the stamps went back
            stamps[:] = -1
        for row, values in zip(numbers, (state.position, state.velocity, state.effort)):
            row[part.rows] = values[part.columns] if len(values) == len(key) else np.nan
        stamps[part.rows] = state.stamp_ns
        newest = int(stamps.max())
        # the largest age of a sample [ns]; 0 until the period is known
        largest = HALF_PERIOD * max(part.period for part in self._parts.values())
        outdated = (stamps < 0) | (newest - stamps > largest)
        self.missing = [name for name, lacks in zip(self._names, outdated) if lacks]
        if self.missing:
            return None
        layout = self._layouts[not np.isnan(numbers[2]).all()]
        return SensedState(
            stamp_bytes(newest), newest, list(self._names), numbers.ravel().copy(), layout)
