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
Many serialized messages of one layout at once, plain CDR, little endian.

The messages are rows of a table of bytes: what is the same in all of them is written once, and
stamps and numbers are columns. `joint_state_bytes` is the way back.
"""

from collections.abc import Sequence
import struct

import numpy as np
import numpy.typing as npt
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.recordings.joint_state_decoding import IntArray, NANOSECONDS_PER_SECOND
from robot_dynamics.validation import FloatArray

DYNAMICS_TERMS = 'robot_dynamics_interfaces/msg/DynamicsTerms'
DYNAMICS_TERMS_TEXT = """std_msgs/Header header
string[] joint_names
float64[] inertial
float64[] coriolis
float64[] gravity
float64[] friction
float64[] external
float64[] effort
float64 kinetic_energy
float64 potential_energy
"""
"""The definition of the type, for recordings that are written where it is not installed."""


class _Table:
    """Serialized messages, a row each, as far as they are written."""

    def __init__(self, count: int) -> None:
        self._parts: list[npt.NDArray[np.uint8]] = []
        self._count, self._length = count, 0
        self.same(b'\x00\x01\x00\x00')

    def same(self, data: bytes) -> None:
        """Write what all messages have."""
        self._parts.append(np.broadcast_to(
            np.frombuffer(data, np.uint8), (self._count, len(data))))
        self._length += len(data)

    def column(self, values: npt.NDArray[np.generic]) -> None:
        """Write numbers of each message, (m, k), aligned to their size."""
        self._align(values.dtype.itemsize)
        rows = np.ascontiguousarray(values).view(np.uint8).reshape(self._count, -1)
        self._parts.append(rows)
        self._length += rows.shape[1]

    def texts(self, texts: Sequence[str]) -> None:
        self._length_of(len(texts))
        for text in texts:
            self.text(text)

    def text(self, text: str) -> None:
        data = text.encode() + b'\0'
        self._length_of(len(data))
        self.same(data)

    def header(self, stamps_ns: IntArray) -> None:
        """Write a std_msgs/Header without a frame."""
        self.column((stamps_ns // NANOSECONDS_PER_SECOND).astype('<i4')[:, None])
        self.column((stamps_ns % NANOSECONDS_PER_SECOND).astype('<u4')[:, None])
        self.text('')

    def floats(self, values: FloatArray) -> None:
        """Write a sequence of float64 of each message, (m, n)."""
        self._length_of(values.shape[1])
        if values.shape[1]:
            self.column(values.astype('<f8'))

    def rows(self) -> list[bytes]:
        table = np.concatenate(self._parts, axis=1)
        return [row.tobytes() for row in table]

    def _align(self, size: int) -> None:
        self.same(bytes(-(self._length - 4) % size))

    def _length_of(self, count: int) -> None:
        self._align(4)
        self.same(struct.pack('<I', count))


def joint_state_messages(
    stamps_ns: IntArray, joint_names: Sequence[str], position: FloatArray | None = None,
    velocity: FloatArray | None = None, effort: FloatArray | None = None,
) -> list[bytes]:
    """Return m messages of sensor_msgs/msg/JointState; arrays are (m, n), or None for no field."""
    m = len(stamps_ns)
    table = _Table(m)
    table.header(stamps_ns)
    table.texts(joint_names)
    for values in (position, velocity, effort):
        table.floats(_checked(np.empty((m, 0)) if values is None else values, m))
    return table.rows()


def dynamics_terms_messages(
    stamps_ns: IntArray, joint_names: Sequence[str], terms: Sequence[FloatArray],
    kinetic_energy: FloatArray, potential_energy: FloatArray,
) -> list[bytes]:
    """
    Return m messages of robot_dynamics_interfaces/msg/DynamicsTerms.

    `terms` are inertial, coriolis, gravity, friction, external and effort, each (m, n); energies
    are (m,) [J].
    """
    m = len(stamps_ns)
    table = _Table(m)
    table.header(stamps_ns)
    table.texts(joint_names)
    for values in terms:
        table.floats(_checked(values, m))
    for energy in (kinetic_energy, potential_energy):
        table.column(energy.astype('<f8')[:, None])
    return table.rows()


def _checked(values: FloatArray, m: int) -> FloatArray:
    if values.ndim != 2 or len(values) != m:
        raise InvalidInputError(
            f'values have the shape {values.shape}, expected ({m}, n), one row a stamp')
    return values
