# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings: written data are read back, by this package and by plain rosbags."""

from collections.abc import Iterator
import os
import signal
import threading

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from recordings import serialized
from robot_dynamics.exceptions import RecordingError
from robot_dynamics_tools.recordings.interrupts import uninterrupted
from robot_dynamics_tools.recordings.joint_series import JointSeries
from robot_dynamics_tools.recordings.messages import joint_state_messages, stamped_messages
from robot_dynamics_tools.recordings.reader import Recording
from robot_dynamics_tools.recordings.topics import DYNAMICS_TERMS, JOINT_STATE, TopicQos
from robot_dynamics_tools.recordings.writer import RecordingWriter

pytest.importorskip('rosbags')
from rosbags.highlevel import AnyReader  # noqa: E402
from rosbags.interfaces import QosDurability, QosReliability  # noqa: E402
from rosbags.rosbag2 import Writer  # noqa: E402
from rosbags.typesys import get_types_from_msg, get_typestore, Stores  # noqa: E402

EFFORTS = ('inertial', 'coriolis', 'gravity', 'friction', 'external', 'effort')


def joint_state(stamp_ns, names, position=(), velocity=(), effort=()):
    """Return a serialized joint state."""
    (data,) = joint_state_messages(
        np.array([stamp_ns]), names, *(
            np.array([values], dtype=float) for values in (position, velocity, effort)))
    return data


def terms(stamp_ns, effort):
    """Return serialized terms, all of which are `effort`."""
    (data,) = stamped_messages(
        DYNAMICS_TERMS, np.array([stamp_ns]), {
            **dict.fromkeys(EFFORTS, np.array([effort])), 'kinetic_energy': np.zeros(1),
            'potential_energy': np.zeros(1)}, joint_names=['a', 'b'])
    return data


def write_states(path, states, topic='/joint_states'):
    """Write joint states (stamp, names, position, velocity, effort) with times 1 ns apart."""
    with RecordingWriter(path) as writer:
        writer.add_topic(topic, JOINT_STATE)
        for i, state in enumerate(states):
            writer.write(topic, 1000 + i, joint_state(*state))
    return path


@pytest.fixture
def recording(tmp_path):
    """Return the path of a recording with one topic of a common type and one of another type."""
    path = tmp_path / 'bag'
    with RecordingWriter(path) as writer:
        writer.add_topic('/joint_states', JOINT_STATE)
        writer.add_topic('/terms', DYNAMICS_TERMS, TopicQos(depth=7, transient_local=True))
        for i in range(5):
            writer.write('/joint_states', 100 + i, joint_state(
                10 + i, ('a', 'b'), (i, -i), (0.5, i), (1.0, 2.0)))
            writer.write('/terms', 100 + i, terms(10 + i, [i, 2.0 * i]))
    return path


def test_rosbags_alone_reads_it(recording):
    # Without a type store: the definitions have to be in the files.
    with AnyReader([recording]) as reader:
        assert {c.topic: c.msgtype for c in reader.connections} == {
            '/joint_states': 'sensor_msgs/msg/JointState',
            '/terms': 'robot_dynamics_interfaces/msg/DynamicsTerms'}
        seen = [(c.topic, t, reader.deserialize(raw, c.msgtype)) for c, t, raw in
                reader.messages()]
        qos = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}
    assert [t for _, t, _ in seen] == sorted([*range(100, 105)] * 2)
    rows = [message for topic, _, message in seen if topic == '/terms']
    assert [message.header.stamp.nanosec for message in rows] == [10, 11, 12, 13, 14]
    np.testing.assert_array_equal(rows[3].effort, [3.0, 6.0])
    assert qos['/terms'].durability == QosDurability.TRANSIENT_LOCAL
    assert qos['/terms'].depth == 7
    assert qos['/joint_states'].durability == QosDurability.VOLATILE
    assert qos['/joint_states'].reliability == QosReliability.RELIABLE


def test_topics_and_metadata_are_those_of_rosbag2(recording):
    text = (recording / 'metadata.yaml').read_text(encoding='utf-8')
    for words in ('storage_identifier: mcap', 'version: 9', 'durability: transient_local'):
        assert words in text
    with Recording(recording) as opened:
        assert [(t.name, t.message_type, t.message_count) for t in opened.topics] == [
            ('/joint_states', 'sensor_msgs/msg/JointState', 5),
            ('/terms', 'robot_dynamics_interfaces/msg/DynamicsTerms', 5)]
        with pytest.raises(RecordingError, match=r"'/nothing'.*'/joint_states', '/terms'"):
            opened.topic('/nothing')


# --- joint series --------------------------------------------------------------------------------

def test_joints_are_matched_by_name(recording):
    with Recording(recording) as opened:
        series = opened.joint_series('/joint_states', ['b', 'a'])
    assert series.joint_names == ('b', 'a')
    np.testing.assert_array_equal(series.position[:, 0], [0, -1, -2, -3, -4])
    np.testing.assert_array_equal(series.effort, [[2.0, 1.0]] * 5)
    turned = series.of_joints(['a'])
    np.testing.assert_array_equal(turned.position[:, 0], [0, 1, 2, 3, 4])
    assert turned.velocity.shape == (5, 1)


