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
        new = _LayoutDecoder()
        state = new.learn(data)
        if new.layout is not None:
            self._known = [new, *self._known[:MOST_LAYOUTS - 1]]
        return state


class _LayoutDecoder:
    """Reads messages of one layout."""

    def __init__(self) -> None:
        self._names: list[str] = []
        self._known: list[tuple[int, int, bytes]] = []
        self._length = self._start = self._number_count = 0
        self.layout: Layout | None = None
        """None until it is learned; the layout of another encapsulation is never learned."""
        self._skeleton = struct.Struct('')
        self._bones: list[bytes] = []

    def decode(self, data: bytes) -> SensedState | None:
        """Return the content of a message of this layout, None for another layout."""
        layout = self.layout
        if layout is None or len(data) != self._length or data[:4] != ENCAPSULATION:
            return None
        sec, nanosec, *fixed_bytes = self._skeleton.unpack(data)
        if fixed_bytes != self._bones and not self._has_known_bones(data):
            return None
        return SensedState(
            data[STAMP], NANOSECONDS_PER_SECOND * sec + nanosec, self._names,
            np.frombuffer(data, _FLOAT64, self._number_count, self._start), layout)

    def _has_known_bones(self, data: bytes) -> bool:
        """Return whether all but stamp and numbers is unchanged; padding may have any value."""
        if not all(data[start:end] == known for start, end, known in self._known):
            return False
        _, _, *self._bones = self._skeleton.unpack(data)
        return True

    # ------------------------------------------------------------------ any message

    def learn(self, data: bytes) -> SensedState:
        """Learn the layout of a message; raise UnreadableMessageError."""
        message = read_message(data, JointState)
        if data[:4] == ENCAPSULATION:
            self._known = [(0, 4, ENCAPSULATION)]
            end = self._learn_names(data, message)
            self._learn_numbers(data, message, end)
            self._names = list(message.name)
        stamp = message.header.stamp
        fields = message.position, message.velocity, message.effort
        p, v, _ = (len(values) for values in fields)
        return SensedState(
            _SEC_NANOSEC.pack(stamp.sec, stamp.nanosec),
            NANOSECONDS_PER_SECOND * stamp.sec + stamp.nanosec,
            list(message.name), np.concatenate([np.array(values) for values in fields]),
            Layout(slice(0, p), slice(p, p + v), slice(p + v, None)))

    def _learn_names(self, data: bytes, message: JointState) -> int:
        """Store the texts; return the position of their end."""
        end = self._take_text(data, 12)
        self._known.append((end, end + 4, struct.pack('<I', len(message.name))))
        end += 4
        for _ in message.name:
            end = self._take_text(data, end)
        return end

    def _take_text(self, data: bytes, start: int) -> int:
        """Store a string and its length; return the position of the next one."""
        (length,) = struct.unpack_from('<I', data, start)
        end = start + 4 + int(length)
        self._known.append((start, end, data[start:end]))
        return end + -end % 4

    def _learn_numbers(self, data: bytes, message: JointState, names_end: int) -> None:
        """Find the numbers; positions are in bytes from the start of the encapsulation."""
        end, places = names_end, []
        for values in (message.position, message.velocity, message.effort):
            self._known.append((end, end + 4, struct.pack('<I', len(values))))
            start = end + 4
            if len(values):
                start += (4 - start) % 8  # alignment counts from the end of the encapsulation
            end = start + 8 * len(values)
            places.append((start, end))
        first = names_end + 4
        first += (4 - first) % 8
        self._length, self._start = len(data), first
        self._number_count = max(end - first, 0) // 8
        position, velocity, effort = (
            slice((start - first) // 8, (end - first) // 8) if end > start else slice(0, 0)
            for start, end in places)
        self.layout = Layout(position, velocity, effort)
        self._skeleton = _skeleton(places, len(data))
        _, _, *self._bones = self._skeleton.unpack(data)


def _skeleton(left_out: Sequence[tuple[int, int]], length: int) -> struct.Struct:
    """Return a Struct that unpacks the stamp and all later bytes except these ranges."""
    parts, end = [f'<{STAMP.start}xiI'], STAMP.stop
    for start, stop in left_out:
        parts.append(f'{start - end}s{stop - start}x')
        end = stop
    return struct.Struct(''.join(parts) + f'{length - end}s')


class CdrWriter:
    """
    Serializes the parts of messages.

    rclpy's `serialize_message` leaves undefined bytes between strings and after the end, which
    strict readers reject.
    """

    def __init__(self) -> None:
        self.data = bytearray(ENCAPSULATION)

    def align(self, size: int) -> None:
        """Pad with zeros to a multiple of the size, counted from the end of the encapsulation."""
        self.data += bytes((len(ENCAPSULATION) - len(self.data)) % size)

    def uint32(self, value: int) -> None:
        """Write a number, or a count."""
        self.align(4)
        self.data += struct.pack('<I', value)

    def text(self, value: str) -> None:
        """Write a string."""
        encoded = value.encode() + b'\0'
        self.uint32(len(encoded))
        self.data += encoded

    def floats(self, n: int) -> slice:
        """Write a sequence of n zeros as float64; return their position."""
        self.uint32(n)
        return self.numbers(n)

    def numbers(self, n: int) -> slice:
        """Write n zeros as float64; return their position."""
        if n:
            self.align(8)
        self.data += bytes(8 * n)
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


def effort_template(joint_names: Sequence[str]) -> MessageTemplate:
    """Return the template of a `sensor_msgs/JointState` with efforts only."""
    return state_template(joint_names, has_motion=False)


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


def _begun(joint_names: Sequence[str]) -> CdrWriter:
    """Return a message that begins with a header and joint names."""
    writer = CdrWriter()
    writer.data += bytes(8)  # header.stamp
    writer.text('')  # header.frame_id
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
