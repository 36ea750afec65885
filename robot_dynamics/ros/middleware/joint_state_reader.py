# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Read joint states by joint name, fast enough for the control path."""

import sys

import numpy as np
from robot_dynamics.arrays import all_finite, FloatArray, IntArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.ros.middleware.cdr_templates import Layout, SensedState
from robot_dynamics.validation import check_unique, LARGEST_VALUE
from sensor_msgs.msg import JointState

FINITE = sys.float_info.max


class JointStateReader:
    """Finds one arm's joints in `sensor_msgs/JointState` messages, and ignores other joints."""

    def __init__(self, joint_names: tuple[str, ...]) -> None:
        self._joint_names = joint_names
        self._known_names: list[str] | None = None
        self._index: IntArray = np.zeros(0, dtype=np.intp)
        self.layout: Layout | None = None
        """The layout of the last message that was read."""
        self.places: IntArray = np.zeros(0, dtype=np.intp)
        """Indices of positions and velocities of the joints in its numbers."""

    def read(self, message: JointState | SensedState) -> tuple[FloatArray, FloatArray | None]:
        """
        Return position (n,) and velocity (n,), None if a velocity is missing or NaN.

        Velocities of another number than the names are missing.

        Raises InvalidInputError if joints are missing, a name appears twice, lengths differ, or
        another value of these joints is not finite.
        """
        n = len(self._joint_names)
        layout = message.layout if isinstance(message, SensedState) else None
        if layout is not None and layout is self.layout:
            values = message.numbers[self.places]
            if all_finite(values):
                return values[:n], values[n:] if len(values) > n else None
        q = self._values(message, 'position')
        v = None  # `joint_state_broadcaster` sends NaN for a missing interface
        has_velocity = len(message.velocity) == len(message.name)
        if has_velocity and not np.isnan(self._values(message, 'velocity', None)).any():
            v = self._values(message, 'velocity')
        if layout is not None:
            self.layout, self.places = layout, layout.position.start + self._index
            if has_velocity:
                self.places = np.concatenate(
                    (self.places, layout.velocity.start + self._index))
        return q, v

    def effort(self, message: JointState | SensedState) -> FloatArray | None:
        """Return the efforts (n,), NaN for those that are not measured; raise as `read` does."""
        if not len(message.effort):
            return None
        return self._values(message, 'effort', None)

    def finite_effort(self, message: JointState) -> FloatArray:
        """
        Return the efforts (n,), one per joint.

        Raises InvalidInputError as `read` does, and for an effort larger than that of any arm.
        """
        return self._values(message, 'effort', LARGEST_VALUE)

    def drive_command(self, message: JointState | SensedState) -> FloatArray:
        """
        Return position, velocity and effort of a command to drives, (3, n).

        An effort that is missing is 0. Raises InvalidInputError as `finite_effort` does, also if
        there are no velocities: a drive that takes them for 0 brakes the motion.
        """
        if not len(message.velocity):
            raise InvalidInputError('velocity is empty, expected that of the reference')
        q, v = (self._values(message, field, LARGEST_VALUE) for field in ('position', 'velocity'))
        effort = self.finite_effort(message) if len(message.effort) else np.zeros_like(q)
        return np.array([q, v, effort])

    def _learn(self, names: list[str]) -> None:
        """Find the joints; publishers keep their order, so this is done once per publisher."""
        self._known_names = None
        missing = [name for name in self._joint_names if name not in names]
        if missing:
            present = [name for name in self._joint_names if name in names]
            raise InvalidInputError(
                f'name lacks {missing}, expected all of {list(self._joint_names)}; set '
                f'`joints:={present}` if no others are to be commanded')
        check_unique('name', [name for name in names if name in self._joint_names])
        self._index = np.array([names.index(name) for name in self._joint_names], dtype=np.intp)
        self._known_names = list(names)

    def _values(
        self, message: JointState | SensedState, field: str, largest: float | None = FINITE,
    ) -> FloatArray:
        if message.name != self._known_names:
            self._learn(message.name)
        values = getattr(message, field)
        if len(values) != len(message.name):
            raise InvalidInputError(
                f'{field} has {len(values)} values, expected {len(message.name)} as name has')
        used: FloatArray = np.frombuffer(values, dtype=np.float64)[self._index]
        if largest is None or largest == FINITE and all_finite(used):
            return used
        if not (np.abs(used) <= largest).all():  # also if one is NaN
            j = int(np.argmin(np.abs(used) <= largest))
            expected = 'finite number' if largest == FINITE else (
                f'number in [{-largest:g}, {largest:g}]')
            raise InvalidInputError(
                f'{field} of {self._joint_names[j]!r} is {used[j]:g}, expected a {expected}')
        return used
