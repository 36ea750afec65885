# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Messages as bytes, and the rejection of messages before they are deserialized.

rclpy silently ignores bytes that are not a message. While it deserializes a message, no other
thread can run: a trajectory of 100,000 points stops control for 1 s. Therefore messages are
received as bytes, and are checked and deserialized here.

The number of points of a trajectory is read from the bytes with `struct`, not with the typestore
of `rosbags`: the typestore decodes every point, which is the delay that the limit prevents, and
the nodes run without `rosbags`.
"""

from contextlib import suppress
import struct
from typing import Any

from rclpy.serialization import deserialize_message
from robot_dynamics.exceptions import InvalidInputError
from trajectory_msgs.msg import JointTrajectory

LARGEST_MESSAGE = 1_000_000
"""[bytes]; the slowest such message, with empty names only, takes 30 ms."""
MOST_POINTS = 2000
"""Points of a trajectory; their deserialization takes 20 ms."""
ENCAPSULATION = 4
"""[bytes] before the data; the alignment of the data starts after them."""
STAMP = 8
"""Size of a time [bytes]."""


class UnreadableMessageError(InvalidInputError):
    """Bytes that are not a message, or a message too large to be read during control."""


def read_message(data: bytes, message_type: type, largest: int = LARGEST_MESSAGE) -> Any:
    """Return the message of at most `largest` bytes; raise UnreadableMessageError."""
    if len(data) > largest:
        raise UnreadableMessageError(
            f'the message has {len(data)} bytes, expected at most {largest}: larger '
            'messages would delay control')
    if message_type is JointTrajectory:
        with suppress(struct.error):  # too short: rejected below
            if (count := _point_count(data)) > MOST_POINTS:
                raise UnreadableMessageError(
                    f'points has {count} points, expected at most {MOST_POINTS}: more points '
                    'would delay control')
    try:
        return deserialize_message(data, message_type)
    except Exception:  # rclpy gives no reason
        raise UnreadableMessageError(
            f'the message of {len(data)} bytes cannot be read, expected a serialized '
            f'{message_type.__name__}') from None


def _point_count(data: bytes) -> int:
    """
    Return the number of points that a serialized JointTrajectory states.

    Source: OMG, Common Object Request Broker Architecture 3.4, part 2, section 9.3 (CDR): numbers
    are aligned to their size, and a count of four bytes precedes each string and sequence.
    """
    word = struct.Struct('<I' if data[1:2] == b'\x01' else '>I')

    def count_at(at: int) -> tuple[int, int]:
        at += -(at - ENCAPSULATION) % word.size
        return int(word.unpack_from(data, at)[0]), at + word.size

    length, at = count_at(ENCAPSULATION + STAMP)
    names, at = count_at(at + length)  # after header.frame_id
    for _ in range(names):
        length, at = count_at(at)
        at += length
    return count_at(at)[0]