def test_other_joints_old_stamps_and_bad_numbers_are_passed_over(tmp_path):
    path = write_states(tmp_path / 'bag', [
        (5, 'ab', (1.0, 2.0)), (6, 'xy', (9.0, 9.0)), (6, 'ba', (4.0, 3.0)),
        (4, 'ab', (9.0, 9.0)), (6, 'ab', (9.0, 9.0)), (7, 'ab', (np.nan, 9.0)),
        (8, 'ab', ()), (9, 'ab', (5.0, 6.0)),
    ])
    with Recording(path) as opened:
        series = opened.joint_series('/joint_states')
    assert series.stamps_ns.tolist() == [5, 6, 9]
    np.testing.assert_array_equal(series.position, [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    assert series.velocity is None
    assert series.effort is None
    assert series.passed_over == 5
    assert series.faults.words() == [
        'duplicated: 1 sample left out; at 0.000 s',
        'out of order: 1 sample left out; at -0.000 s',
        'left out: 1 message without the wanted joints',
        'left out: 2 messages with a number missing or not finite']


def test_without_stamps_the_times_of_the_recording_count(tmp_path):
    path = write_states(tmp_path / 'bag', [(0, 'a', (float(i),)) for i in range(3)])
    with Recording(path) as opened:
        assert opened.joint_series('/joint_states').stamps_ns.tolist() == [1000, 1001, 1002]


def test_the_first_seconds(tmp_path):
    path = write_states(tmp_path / 'bag', [(10**9 * i, 'a', (float(i),)) for i in range(1, 6)])
    with Recording(path) as opened:
        series = opened.joint_series('/joint_states')
    assert series.times.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert series.first(2.0).position[:, 0].tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(('braked', 'left'), [
    ([], 100), (range(10), 90), (range(90, 100), 90), (range(40, 46), 94), (range(40, 44), 100),
    (range(100), 100)])
def test_brakes_are_recognized_by_an_effort_of_nothing(braked, left):
    """At an end, or for more than 0.06 s; if all efforts are zero, none was measured."""
    effort = np.ones((100, 2))
    effort[:, 0] = 0.0  # one joint is not sufficient
    effort[list(braked)] = 0.0
    stamps = 10**7 * np.arange(100)
    series = JointSeries(('a', 'b'), stamps, effort.copy(), None, effort, 0)
    driven = series.driven()
    assert len(driven.stamps_ns) == left
    if left < 100:
        assert driven.effort[:, 1].all()
    without = JointSeries(('a', 'b'), stamps, effort, None, None, 0)
    assert without.driven() is without


@given(
    st.lists(st.floats(-3.1, 3.1), min_size=2, max_size=60), st.floats(-50.0, 50.0),
    st.integers(0, 59))
@settings(deadline=None, derandomize=True, max_examples=50)
def test_whole_turns_are_removed_only_at_continuous_joints(steps, first, gap_at):
    """Unwrapped positions are the true ones, up to whole revolutions of each segment."""
    true = first + np.cumsum(steps)
    q = np.column_stack([np.remainder(true + np.pi, 2.0 * np.pi) - np.pi, 4.0 * true])
    stamps = 10**7 * np.arange(len(q))
    stamps[gap_at:] += 10**9
    series = JointSeries(('turns', 'limited'), stamps, q, None, None, 0)
    found = series.unwrapped(np.array([True, False])).position
    assert found[:, 1].tolist() == q[:, 1].tolist()
    for rows in series.stretches():
        assert found[rows[0], 0] == q[rows[0], 0]
        assert found[rows, 0] - true[rows] == pytest.approx(
            np.full(len(rows), found[rows[0], 0] - true[rows[0]]), abs=1e-9)
    if 0 < gap_at < len(q) and len(q) > 3:  # of three, the gap would be a usual period
        assert [len(rows) for rows in series.stretches()] == [gap_at, len(q) - gap_at]


def test_gaps_that_split_a_series():
    """Longer than 0.05 s, or than 2.5 median periods if these are longer."""
    for period, gap, parts in (
            (0.01, 0.049, 1), (0.01, 0.051, 2), (0.03, 0.074, 1), (0.03, 0.076, 2)):
        stamps = np.rint(1e9 * np.concatenate([
            period * np.arange(20), 19.0 * period + gap + period * np.arange(20)])).astype(int)
        series = JointSeries(('a',), stamps, np.zeros((40, 1)), None, None, 0)
        assert len(series.stretches()) == parts, (period, gap)


# --- selection of the topic ----------------------------------------------------------------------

def test_the_topic_of_joint_states_is_the_usual_one_or_the_only_one(tmp_path):
    for topics in (['/joint_states', '/effort_command'], ['/arm/states']):
        path = tmp_path / str(len(topics))
        with RecordingWriter(path) as writer:
            for topic in topics:
                writer.add_topic(topic, JOINT_STATE)
                writer.write(topic, 1, joint_state(1, 'a', (1.0,)))
        with Recording(path) as opened:
            assert opened.joint_state_topic() == topics[0]


def test_several_topics_to_choose_from_or_none(tmp_path):
    with RecordingWriter(tmp_path / 'two') as writer:
        for topic in ('/a', '/b'):
            writer.add_topic(topic, JOINT_STATE)
            writer.write(topic, 1, joint_state(1, 'a', (1.0,)))
    with Recording(tmp_path / 'two') as opened:
        with pytest.raises(RecordingError, match=r"'/a', '/b'"):
            opened.joint_state_topic()
    with pytest.raises(RecordingError, match='exists'):
        RecordingWriter(tmp_path / 'two')
    with RecordingWriter(tmp_path / 'none') as writer:
        with pytest.raises(RecordingError, match=r"'/x' has type 'no_msgs/msg/None'"):
            writer.add_topic('/x', 'no_msgs/msg/None')
        writer.add_topic('/text', 'std_msgs/msg/String')
        writer.write('/text', 1, serialized('std_msgs/msg/String', data='x'))
    with Recording(tmp_path / 'none') as opened:
        with pytest.raises(RecordingError, match=r'none.*/text \(std_msgs/msg/String\)'):
            opened.joint_state_topic()


# --- rejections ----------------------------------------------------------------------------------

def test_what_is_not_a_recording_is_refused(tmp_path):
    with pytest.raises(RecordingError, match='does not exist'):
        Recording(tmp_path / 'nothing')
    with pytest.raises(RecordingError, match=r'without metadata\.yaml'):
        Recording(tmp_path)
    broken = tmp_path / 'broken.mcap'
    broken.write_bytes(b'no mcap')
    with pytest.raises(RecordingError, match=r'broken\.mcap is damaged'):
        Recording(broken)


def test_a_message_that_cannot_be_decoded_is_refused(tmp_path):
    kind, types = 'demo_msgs/msg/Pair', get_typestore(Stores.ROS2_JAZZY)
    types.register(get_types_from_msg('float64 a', kind))
    with Writer(tmp_path / 'other', version=9) as writer:
        pairs = writer.add_connection('/pairs', kind, typestore=types)
        writer.write(pairs, 1, b'\0\1\0\0' + bytes(8))
    with Recording(tmp_path / 'other') as opened:
        with pytest.raises(RecordingError, match=rf"'/pairs' has type '{kind}', expected a type"):
            list(opened.messages('/pairs'))
    with RecordingWriter(tmp_path / 'damaged') as writer:
        with pytest.raises(RecordingError, match=rf"'/pairs' has type '{kind}', expected a type"):
            writer.add_topic('/pairs', kind)
        writer.add_topic('/joint_states', JOINT_STATE)
        writer.write('/joint_states', 1, b'\0\1\0\0abc')
    with Recording(tmp_path / 'damaged') as opened:
        with pytest.raises(RecordingError, match='a message of /joint_states: .*deserialize'):
            list(opened.messages('/joint_states'))


def test_wrong_questions_are_refused(recording):
    with Recording(recording) as opened:
        with pytest.raises(RecordingError, match='robot_dynamics_interfaces/msg/DynamicsTerms'):
            opened.joint_series('/terms')
        with pytest.raises(RecordingError, match=r"the joints \['c'\]; it has \['a', 'b'\]"):
            opened.joint_series('/joint_states', ['a', 'c'])


def test_an_exception_leaves_a_readable_recording(tmp_path):
    def write_and_fail():
        with RecordingWriter(tmp_path / 'bag') as writer:
            writer.add_topic('/joint_states', JOINT_STATE)
            writer.write('/joint_states', 1, joint_state(1, 'a', (1.0,)))
            raise ArithmeticError

    with pytest.raises(ArithmeticError):
        write_and_fail()
    with Recording(tmp_path / 'bag') as opened:
        assert len(opened.joint_series('/joint_states').stamps_ns) == 1


def test_an_interrupt_waits_until_the_record_is_whole(tmp_path):
    """A signal during any write ends with KeyboardInterrupt and a complete recording."""
    with RecordingWriter(tmp_path / 'bag') as writer:
        writer.add_topic('/text', 'std_msgs/msg/String')
        whole = writer._writer.write

        def write_and_be_interrupted(*arguments):
            os.kill(os.getpid(), signal.SIGINT)
            whole(*arguments)

        writer._writer.write = write_and_be_interrupted
        for k in range(5):
            message = serialized('std_msgs/msg/String', data=f'{k}')
            with pytest.raises(KeyboardInterrupt):
                writer.write('/text', k + 1, message)
    with Recording(tmp_path / 'bag') as recording:
        assert [message.data for _, message in recording.messages('/text')] == [
            str(k) for k in range(5)]


@pytest.fixture(autouse=True)
def default_handler() -> Iterator[None]:
    """Give SIGINT Python's handler: a background job of a shell starts with it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_an_ignored_signal_stays_ignored():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with uninterrupted():
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def test_other_threads_are_not_concerned():
    handlers = []

    def work() -> None:
        with uninterrupted():
            handlers.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert handlers == [signal.default_int_handler]
