# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Serialized joint states that are read or written with templates agree with rclpy."""

from typing import Any

from builtin_interfaces.msg import Time
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from robot_dynamics.model.arm_dynamics import EffortTerms
from robot_dynamics.ros.middleware import cdr_templates
from robot_dynamics.ros.middleware.conversions import terms_to_ros
from robot_dynamics_interfaces.msg import DynamicsTerms
from rosbags.typesys import get_typestore, Stores
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

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
