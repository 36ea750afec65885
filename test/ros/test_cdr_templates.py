# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Serialized joint states that are read or written with templates agree with rclpy.

Any bytes of a message are decoded, or rejected with one error type, in short time.
"""

import struct
from typing import Any

from builtin_interfaces.msg import Time
from damaged_bytes import cut_short, noise, with_lies, with_noise
from geometry_msgs.msg import WrenchStamped
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from robot_dynamics.model.arm_dynamics import EffortTerms
from robot_dynamics.ros.middleware import cdr_templates
from robot_dynamics.ros.middleware.conversions import terms_to_ros
from robot_dynamics.ros.middleware.message_bytes import read_message, UnreadableMessageError
from robot_dynamics_interfaces.msg import DynamicsTerms
from rosbags.typesys import get_typestore, Stores
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NUMBERS = st.floats(width=64)
TEXT = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=9)
STATES = st.builds(
    lambda frame, names, q, v, e, sec, nanosec: state(frame, names, q, v, e, sec, nanosec),
    TEXT, st.lists(TEXT, max_size=5), *[st.lists(NUMBERS, max_size=5)] * 3,
    st.integers(-2**31, 2**31 - 1), st.integers(0, 2**32 - 1))


def state(
    frame: str, names: list[str], q: list[float], v: list[float], e: list[float],
    sec: int = 1, nanosec: int = 2,
) -> JointState:
    message = JointState(name=names, position=q, velocity=v, effort=e)
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = sec, nanosec
    return message


def check(read: cdr_templates.SensedState, message: JointState) -> None:
    stamp = message.header.stamp
    assert read.stamp_ns == 1_000_000_000 * stamp.sec + stamp.nanosec
    assert read.stamp == serialize_message(message)[4:12]
    assert read.name == list(message.name)
    for values, wanted in ((read.position, message.position), (read.velocity, message.velocity),
                           (read.effort, message.effort)):
        assert np.array_equal(values, np.array(wanted), equal_nan=True)


@settings(max_examples=100)
@given(messages=st.lists(STATES, min_size=1, max_size=4), order=st.lists(st.integers(0, 3)))
def test_states_are_read_as_rclpy_reads_them(messages, order):
    """For any sequence of layouts, including repetitions of earlier ones."""
    decoder = cdr_templates.JointStateDecoder()
    for i in [0, 0, *order]:
        message = messages[i % len(messages)]
        check(decoder.decode(serialize_message(message)), message)


def test_what_pads_the_names_may_be_anything():
    message = state('base', ['a', 'bcd', 'ef'], [1.0, 2.0, 3.0], [], [4.0])
    data = serialize_message(message)
    decoder = cdr_templates.JointStateDecoder()
    decoder.decode(data)
    # 'base\0' from 16 on, padded from 21 to 24; 'a\0' from 32 on, padded from 34 to 36
    dirty = data[:21] + b'xyz' + data[24:34] + b'??' + data[36:]
    for _ in range(2):
        check(decoder.decode(dirty), message)
    check(decoder.decode(data), message)


def test_other_names_of_the_same_lengths_are_seen_and_a_stored_state_does_not_change():
    decoder, read = cdr_templates.JointStateDecoder(), []
    messages = [state('', names, [float(i), 2.0], [], []) for i, names in enumerate(
        (['left', 'lift'], ['left', 'lifT'], ['left', 'lift'], ['left', 'lift']))]
    for message in messages:
        read.append(decoder.decode(serialize_message(message)))
    for one, message in zip(read, messages):
        check(one, message)


def test_bytes_that_end_early_are_left_to_rclpy():
    whole = serialize_message(state('base', ['a', 'b'], [1.0, 2.0], [3.0, 4.0], [5.0, 6.0]))
    for end in range(len(whole)):
        decoder = cdr_templates.JointStateDecoder()
        decoder.decode(whole)
        assert outcome(decoder.decode, whole[:end]) == outcome(
            lambda data: deserialize_message(data, JointState), whole[:end])
        check(decoder.decode(whole), deserialize_message(whole, JointState))


def outcome(read: Any, data: bytes) -> Any:
    """Return the positions that were read, or None if they cannot be read."""
    try:
        return list(read(data).position)
    except Exception:
        return None


@pytest.mark.parametrize('n', [1, 7])
def test_efforts_motions_and_terms_are_written_as_rclpy_writes_them(n):
    names = ['joint' + 'x' * i for i in range(n)]  # with any number of padding bytes
    named = cdr_templates.state_template(names, has_motion=False)
    bare = cdr_templates.array_template(n)
    strict = get_typestore(Stores.ROS2_JAZZY)  # rejects data with extra bytes
    for shift in (0.0, 0.5):
        stamp = state('', [], [], [], [], 2**31 - 1, 999_999_999)
        efforts = np.arange(n) - shift
        data = named.filled(serialize_message(stamp)[4:12], efforts)
        message = deserialize_message(data, JointState)
        assert message.header.stamp == stamp.header.stamp
        assert list(message.name) == names
        assert list(message.effort) == efforts.tolist()
        assert not message.position
        assert not message.header.frame_id
        assert strict.deserialize_cdr(data, 'sensor_msgs/msg/JointState').name == names
        strict.deserialize_cdr(bare.filled(bytes(8), efforts), 'std_msgs/msg/Float64MultiArray')
        array = deserialize_message(bare.filled(bytes(8), efforts), Float64MultiArray)
        assert list(array.data) == efforts.tolist()
    q, v = np.arange(2.0 * n).reshape(2, n) - 0.5
    data = cdr_templates.state_template(names, has_effort=False).filled(bytes(8), q, v)
    message = deserialize_message(data, JointState)
    assert message == state('', names, q.tolist(), v.tolist(), [], 0, 0)
    read = strict.deserialize_cdr(data, 'sensor_msgs/msg/JointState')
    assert list(read.velocity) == v.tolist()
    terms = EffortTerms(*np.arange(6.0 * n).reshape(6, n), 1.5, -2.5)
    data = cdr_templates.terms_template(names).filled(bytes(8), *terms[:6], np.array(terms[6:]))
    assert deserialize_message(data, DynamicsTerms) == terms_to_ros(terms, names, Time())


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
