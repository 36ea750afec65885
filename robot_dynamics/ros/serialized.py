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
Joint states and efforts as bytes, for the control path.

In rclpy, making one `JointState` object and converting it costs more than the dynamics of an arm:
checked setters, lists of strings, copies number by number. But a publisher of joint states sends
the same names in the same place every time, and so do we. So the first message of a layout is
deserialized as usual and its layout is learned; from those that follow numpy reads the numbers
where they lie. What is published is a message that was serialized once, with the stamp and the
numbers of now written into it. Messages of any other layout take the usual way.

The layout is that of CDR, little endian (OMG DDS-XTypes 7.4.1): after 4 bytes of encapsulation,
each value is aligned to its size; strings and sequences begin with their length as uint32.
"""

from collections.abc import Callable, Sequence
import struct
from typing import Any, NamedTuple

import numpy as np
from rclpy.serialization import serialize_message
from robot_dynamics.ros.message_bytes import read_message
from robot_dynamics.validation import FloatArray
from sensor_msgs.msg import JointState

ENCAPSULATION = b'\x00\x01\x00\x00'
"""Plain CDR, little endian, no options."""
STAMP = slice(4, 12)
"""Where a message that begins with a std_msgs/Header has its stamp."""
_SEC_NANOSEC = struct.Struct('<iI')
SENTINEL = -1.2345678901234567e-89


class SerializedStamp(NamedTuple):
    """A time of ROS: its bytes, and [ns]."""

    data: bytes
    nanoseconds: int


def serialized_stamp(data: bytes) -> SerializedStamp:
    """Return the stamp of a serialized message that begins with a std_msgs/Header."""
    return _make_stamp(data[STAMP], *_SEC_NANOSEC.unpack_from(data, STAMP.start))


def _make_stamp(data: bytes, sec: int, nanosec: int) -> SerializedStamp:
    return SerializedStamp(data, 1_000_000_000 * sec + nanosec)


class Layout(NamedTuple):
    """
    Where the numbers of a message are, counted in float64 from the first on.

    They lie in one row: positions, velocities and efforts, with eight bytes for a count between
    two of them. The same object stands for the same layout, with the same names.
    """

    position: slice
    velocity: slice
    effort: slice


class SensedState(NamedTuple):
    """
    What a joint state says: arrays as long as the message has them, often empty.

    `numbers` are all of them in one row, as `layout` tells; where that is None there is no row.
    """

    stamp: SerializedStamp
    name: list[str]
    position: FloatArray
    velocity: FloatArray
    effort: FloatArray
    numbers: FloatArray = np.empty(0)
    layout: Layout | None = None


class JointStateDecoder:
    """Reads serialized `sensor_msgs/JointState` of any layout, that of the one before quickly."""

    def __init__(self) -> None:
        self._names: list[str] = []
        self._texts: list[tuple[int, int, bytes]] = []
        self._names_end = 0
        self._header = b''
        self._length = self._start = self._number_count = 0
        self._counts: list[tuple[int, int, bytes]] = []
        self._layout: Layout | None = None

    def decode(self, data: bytes) -> SensedState:
        """Return what a message says; raise UnreadableMessageError."""
        layout = self._layout
        if layout is None or len(data) != self._length or (
                data[12:self._names_end] != self._header and not self._has_known_texts(data)) or (
                data[:4] != ENCAPSULATION):
            return self._learn(data)
        for start, end, count in self._counts:
            if data[start:end] != count:
                return self._learn(data)
        numbers = np.frombuffer(data, np.float64, self._number_count, self._start)
        return SensedState(
            serialized_stamp(data), self._names, numbers[layout.position],
            numbers[layout.velocity], numbers[layout.effort], numbers, layout)

    def _has_known_texts(self, data: bytes) -> bool:
        """Tell whether frame and names are those of before; what pads them may be anything."""
        if not all(data[start:end] == text for start, end, text in self._texts):
            return False
        self._header = data[12:self._names_end]
        return True

    # ------------------------------------------------------------------ any message

    def _learn(self, data: bytes) -> SensedState:
        message = read_message(data, JointState)
        self._layout = None
        if data[:4] == ENCAPSULATION:
            self._learn_names(data, message)
            self._learn_numbers(data, message)
        stamp = message.header.stamp
        position, velocity, effort = (np.array(values, dtype=np.float64) for values in (
            message.position, message.velocity, message.effort))
        return SensedState(
            _make_stamp(struct.pack('<iI', stamp.sec, stamp.nanosec), stamp.sec, stamp.nanosec),
            list(message.name), position, velocity, effort)

    def _learn_names(self, data: bytes, message: JointState) -> None:
        self._texts = []
        end = self._take_text(data, 12)
        self._texts.append((end, end + 4, struct.pack('<I', len(message.name))))
        end += 4
        for _ in message.name:
            end = self._take_text(data, end)
        self._names, self._names_end = list(message.name), end
        self._header = data[12:end]

    def _take_text(self, data: bytes, start: int) -> int:
        """Remember a string and its length; return where the next one begins."""
        (length,) = struct.unpack_from('<I', data, start)
        end = start + 4 + int(length)
        self._texts.append((start, end, data[start:end]))
        return end + -end % 4

    def _learn_numbers(self, data: bytes, message: JointState) -> None:
        """Find the numbers, in places counted in bytes from the encapsulation on."""
        end, places, counts = self._names_end, [], []
        for values in (message.position, message.velocity, message.effort):
            counts.append((end, end + 4, struct.pack('<I', len(values))))
            start = end + 4
            if len(values):
                start += (4 - start) % 8  # alignment counts from the end of the encapsulation
            end = start + 8 * len(values)
            places.append((start, end))
        first = self._names_end + 4
        first += (4 - first) % 8
        self._length, self._counts, self._start = len(data), counts, first
        self._number_count = max(end - first, 0) // 8
        self._layout = Layout(*(
            slice((start - first) // 8, (end - first) // 8) if end > start else slice(0, 0)
            for start, end in places))


class EffortTemplate:
    """A serialized message with n numbers, and a stamp where it has a header."""

    def __init__(self, n: int, make: Callable[[list[float]], Any]) -> None:
        """`make` returns the message for a list of n numbers."""
        numbers = [SENTINEL] * n
        message = make(numbers)
        self._has_stamp = hasattr(message, 'header')
        self._data = bytearray(serialize_message(message))
        start = self._data.find(np.array(numbers).tobytes())
        if start < 0 or bytes(self._data[:4]) != ENCAPSULATION:
            raise ValueError(f'no {n} numbers in {bytes(self._data)!r}')
        self._numbers = np.frombuffer(self._data, np.float64, n, start)

    def filled(self, stamp: bytes, numbers: FloatArray) -> bytes:
        """Return the message with these numbers (n,), and this stamp of 8 bytes."""
        if self._has_stamp:
            self._data[STAMP] = stamp
        self._numbers[:] = numbers
        return bytes(self._data)


def effort_template(joint_names: Sequence[str]) -> EffortTemplate:
    """Return the template of a `sensor_msgs/JointState` with efforts alone."""
    return EffortTemplate(
        len(joint_names), lambda numbers: JointState(name=list(joint_names), effort=numbers))
