# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Bytes to messages: any bytes are decoded, or rejected with one error type, in short time."""

import struct
from typing import Any

from damaged_bytes import cut_short, noise, with_lies, with_noise
from geometry_msgs.msg import WrenchStamped
import pytest
from rclpy.serialization import serialize_message
from robot_dynamics.ros.middleware.message_bytes import read_message, UnreadableMessageError
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

POINT = JointTrajectoryPoint(positions=[1.0, 2.0], velocities=[3.0, 4.0])


def trajectory(points: int, frame_id: str = '', names: tuple[str, ...] = ('a', 'b')) -> Any:
    message = JointTrajectory(joint_names=list(names), points=[POINT] * points)
    message.header.frame_id = frame_id
    return message


MESSAGES = [
    JointState(name=['joint1', 'joint2'], position=[0.1, 0.2], effort=[0.3, 0.4]),
    trajectory(2), String(data='<robot name="a"/>'), WrenchStamped()]


def read_or_refuse(data: bytes, message_type: type) -> bool:
    """Return whether bytes were a message; fail at any error other than this module's."""
    try:
        return isinstance(read_message(data, message_type), message_type)
    except UnreadableMessageError:
        return False


@pytest.mark.parametrize('message', MESSAGES, ids=lambda message: type(message).__name__)
def test_damage_is_refused_or_harmless(message):
    data, message_type = bytes(serialize_message(message)), type(message)
    assert read_message(data, message_type) == message
    assert not any(read_or_refuse(cut, message_type) for cut in cut_short(data, message_type))
    for damaged in (*with_lies(data), *with_noise(data, 500), *noise(100), b''):
        read_or_refuse(damaged, message_type)


def test_a_message_that_is_too_large_is_not_read():
    data = serialize_message(JointState(name=['']))
    padded = bytes(data) + bytes(1_000_000 - len(data))
    assert read_message(padded, JointState).name == ['']
    with pytest.raises(UnreadableMessageError, match='1000001 bytes, expected at most 1000000'):
        read_message(padded + b'\0', JointState)
    assert read_message(padded + b'\0', JointState, 1_000_001).name == ['']


@pytest.mark.parametrize(('frame_id', 'names'), [
    ('', ()), ('a', ('',)), ('abc', ('joint1', 'joint2')), ('base_link', ('a', 'abc', 'abcde'))])
def test_a_trajectory_of_too_many_points_is_not_read(frame_id, names):
    message = trajectory(2000, frame_id, names)
    assert read_message(bytes(serialize_message(message)), JointTrajectory) == message
    data = bytes(serialize_message(trajectory(2001, frame_id, names)))
    with pytest.raises(UnreadableMessageError, match='points has 2001 points, expected at most'):
        read_message(data, JointTrajectory)


def test_points_are_counted_in_the_byte_order_of_the_message():
    counts = (0, 0, 2001)  # of frame_id, joint_names and points
    data = b'\x00\x00\x00\x00' + bytes(8) + struct.pack('>3I', *counts)
    with pytest.raises(UnreadableMessageError, match='points has 2001 points'):
        read_message(data, JointTrajectory)
