# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Joint states and efforts as bytes, for the control path and the simulated arm.

In rclpy, the construction and conversion of one `JointState` object take longer than the dynamics
of an arm, because of checked setters, lists of strings and element-wise copies. But a publisher of
joint states sends the same names at the same position in each message. Therefore the decoder
deserializes the first message of a layout with rclpy and stores the layout. Numpy reads the
numbers of the following messages in place. A published message is serialized once; then only its
stamp and its numbers are replaced. rclpy deserializes messages of any other layout.

Outside these paths, the typestore of `rosbags` decodes and encodes messages. It is not used
here, because it constructs one object per message as rclpy does, and the nodes do not need
`rosbags`.

The layout is CDR, little endian (OMG DDS-XTypes 7.4.1): after 4 bytes of encapsulation,
each value is aligned to its size; strings and sequences begin with their length as uint32.
"""

from collections.abc import Sequence
import struct
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.ros.middleware.message_bytes import read_message
from sensor_msgs.msg import JointState

ENCAPSULATION = b'\x00\x01\x00\x00'
"""Plain CDR, little endian, no options."""
STAMP = slice(4, 12)
"""Position of the stamp in a message that begins with a std_msgs/Header."""
_SEC_NANOSEC = struct.Struct('<iI')
_FLOAT64 = np.dtype(np.float64)
MOST_LAYOUTS = 8
"""Layouts that a decoder stores, one per publisher on a topic."""


class Layout(NamedTuple):
    """
    Positions of the numbers of a message, as indices of float64 from the first number on.

    They are in one row: positions, velocities and efforts, possibly with other bytes between
    them. One object stands for one layout with its names and its `frame_id`.
    """

    position: slice
    velocity: slice
    effort: slice


class SensedState(NamedTuple):
    """
    The content of a joint state: all numbers in one row, and their positions in it.

    `stamp` is the stamp of the header as bytes, `stamp_ns` in ns.
    """

    stamp: bytes
    stamp_ns: int
    name: list[str]
    numbers: FloatArray
    layout: Layout

    @property
    def position(self) -> FloatArray:
        """Return the positions, as many as the message has."""
        return self.numbers[self.layout.position]

    @property
    def velocity(self) -> FloatArray:
        """Return the velocities, as many as the message has."""
        return self.numbers[self.layout.velocity]

    @property
    def effort(self) -> FloatArray:
        """Return the efforts, as many as the message has."""
        return self.numbers[self.layout.effort]


class JointStateDecoder:
    """Reads serialized `sensor_msgs/JointState` of any layout; known layouts are fast."""

    def __init__(self) -> None:
        self._known: list[_LayoutDecoder] = []

    def decode(self, data: bytes) -> SensedState:
        """Return the content of a message; raise UnreadableMessageError."""
        for known in self._known:
            state = known.decode(data)
            if state is not None:
                return state
        message = read_message(data, JointState)
        new = _LayoutDecoder(message, len(data))
        state = new.decode(data)
        if state is None:  # another encapsulation, or texts in another form
            return _converted(message)
        self._known = [new, *self._known[:MOST_LAYOUTS - 1]]
        return state


class _LayoutDecoder:
    """Reads messages of one layout: only stamp, numbers and padding differ from the first one."""

    def __init__(self, message: JointState, length: int) -> None:
        """Learn the layout of a message of `length` bytes."""
        self._names, self._length = list(message.name), length
        writer = _begun(self._names, message.header.frame_id)
        places = [writer.floats(len(values)) for values in _fields(message)]
        self._mask = int.from_bytes(writer.mask, 'little')
        self._fixed = int.from_bytes(writer.data, 'little')
        first = places[0].start
        first += (len(ENCAPSULATION) - first) % _FLOAT64.itemsize
        self._start, self._layout = first, Layout(*(
            slice((place.start - first) // 8, (place.stop - first) // 8)
            if place.start < place.stop else slice(0, 0) for place in places))
        self._number_count = max(field.stop for field in self._layout)

    def decode(self, data: bytes) -> SensedState | None:
        """Return the content of a message of this layout, None for another layout."""
        if len(data) != self._length or (
                int.from_bytes(data, 'little') & self._mask != self._fixed):
            return None
        stamp = data[STAMP]
        sec, nanosec = _SEC_NANOSEC.unpack(stamp)
        return SensedState(
            stamp, NANOSECONDS_PER_SECOND * sec + nanosec, self._names,
            np.frombuffer(data, _FLOAT64, self._number_count, self._start), self._layout)


def _fields(message: JointState) -> tuple[Sequence[float], Sequence[float], Sequence[float]]:
    return message.position, message.velocity, message.effort


def _converted(message: JointState) -> SensedState:
    """Return the content of a message that rclpy has read."""
    stamp, p, v = message.header.stamp, len(message.position), len(message.velocity)
    return SensedState(
        _SEC_NANOSEC.pack(stamp.sec, stamp.nanosec),
        NANOSECONDS_PER_SECOND * stamp.sec + stamp.nanosec,
        list(message.name), np.concatenate([np.array(values) for values in _fields(message)]),
        Layout(slice(0, p), slice(p, p + v), slice(p + v, None)))


class CdrWriter:
    """
    Serializes the parts of messages, and marks the bytes of texts and counts.

    rclpy's `serialize_message` leaves undefined bytes between strings and after the end, which
    strict readers reject.
    """

    def __init__(self) -> None:
        self.data, self.mask = bytearray(), bytearray()
        """The message, and of each of its bytes 255, or 0 for stamp, numbers and padding."""
        self._add(ENCAPSULATION)

    def _add(self, content: bytes, mark: int = 255) -> None:
        self.data += content
        self.mask += bytes([mark]) * len(content)

    def zeros(self, count: int) -> None:
        """Write bytes without a mark."""
        self._add(bytes(count), 0)

    def align(self, size: int) -> None:
        """Pad with zeros to a multiple of the size, counted from the end of the encapsulation."""
        self.zeros((len(ENCAPSULATION) - len(self.data)) % size)

    def uint32(self, value: int) -> None:
        """Write a number, or a count."""
        self.align(4)
        self._add(struct.pack('<I', value))

    def text(self, value: str) -> None:
        """Write a string."""
        encoded = value.encode() + b'\0'
        self.uint32(len(encoded))
        self._add(encoded)

    def floats(self, n: int) -> slice:
        """Write a sequence of n zeros as float64; return their position."""
        self.uint32(n)
        return self.numbers(n)

    def numbers(self, n: int) -> slice:
        """Write n zeros as float64; return their position."""
        if n:
            self.align(8)
        self.zeros(8 * n)
        return slice(len(self.data) - 8 * n, len(self.data))


class MessageTemplate:
    """A serialized message whose numbers and stamp can be replaced."""

    def __init__(self, data: bytearray, places: Sequence[slice], has_stamp: bool = True) -> None:
        """Store the positions of the numbers, and whether the message begins with a stamp."""
        self._data, self._has_stamp = data, has_stamp
        self._places = places

    def filled(self, stamp: bytes, *numbers: FloatArray) -> bytes:
        """Return the message with these numbers, as many as each position has, and this stamp."""
        data = self._data
        if self._has_stamp:
            data[STAMP] = stamp
        for place, values in zip(self._places, numbers):
            data[place] = values.tobytes()
        return bytes(data)


def state_template(
    joint_names: Sequence[str], has_motion: bool = True, has_effort: bool = True,
) -> MessageTemplate:
    """Return the template of a `sensor_msgs/JointState`; its numbers are in message order."""
    n, writer = len(joint_names), _begun(joint_names)
    places = [  # position, velocity, effort
        writer.floats(n if is_there else 0) for is_there in (has_motion, has_motion, has_effort)]
    return MessageTemplate(writer.data, [place for place in places if place.start < place.stop])


def terms_template(joint_names: Sequence[str]) -> MessageTemplate:
    """
    Return the template of a `robot_dynamics_interfaces/DynamicsTerms`.

    Its numbers are the six efforts (n,) in message order, and both energies (2,).
    """
    n, writer = len(joint_names), _begun(joint_names)
    places = [writer.floats(n) for _ in range(6)]
    return MessageTemplate(writer.data, [*places, writer.numbers(2)])


def _begun(joint_names: Sequence[str], frame_id: str = '') -> CdrWriter:
    """Return a message that begins with a header and joint names."""
    writer = CdrWriter()
    writer.zeros(STAMP.stop - STAMP.start)
    writer.text(frame_id)
    writer.uint32(len(joint_names))
    for name in joint_names:
        writer.text(name)
    return writer


def array_template(n: int) -> MessageTemplate:
    """Return the template of a `std_msgs/Float64MultiArray` of n numbers, without a layout."""
    writer = CdrWriter()
    writer.uint32(0)  # layout.dim
    writer.uint32(0)  # layout.data_offset
    return MessageTemplate(writer.data, [writer.floats(n)], has_stamp=False)


def stamp_bytes(nanoseconds: int) -> bytes:
    """Return the 8 bytes of a ROS time."""
    return _SEC_NANOSEC.pack(*divmod(nanoseconds, NANOSECONDS_PER_SECOND))
