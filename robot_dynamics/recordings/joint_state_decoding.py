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
Joint states out of their bytes, many messages at once.

Joint states of one publisher have the same names at the same places, so that the messages stack
into a table of bytes out of which whole columns of numbers are read; only one message of each
layout is taken apart step by step. The layout is that of plain CDR (OMG DDS-XTypes 1.3, section
7.4.1) in either order of bytes: after 4 bytes of encapsulation, every value is aligned to its
size; strings and sequences begin with their length as uint32.
"""

from collections.abc import Sequence
import struct
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.validation import FloatArray

IntArray = npt.NDArray[np.int64]
NANOSECONDS_PER_SECOND = 1_000_000_000
FIELDS = ('position', 'velocity', 'effort')

_HEAD = 4
_STAMP = 4
_FRAME = 12
_LARGEST_COUNT = 10_000
"""Joints in a message; more are noise."""


class JointStateBlock(NamedTuple):
    """
    Messages of one layout: k of them, with the same n joints.

    `rows` (k,) are their places among all messages, `stamps_ns` (k,) their header stamps. Each of
    the others is (k, n), or None where the messages do not have one value for each joint.
    """

    rows: npt.NDArray[np.intp]
    joint_names: tuple[str, ...]
    stamps_ns: IntArray
    position: FloatArray | None
    velocity: FloatArray | None
    effort: FloatArray | None


class DecodedJointStates(NamedTuple):
    """The messages by layout, and the places (k,) of those that cannot be read."""

    blocks: tuple[JointStateBlock, ...]
    unreadable: npt.NDArray[np.intp]


def decode_joint_states(messages: Sequence[bytes]) -> DecodedJointStates:
    """Return what serialized messages of sensor_msgs/msg/JointState say; bad ones are counted."""
    blocks: list[JointStateBlock] = []
    unreadable: list[int] = []
    lengths = np.fromiter(map(len, messages), dtype=np.int64, count=len(messages))
    for length in np.unique(lengths):
        rows = np.flatnonzero(lengths == length)
        together = b''.join([messages[row] for row in rows.tolist()])
        table = np.frombuffer(together, np.uint8).reshape(len(rows), int(length))
        while len(rows):
            try:
                layout = _read_layout(messages[int(rows[0])])
            except _UnreadableError:
                alike = _same_bytes(table)
                unreadable += rows[alike].tolist()
            else:
                alike = layout.fits(table)
                blocks.append(layout.read(rows[alike], table[alike]))
            rows, table = rows[~alike], table[~alike]
    return DecodedJointStates(tuple(blocks), np.array(sorted(unreadable), dtype=np.intp))


class _UnreadableError(Exception):
    """These bytes are no joint state."""


class _Layout(NamedTuple):
    """Where the numbers of a message are; `fixed` are the bytes that say so, by their places."""

    order: str
    names: tuple[str, ...]
    places: tuple[tuple[int, int], ...]
    fixed: npt.NDArray[np.intp]
    values: npt.NDArray[np.uint8]

    def fits(self, table: npt.NDArray[np.uint8]) -> npt.NDArray[np.bool_]:
        """Return which messages, one a row, have this layout; padding may be anything."""
        return np.asarray((table[:, self.fixed] == self.values).all(axis=1))

    def read(
        self, rows: npt.NDArray[np.intp], table: npt.NDArray[np.uint8],
    ) -> JointStateBlock:
        def numbers(start: int, count: int, kind: str, size: int) -> npt.NDArray[np.generic]:
            part = np.ascontiguousarray(table[:, start:start + size * count])
            return part.view(self.order + kind).reshape(len(table), count)

        sec = numbers(_STAMP, 1, 'i4', 4)[:, 0].astype(np.int64)
        nanosec = numbers(_STAMP + 4, 1, 'u4', 4)[:, 0].astype(np.int64)
        n = len(self.names)
        values = [
            numbers(start, n, 'f8', 8).astype(np.float64) if count == n and n else None
            for start, count in self.places]
        return JointStateBlock(
            rows, self.names, sec * NANOSECONDS_PER_SECOND + nanosec, *values)


def _same_bytes(table: npt.NDArray[np.uint8]) -> npt.NDArray[np.bool_]:
    """Return which rows have the first one's bytes; that one at least."""
    return np.asarray((table == table[0]).all(axis=1))


class _Cursor:
    """Takes a message apart, and remembers the bytes that tell its layout."""

    def __init__(self, data: bytes, order: str) -> None:
        self.data, self.order, self.at = data, order, _FRAME
        self.fixed: list[int] = list(range(_HEAD))

    def count(self) -> int:
        self.at += -self.at % 4
        if self.at + 4 > len(self.data):
            raise _UnreadableError
        (value,) = struct.unpack_from(f'{self.order}I', self.data, self.at)
        self.fixed += range(self.at, self.at + 4)
        self.at += 4
        return int(value)

    def text(self, is_fixed: bool = True) -> str:
        length = self.count()
        raw = self.data[self.at:self.at + length]
        if len(raw) != length:
            raise _UnreadableError
        if is_fixed:
            self.fixed += range(self.at, self.at + length)
        self.at += length
        try:
            return raw.rstrip(b'\0').decode()
        except UnicodeDecodeError:
            raise _UnreadableError from None

    def floats(self) -> tuple[int, int]:
        """Return where a sequence of float64 begins, and how many they are."""
        count = self.count()
        if count:
            self.at += (_HEAD - self.at) % 8
        start = self.at
        if count > _LARGEST_COUNT or start + 8 * count > len(self.data):
            raise _UnreadableError
        self.at += 8 * count
        return start, count


def _read_layout(data: bytes) -> _Layout:
    if len(data) < _FRAME or data[0] != 0 or data[1] > 1:  # plain CDR, big or little endian
        raise _UnreadableError
    cursor = _Cursor(data, '<' if data[1] else '>')
    cursor.text(is_fixed=False)  # the frame, of which the length alone matters
    count = cursor.count()
    if count > _LARGEST_COUNT:
        raise _UnreadableError
    names = tuple(cursor.text() for _ in range(count))
    places = tuple(cursor.floats() for _ in FIELDS)
    fixed = np.array(cursor.fixed, dtype=np.intp)
    return _Layout(
        cursor.order, names, places, fixed, np.frombuffer(data, np.uint8)[fixed])
