# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
States assembled from messages with all, some or none of the joints of an arm.

Rate, jitter and late states, compared with numpy on random times.
"""

from collections import deque
from collections.abc import Sequence

from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.ros.dynamics.state_log import ArrivalTiming, Timing
from robot_dynamics.ros.middleware.cdr_templates import JointStateDecoder, SensedState, stamp_bytes
from robot_dynamics.ros.middleware.joint_state_reader import JointStateReader
from robot_dynamics.ros.middleware.state_assembly import (
    ForeignJointsError,
    OtherJointsError,
    StateAssembly,
)
from sensor_msgs.msg import JointState

rclpy_serialization = pytest.importorskip('rclpy.serialization')

NAMES = ('a', 'b', 'c')
MS = 1_000_000
SECOND = 1000 * MS
PERIOD = 2 * MS
DECODER = JointStateDecoder()


def message(
    stamp_ns: int, names: Sequence[str], first: float = 0.0, has_velocity: bool = True,
    has_effort: bool = False,
) -> SensedState:
    """Return a decoded message; the position of its i-th joint is first + i."""
    state = JointState(name=list(names))
    state.header.stamp.sec, state.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
    state.position = [first + i for i in range(len(names))]
    state.velocity = [0.5 * x for x in state.position] if has_velocity else []
    state.effort = [-2.0 * x for x in state.position] if has_effort else []
    return DECODER.decode(bytes(rclpy_serialization.serialize_message(state)))


def test_a_message_with_all_joints_is_a_state_as_it_is_and_one_with_none_another_one():
    assembly = StateAssembly(NAMES)
    state = message(PERIOD, ['gripper', 'c', 'a', 'b'])
    assert assembly.take(state) is state
    with pytest.raises(OtherJointsError, match='none of'):
        assembly.take(message(PERIOD, ['gripper']))


@settings(max_examples=50)
@given(st.floats(0.0, 1.0), st.integers(0, 2**32 - 1))
def test_two_halves_are_answered_once_per_period(phase, seed):
    """For any time between both halves, and with jitter of 2 % of a period."""
    assembly, rng, answers = StateAssembly(NAMES), np.random.default_rng(seed), []
    times = sorted(
        (round(PERIOD * (k + offset + 0.01 * rng.uniform(-1.0, 1.0))), part)
        for k in range(10, 110) for offset, part in ((0.0, ('a', 'c')), (phase, ('b', 'hand'))))
    for t, part in times:
        state = assembly.take(message(t, part, float(t)))
        if state is not None:
            answers.append(state)
            assert state.stamp_ns == t
    stamps = np.array([state.stamp_ns for state in answers])
    assert len(answers) >= 97
    assert np.diff(stamps).max() < 1.2 * PERIOD
    q, v = JointStateReader(NAMES).read(answers[-1])
    last = {part: t for t, part in times if t <= stamps[-1]}
    assert q.tolist() == [last['a', 'c'], last['b', 'hand'], last['a', 'c'] + 1.0]
    assert v.tolist() == [0.5 * x for x in q]


def test_a_half_that_is_missing_is_named():
    assembly = StateAssembly(NAMES)
    for k in range(1, 20):
        assert assembly.take(message(k * PERIOD, ['a', 'c'])) is None
        assert assembly.missing == ['b']
    assert assembly.take(message(19 * PERIOD + PERIOD // 5, ['b'])) is not None
    assert assembly.missing == []
    for k in range(21, 30):  # the second half no longer arrives
        assert assembly.take(message(k * PERIOD, ['a', 'c'])) is None
        assert assembly.missing == ['b']


def test_a_message_that_is_received_twice_discards_no_samples():
    assembly = StateAssembly(NAMES)
    assert assembly.take(message(PERIOD, ['b'])) is None
    for _ in range(2):
        assert assembly.take(message(PERIOD, ['a', 'c'])) is not None
    assert assembly.take(message(PERIOD + MS, ['a', 'c'])) is None


def test_velocities_and_efforts_that_both_halves_have_are_assembled():
    assembly = StateAssembly(NAMES)
    assembly.take(message(PERIOD, ['b'], has_velocity=False))
    state = assembly.take(message(PERIOD, ['a', 'c']))
    assert JointStateReader(NAMES).read(state)[1] is None
    assert JointStateReader(NAMES).effort(state) is None
    assembly.take(message(2 * PERIOD, ['b'], 5.0, has_effort=True))
    state = assembly.take(message(2 * PERIOD, ['c', 'a'], 7.0, has_effort=True))
    assert state.stamp == stamp_bytes(2 * PERIOD)
    reader = JointStateReader(NAMES)
    q, v = reader.read(state)
    assert q.tolist() == [8.0, 5.0, 7.0]
    assert v.tolist() == [4.0, 2.5, 3.5]
    effort = reader.effort(state)
    assert effort.tolist() == [-16.0, -10.0, -14.0]


def test_a_period_that_begins_at_time_0_is_measured():
    assembly = StateAssembly(NAMES)
    assert assembly.missing == []
    assert assembly.take(message(0, ['a', 'c'])) is None
    assert assembly.take(message(0, ['b'])) is not None
    assembly.take(message(PERIOD // 2, ['b']))
    assert assembly.take(message(PERIOD, ['a', 'c'])) is not None


@pytest.mark.parametrize(('interval', 'is_used'), [
    (-PERIOD, False), (2 * SECOND - MS, True), (2 * SECOND, False)])
def test_after_a_reset_or_a_long_pause_no_old_sample_is_used(interval, is_used):
    """An interval below 2 s is none: the samples of 1 s before are of the last half period."""
    assembly = StateAssembly(NAMES)
    start = 2 * PERIOD
    assembly.take(message(start, ['b']))
    assert assembly.take(message(start, ['a', 'c'])) is not None
    assert assembly.take(message(start + interval, ['a', 'c'])) is None
    state = assembly.take(message(start + interval + SECOND, ['b', 'hand']))
    assert (state is not None) == is_used
    assert assembly.missing == ([] if is_used else ['a', 'c'])


def test_a_single_late_message_hardly_changes_the_largest_age():
    """The period is an average over many messages: one interval of ten periods counts little."""
    assembly = StateAssembly(NAMES)
    for k in range(1, 50):
        assembly.take(message(k * PERIOD, ['b']))
        assembly.take(message(k * PERIOD, ['a', 'c']))
    late = 49 * PERIOD + 10 * PERIOD
    assembly.take(message(late, ['a', 'c']))
    assert assembly.take(message(late + 2 * PERIOD, ['b'])) is None
    assert assembly.missing == ['a', 'c']


def test_the_first_interval_is_the_period():
    assembly = StateAssembly(NAMES)
    assembly.take(message(PERIOD, ['a', 'c']))
    assembly.take(message(2 * PERIOD, ['a', 'c']))
    assert assembly.take(message(2 * PERIOD + PERIOD * 54 // 100, ['b'])) is not None
    assert assembly.take(message(2 * PERIOD + PERIOD * 56 // 100, ['b'])) is None


def test_the_embedded_arm_has_its_joints_only():
    assembly = StateAssembly(NAMES, is_exact=True)
    assert assembly.take(message(PERIOD, ['c', 'b', 'a'])) is not None
    for names in (['a', 'b', 'c', 'd'], ['gripper']):
        with pytest.raises(ForeignJointsError, match='set robot_description_file') as caught:
            assembly.take(message(PERIOD, names))
        assert str(names) in str(caught.value)


def test_sources_that_are_remembered_are_bounded():
    assembly = StateAssembly(NAMES)
    sizes = set()
    for i in range(100):
        assembly.take(message(PERIOD, ['a', f'joint{i}']))
        sizes.add(len(assembly._parts))
    assert max(sizes) == 32


@pytest.mark.parametrize(('count', 'is_known'), [(8, True), (9, False)])
def test_a_decoder_knows_the_layouts_of_eight_publishers(count, is_known):
    publishers = [(f'joint{i}',) for i in range(count)]
    _, before, after = ([message(k, names) for names in publishers] for k in range(3))
    for names, one, other in zip(publishers, before, after):
        assert one.name == other.name == list(names)
        assert (one.layout is other.layout) == is_known


START = 1000.0
intervals = st.lists(st.floats(1e-4, 0.5), min_size=1, max_size=60)


@settings(max_examples=50)
@given(intervals, intervals)
def test_windows_do_not_mix(first, second):
    """An interval belongs to the window in which it ended."""
    timing, t = ArrivalTiming(START), START
    last: list[float] = []
    for lengths in (first, second):
        begin, ends = t, t + np.cumsum(lengths)
        t = max(float(ends[-1]), begin + 1.0) + 0.01
        arrivals = deque(ends.tolist())
        seen, between = timing.take(arrivals, t), np.diff([*last, *ends])
        assert not arrivals
        if between.size == 0:
            assert seen == Timing()
        else:
            assert seen.jitter == pytest.approx(between.std(), abs=1e-6)
        assert seen.rate == pytest.approx(between.size / (t - begin))
        assert seen.longest == pytest.approx(between.max(initial=0.0))
        last = [float(ends[-1])]


@settings(max_examples=50)
@given(st.lists(st.floats(1e-3, 0.1), min_size=2, max_size=30),
       st.lists(st.floats(1e-3, 0.3), min_size=1, max_size=30))
def test_late_is_more_than_one_and_a_half_intervals_of_the_window_before(first, second):
    timing, times = ArrivalTiming(START), START + np.cumsum(first)
    now = START + max(1.0, sum(first))
    timing.take(deque(times.tolist()), now)
    assert timing.late == 0  # there is no reference interval yet
    usual = np.diff(times).mean()
    later = times[-1] + np.cumsum(second)
    timing.take(deque(later.tolist()), now + max(1.0, sum(second)))
    between = np.diff([times[-1], *later])
    assume((np.abs(between - 1.5 * usual) > 1e-9).all())
    assert timing.late == (between > 1.5 * usual).sum()


def test_a_window_is_evaluated_when_it_is_over_and_not_before():
    timing, arrivals = ArrivalTiming(START), deque((START + np.arange(1, 100) * 0.005).tolist())
    assert timing.take(arrivals, START + 0.999) == Timing()
    assert len(arrivals) == 99
    seen = timing.take(arrivals, START + 1.0)
    assert seen.rate == pytest.approx(98.0)
    assert timing.take(arrivals, START + 1.5) == seen == timing.timing
    assert timing.take(arrivals, START + 2.0) == Timing()  # no state since
    assert timing.take(deque([START + 2.5]), START + 3.0).rate == pytest.approx(1.0)
    assert timing.late == 0  # until an interval is known
