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
SENTINEL = -1.2345678901234567e-89


class SerializedStamp(NamedTuple):
    """A time of ROS: its bytes, and [ns]."""

    data: bytes
    nanoseconds: int


def serialized_stamp(data: bytes) -> SerializedStamp:
    """Return the stamp that these 8 bytes are."""
    sec, nanosec = struct.unpack('<iI', data)
    return SerializedStamp(data, 1_000_000_000 * sec + nanosec)


class SensedState(NamedTuple):
    """What a joint state says: arrays as long as the message has them, often empty."""

    stamp: SerializedStamp
    name: list[str]
    position: FloatArray
    velocity: FloatArray
    effort: FloatArray


class JointStateDecoder:
    """Reads serialized `sensor_msgs/JointState` of any layout, that of the one before quickly."""

    def __init__(self) -> None:
        self._names: list[str] = []
        self._end = 0
        self._texts: list[tuple[int, int, bytes]] = []
        self._region = b''

    def decode(self, data: bytes) -> SensedState:
        """Return what a message says; raise UnreadableMessageError."""
        if not self._is_known(data):
            return self._learn(data)
        try:
            end = self._end
            position, end = _doubles(data, end)
            velocity, end = _doubles(data, end)
            effort, end = _doubles(data, end)
        except (struct.error, ValueError):  # ends too early: let rclpy judge
            return self._learn(data)
        return SensedState(
            serialized_stamp(data[STAMP]), self._names, position, velocity, effort)

    def _is_known(self, data: bytes) -> bool:
        """Tell whether frame and names are those of before; what pads them may be anything."""
        if data[12:self._end] == self._region:
            return bool(self._region) and data[:4] == ENCAPSULATION
        if not self._texts or data[:4] != ENCAPSULATION or not all(
                data[start:end] == text for start, end, text in self._texts):
            return False
        self._region = data[12:self._end]
        return True

    def _learn(self, data: bytes) -> SensedState:
        message = read_message(data, JointState)
        self._texts, self._region = [], b''
        if data[:4] == ENCAPSULATION:
            end = self._take_text(data, 12)
            self._texts.append((end, end + 4, struct.pack('<I', len(message.name))))
            end += 4
            for _ in message.name:
                end = self._take_text(data, end)
            self._names, self._end = list(message.name), end
        stamp = message.header.stamp
        return SensedState(
            serialized_stamp(struct.pack('<iI', stamp.sec, stamp.nanosec)), list(message.name),
            *(np.array(values, dtype=np.float64) for values in (
                message.position, message.velocity, message.effort)))

    def _take_text(self, data: bytes, start: int) -> int:
        """Remember a string and its length; return where the next one begins."""
        (length,) = struct.unpack_from('<I', data, start)
        end = start + 4 + int(length)
        self._texts.append((start, end, data[start:end]))
        return end + -end % 4


def _doubles(data: bytes, start: int) -> tuple[FloatArray, int]:
    """Return a sequence of float64 that begins at `start`, and where it ends."""
    (count,) = struct.unpack_from('<I', data, start)
    start += 4
    if count:
        start += (4 - start) % 8  # alignment counts from the end of the encapsulation
    return np.frombuffer(data, np.float64, count, start), start + 8 * count


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
