# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Joint states decoded from bytes, for any layout."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.exceptions import RecordingError
from robot_dynamics_tools.recordings.joint_series import RecordedJointStates
from robot_dynamics_tools.recordings.messages import decode_joint_states, joint_state_messages
from robot_dynamics_tools.recordings.topics import DYNAMICS_TERMS_TEXT

# A warning of numpy indicates a number that the code did not check.
pytestmark = pytest.mark.filterwarnings('error::RuntimeWarning')

typesys = pytest.importorskip('rosbags.typesys')
STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)

NUMBERS = st.floats(-1e9, 1e9)
NAMES = st.lists(st.text(
    st.characters(codec='utf-8', exclude_characters='\0', exclude_categories=['Cs']), max_size=6),
    max_size=4, unique=True)


@st.composite
def states(draw):
    """Return the fields of a joint state: stamp, frame, names and three arrays."""
    names = draw(NAMES)
    arrays = [draw(st.one_of(
        st.just([]), st.lists(NUMBERS, min_size=len(names), max_size=len(names)),
        st.lists(NUMBERS, max_size=5))) for _ in range(3)]
    return (draw(st.integers(-2**31, 2**31 - 1)), draw(st.integers(0, 10**9 - 1)),
            draw(st.text(st.characters(codec='ascii', exclude_characters='\0'), max_size=5)),
            names, arrays)


def serialized(state, little_endian=True):
    sec, nanosec, frame, names, arrays = state
    types = STORE.types
    return bytes(STORE.serialize_cdr(types['sensor_msgs/msg/JointState'](
        header=types['std_msgs/msg/Header'](
            stamp=types['builtin_interfaces/msg/Time'](sec=sec, nanosec=nanosec), frame_id=frame),
        name=names, **{field: np.array(values, dtype=float) for field, values in zip(
            ('position', 'velocity', 'effort'), arrays)}),
        'sensor_msgs/msg/JointState', little_endian=little_endian))


@settings(deadline=None, derandomize=True, max_examples=50)
@given(st.lists(states(), max_size=6), st.booleans())
def test_what_was_serialized_is_read(messages, little_endian):
    read, unreadable = decode_joint_states(
        [(i, serialized(m, little_endian)) for i, m in enumerate(messages)])
    assert unreadable == 0
    assert [state.recorded_ns for state in read] == list(range(len(messages)))
    for state, (sec, nanosec, _, names, arrays) in zip(read, messages):
        assert state.stamp_ns == 10**9 * sec + nanosec
        assert list(state.joint_names) == names
        given_ = dict(zip(('position', 'velocity', 'effort'), arrays))
        assert {field: values.tolist() for field, values in state.values.items()} == {
            field: values for field, values in given_.items()
            if names and len(values) == len(names)}


@settings(deadline=None, derandomize=True, max_examples=50)
@given(states(), st.data())
def test_bytes_of_any_kind_are_counted_or_read(state, data):
    whole = serialized(state)
    at = data.draw(st.integers(0, len(whole)))
    noise = data.draw(st.binary(max_size=12))
    damaged = [whole[:at], whole[:at] + noise + whole[at + len(noise):], noise, b'']
    read, unreadable = decode_joint_states([(0, each) for each in damaged])
    assert len(read) + unreadable == len(damaged)


# --- selection of samples ------------------------------------------------------------------------

def recorded(messages):
    return RecordedJointStates('a test', *decode_joint_states(list(enumerate(messages))))


def series_of(stamps):
    stamps = np.array(stamps, dtype=np.int64)
    messages = joint_state_messages(stamps, 'a', np.arange(len(stamps), dtype=float)[:, None])
    return recorded(messages).series()


@settings(deadline=None, derandomize=True, max_examples=50)
@given(st.lists(st.integers(1, 30), min_size=1, max_size=12))
def test_as_few_samples_as_possible_are_left_out(stamps):
    series = series_of(stamps)
    assert (np.diff(series.stamps_ns) > 0).all()
    rows = series.position[:, 0].astype(int)
    assert (np.diff(rows) > 0).all()
    assert [stamps[row] for row in rows] == series.stamps_ns.tolist()
    # Compared with every subsequence of the first occurrences.
    first = [s for i, s in enumerate(stamps) if s not in stamps[:i]]
    best = [1] * len(first)
    for i in range(len(first)):
        best[i] += max((best[k] for k in range(i) if first[k] < first[i]), default=0)
    assert len(rows) == max(best)
    for what, count in (('duplicated', len(stamps) - len(first)),
                        ('out of order', len(first) - len(rows))):
        said = any(line.startswith(f'{what}: {count} sample') for line in series.faults.words())
        assert said == (count > 0)
    assert series.passed_over == len(stamps) - len(rows)


def test_dropped_samples_are_counted_by_the_median_period():
    stamps = [10**7 * k for k in range(1, 200) if k not in (50, 51, 52, 120)]
    assert series_of(stamps).faults.words() == [
        'dropped: about 4 samples, in 2 gaps beyond 1.5 median periods of 10 ms, the longest '
        '40 ms; at 0.480, 1.180 s']


def test_names_are_chosen_renamed_and_refused():
    stamps = np.array([1, 2, 3], dtype=np.int64)
    values = np.arange(6.0).reshape(3, 2)
    states_ = recorded([
        *joint_state_messages(stamps, ('g',), values[:, :1]),
        *joint_state_messages(stamps + 3, ('p1', 'p2'), values)])
    assert states_.joint_names == ('g', 'p1', 'p2')
    assert states_.together(('p2', 'g', 'p1')) == ('p2', 'p1')
    series = states_.renamed({'p1': 'j1'}).series(('p2', 'j1'))
    np.testing.assert_array_equal(series.position, values[:, ::-1])
    assert series.faults.words() == ['left out: 3 messages without the wanted joints']
    with pytest.raises(RecordingError, match=r"no message of a test .*\['g', 'p1'\]"):
        states_.series(('g', 'p1'))  # one after the other


def test_joints_of_several_messages_are_interpolated_to_the_times_of_one():
    """As the node, which takes the parts of an arm from several publishers; a gap stays one."""
    arm, wrist = 0.01 * np.arange(300), 0.02 * np.arange(140) + 0.003
    wrist = wrist[(wrist < 1.0) | (wrist > 1.2)]
    messages = [one for times, names in ((arm, ('a', 'b')), (wrist, ('w',))) for one in (
        joint_state_messages(np.round(1e9 * (1.0 + times)).astype(np.int64), names, np.stack(
            [np.sin(2.0 * times + k) for k in range(len(names))], axis=1)))]
    series = recorded(messages).series(('w', 'b'))
    t = 1e-9 * series.stamps_ns - 1.0
    np.testing.assert_allclose(
        series.position, np.stack([np.sin(2.0 * t), np.sin(2.0 * t + 1.0)], axis=1), atol=3e-4)
    assert t[0] == pytest.approx(0.01)
    assert not ((t > 0.99) & (t < 1.2)).any()
    assert len(t) > 240


def test_the_definition_of_dynamics_terms_is_that_of_the_interfaces():
    from pathlib import Path
    text = Path(__file__).parents[3] / 'robot_dynamics_interfaces' / 'msg' / 'DynamicsTerms.msg'
    name = 'robot_dynamics_interfaces/msg/DynamicsTerms'
    assert typesys.get_types_from_msg(DYNAMICS_TERMS_TEXT, name)[name][1] == (
        typesys.get_types_from_msg(text.read_text(encoding='utf-8'), name)[name][1])
