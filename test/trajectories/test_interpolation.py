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

"""Properties of joint trajectories: interpolation, replacement, precision, and rejections."""

import array
from itertools import pairwise
import math
from pathlib import Path
import re
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.follower import ActiveTrajectory, TrajectoryFollower
from robot_dynamics.trajectories.goal_limits import check_points
from robot_dynamics.trajectories.interpolation import Reference, sample_segment
from robot_dynamics.trajectories.joint_trajectory import (
    JointTrajectory,
    make_trajectory,
    TrajectoryPoint,
)
from robot_dynamics.trajectories.quintics import quintic_point_to_point, quintic_via_points

JOINTS = ('shoulder', 'elbow')
EPOCH = 1_700_000_000_123_456_789
SECOND = 1_000_000_000
REST = Reference(np.zeros(2), np.zeros(2), np.zeros(2))

values = st.floats(-10.0, 10.0)
vectors = st.lists(values, min_size=2, max_size=2).map(np.array)
spans = st.floats(0.05, 20.0)
laws = settings(deadline=None, derandomize=True, max_examples=60)


def point(q: Any, v: Any = None, a: Any = None, t: float = 0.0) -> TrajectoryPoint:
    q, v, a = (None if x is None else np.array(x, dtype=float) for x in (q, v, a))
    return TrajectoryPoint(t, q, v, a)


def trajectory(
    times: Any = (1.0, 2.0), q: Any = ((0.1, 0.2), (0.3, 0.4)), v: Any = (), a: Any = (),
    names: Any = JOINTS,
) -> JointTrajectory:
    return make_trajectory(names, times, q, v, a, JOINTS)


def smooth(times: Any, seed: int = 1) -> JointTrajectory:
    """Return random points with all fields, at rest at the end."""
    rng = np.random.default_rng(seed)
    q, v, a = rng.uniform(-1.0, 1.0, (3, len(times), 2))
    v[-1] = a[-1] = 0.0
    return trajectory(times, q, v, a)


def assert_same(left: Reference, right: Reference, tolerance: float = 1e-9) -> None:
    for x, y in zip(left, right):
        np.testing.assert_allclose(x, y, rtol=tolerance, atol=tolerance)


# Interpolation ---------------------------------------------------------------------------------

@laws
@given(q0=vectors, v0=vectors, a0=vectors, q1=vectors, v1=vectors, a1=vectors, T=spans)
def test_a_quintic_meets_all_six_conditions(q0, v0, a0, q1, v1, a1, T):
    p0, p1 = point(q0, v0, a0), point(q1, v1, a1)
    scale = 1.0 + 1.0 / T**2 + T**2
    assert_same(sample_segment(5.0, 5.0, p0, 5.0 + T, p1), Reference(q0, v0, a0), 1e-12 * scale)
    assert_same(
        sample_segment(5.0 + T, 5.0, p0, 5.0 + T, p1), Reference(q1, v1, a1), 1e-11 * scale)


@laws
@given(q0=vectors, v0=vectors, a0=vectors, q1=vectors, v1=vectors, a1=vectors,
       T=st.floats(0.5, 3.0), s=st.floats(0.0, 1.0))
def test_a_quintic_equals_the_solution_of_its_linear_system(q0, v0, a0, q1, v1, a1, T, s):
    def rows(t):
        powers = np.polynomial.polynomial.polyvander(t, 5)
        first = np.array([k * t**(k - 1) if k else 0.0 for k in range(6)])
        second = np.array([k * (k - 1) * t**(k - 2) if k > 1 else 0.0 for k in range(6)])
        return np.vstack((powers, first, second))

    system = np.vstack((rows(0.0), rows(T)))
    c = np.linalg.solve(system, np.vstack((q0, v0, a0, q1, v1, a1)))
    expected = Reference(*(rows(s * T) @ c))
    found = sample_segment(s * T, 0.0, point(q0, v0, a0), T, point(q1, v1, a1))
    assert_same(found, expected, 1e-8)


@laws
@given(q0=vectors, v0=vectors, q1=vectors, v1=vectors, T=spans, s=st.floats(0.0, 1.0))
def test_a_cubic_has_the_ends_of_its_points_and_a_linear_acceleration(q0, v0, q1, v1, T, s):
    p0, p1 = point(q0, v0), point(q1, v1)
    begin, end = (sample_segment(t, 0.0, p0, T, p1) for t in (0.0, T))
    scale = 1e-11 * (1.0 + 1.0 / T**2 + T)
    np.testing.assert_allclose(begin[:2], (q0, v0), atol=scale)
    np.testing.assert_allclose(end[:2], (q1, v1), atol=scale)
    between = sample_segment(s * T, 0.0, p0, T, p1).acceleration
    np.testing.assert_allclose(
        between, (1.0 - s) * begin.acceleration + s * end.acceleration, rtol=1e-9, atol=scale)


@pytest.mark.parametrize(('p0', 'p1'), [
    (point([0.0, 1.0]), point([4.0, 3.0])),
    (point([0.0, 1.0], [9.0, 9.0]), point([4.0, 3.0])),
    (point([0.0, 1.0]), point([4.0, 3.0], [9.0, 9.0], [9.0, 9.0])),
])
def test_without_a_velocity_at_both_ends_the_way_is_straight(p0, p1):
    found = sample_segment(0.5, 0.0, p0, 2.0, p1)
    assert_same(found, Reference(np.array([1.0, 1.5]), np.array([2.0, 1.0]), np.zeros(2)))


def test_without_an_acceleration_at_both_ends_the_way_is_cubic():
    q0, v0, q1, v1, a1 = [0.0, 1.0], [0.3, 0.1], [1.0, 2.0], [0.2, -0.4], [5.0, 5.0]
    mixed = sample_segment(0.7, 0.0, point(q0, v0), 2.0, point(q1, v1, a1))
    assert_same(mixed, sample_segment(0.7, 0.0, point(q0, v0), 2.0, point(q1, v1)))


@laws
@given(t=st.floats(0.01, 0.99), T=spans)
def test_velocity_and_acceleration_are_the_derivatives_of_position(t, T):
    p0, p1 = point([0.1, 0.4], [1.0, -1.0], [0.3, 0.0]), point([2.0, -1.0], [0.5, 0.2], [0.0, 1.0])
    h = 1e-4 * T
    before, at, after = (
        sample_segment(t * T + d, 0.0, p0, T, p1) for d in (-h, 0.0, h))
    tolerance = 1e-4 * (1.0 + 1.0 / T**2)
    np.testing.assert_allclose(
        (after.position - before.position) / (2 * h), at.velocity, rtol=1e-4, atol=tolerance)
    np.testing.assert_allclose(
        (after.velocity - before.velocity) / (2 * h), at.acceleration, rtol=1e-4, atol=tolerance)


def test_a_time_outside_the_segment_is_the_nearer_end():
    p0, p1 = point([0.0, 1.0], [1.0, 0.0]), point([1.0, 1.0], [0.0, 0.5])
    assert_same(sample_segment(-3.0, 0.0, p0, 2.0, p1), sample_segment(0.0, 0.0, p0, 2.0, p1))
    assert_same(sample_segment(9.0, 0.0, p0, 2.0, p1), sample_segment(2.0, 0.0, p0, 2.0, p1))


@pytest.mark.parametrize('t1', [1.0, 0.5, math.nan])
def test_a_segment_without_length_is_refused(t1):
    with pytest.raises(TrajectoryError, match='expected more than t0, which is 1.0 s'):
        sample_segment(1.0, 1.0, point([0.0]), t1, point([1.0]))


# Active trajectories ---------------------------------------------------------------------------

@pytest.mark.parametrize(('fields', 'continuous'), [
    (1, (True, False, True)),  # linear: the acceleration is zero on both sides
    (2, (True, True, False)),
    (3, (True, True, True)),
])
def test_each_degree_is_continuous_up_to_its_own_derivative(fields, continuous):
    rng = np.random.default_rng(3)
    rows = rng.uniform(-1.0, 1.0, (3, 4, 2))
    rows[1:, -1] = 0.0
    q, v, a = (rows[k] if k < fields else () for k in range(3))
    before = Reference(*rng.uniform(-1.0, 1.0, (3, 2)))
    active = ActiveTrajectory(trajectory((0.5, 1.0, 1.7, 2.0), q, v, a), EPOCH, EPOCH, before)
    for seconds in (0.5, 1.0, 1.7):
        knot = EPOCH + round(seconds * SECOND)
        left, right = active.sample(knot - 1), active.sample(knot + 1)
        for k in range(3):
            step = np.abs(right[k] - left[k]).max()
            assert (step < 1e-5) == continuous[k], (seconds, k)
    for k in range(fields):
        np.testing.assert_allclose(active.sample(EPOCH)[k], before[k], atol=1e-12)


def test_a_knot_gives_its_point():
    path = smooth((0.5, 1.0, 1.7))
    active = ActiveTrajectory(path, EPOCH, EPOCH, REST)
    for p in path.points:
        found = active.sample(EPOCH + round(p.time_from_start * SECOND))
        assert_same(found, Reference(p.position, p.velocity, p.acceleration), 1e-12)


@laws
@given(start=st.integers(1, 2 * EPOCH), span=st.integers(-SECOND, 4 * SECOND))
def test_a_shift_of_time_changes_not_one_bit(start, span):
    path = smooth((0.3, 1.0, 2.5))
    here, there = (ActiveTrajectory(path, t, t, REST) for t in (start, start + EPOCH))
    for x, y in zip(here.sample(start + span), there.sample(start + EPOCH + span)):
        assert x.tobytes() == y.tobytes()


def test_one_nanosecond_at_the_epoch_is_one_nanosecond_of_motion():
    path = trajectory((1.0, 2.0), ((0.0, 0.0), (1.0, -1.0)))
    active = ActiveTrajectory(path, EPOCH, EPOCH, REST)
    now = EPOCH + SECOND + SECOND // 2
    step = active.sample(now + 1).position - active.sample(now).position
    np.testing.assert_allclose(step, (1e-9, -1e-9), rtol=1e-6)


def test_the_order_of_samples_does_not_matter():
    path = smooth(np.linspace(0.1, 3.0, 12))
    times = [EPOCH + k * SECOND // 50 for k in range(-5, 170)]
    forth, back, jumping = (ActiveTrajectory(path, EPOCH, EPOCH, REST) for _ in range(3))
    expected = {t: forth.sample(t) for t in times}
    shuffled = [int(t) for t in np.random.default_rng(5).permutation(times)]
    for active, order in ((back, times[::-1]), (jumping, shuffled)):
        for t in order:
            assert_same(active.sample(t), expected[t], 0.0)


def test_the_end_is_held_at_rest():
    path = trajectory(
        (1.0, 2.0), ((0.1, 0.2), (0.3, 0.4)), ((1.0, 1.0), (1e-8, 0.0)), ((1.0, 1.0), (2.0, 3.0)))
    active = ActiveTrajectory(path, EPOCH, EPOCH, REST)
    for span in (2 * SECOND, 2 * SECOND + 1, 10**6 * SECOND):
        held = active.sample(EPOCH + span)
        assert_same(held, Reference(np.array([0.3, 0.4]), np.zeros(2), np.zeros(2)), 0.0)


@pytest.mark.parametrize(('v', 'a', 'expected'), [
    ((), (), ((0.3, 0.4), (0.0, 0.0), (0.0, 0.0))),
    (((1.0, 2.0),), (), ((0.3, 0.4), (1.0, 2.0), (0.0, 0.0))),
    (((1.0, 2.0),), ((5.0, 6.0),), ((0.3, 0.4), (1.0, 2.0), (5.0, 6.0))),
    ((), ((5.0, 6.0),), ((0.3, 0.4), (0.0, 0.0), (5.0, 6.0))),
])
def test_a_set_point_is_held_with_what_it_carries(v, a, expected):
    path = trajectory((0.0,), ((0.3, 0.4),), v, a)
    assert path.is_set_point
    active = ActiveTrajectory(path, EPOCH, EPOCH, REST)
    for span in (0, 1, 1000 * SECOND):
        assert_same(active.sample(EPOCH + span), Reference(*map(np.array, expected)), 0.0)


def test_a_set_point_with_a_time_is_reached_from_the_state_before():
    path = trajectory((2.0,), ((1.0, 0.0),), ((0.0, 0.0),), ((0.0, 0.0),))
    active = ActiveTrajectory(path, EPOCH, EPOCH, REST)
    middle = active.sample(EPOCH + SECOND)
    expected = Reference(np.array([0.5, 0.0]), np.array([15.0 / 16.0, 0.0]), np.zeros(2))
    assert_same(middle, expected, 1e-14)


def test_a_start_in_the_future_is_led_to_from_the_arrival():
    path = trajectory((1.0, 2.0), ((4.0, 0.0), (5.0, 0.0)))
    active = ActiveTrajectory(path, EPOCH + 3 * SECOND, EPOCH, REST)
    for seconds, q in ((0, 0.0), (1, 1.0), (3, 3.0), (4, 4.0), (5, 5.0), (6, 5.0)):
        assert active.sample(EPOCH + seconds * SECOND).position[0] == pytest.approx(q, abs=1e-12)


def test_a_late_arrival_enters_where_the_clock_is():
    path = trajectory((1.0, 3.0), ((1.0, 0.0), (3.0, 0.0)))
    active = ActiveTrajectory(path, EPOCH, EPOCH + 2 * SECOND, REST)
    np.testing.assert_allclose(active.sample(EPOCH + 2 * SECOND).position, (2.0, 0.0))
    assert_same(active.sample(EPOCH + SECOND), REST)


def test_an_entry_from_the_state_before_makes_no_step():
    active = ActiveTrajectory(smooth((0.5, 1.0)), EPOCH, EPOCH, REST)
    np.testing.assert_array_equal(active.sample(EPOCH).position, REST.position)


def test_what_a_sample_shares_cannot_be_written():
    active = ActiveTrajectory(trajectory(), EPOCH, EPOCH, REST)
    for row in active.sample(active.end_ns):
        with pytest.raises(ValueError, match='read-only'):
            row[0] = 1.0


# Replacement -----------------------------------------------------------------------------------

@laws
@given(span=st.integers(1, 4 * SECOND), delay=st.integers(0, SECOND))
def test_a_replacement_continues_from_the_active_reference(span, delay):
    follower = TrajectoryFollower(JOINTS)
    follower.start(smooth((0.5, 1.0, 3.0), 1), EPOCH, (0.0, 0.0), (0.0, 0.0))
    now = EPOCH + span
    before = follower.sample(now)
    follower.start(
        smooth((0.4, 2.0), 2), now, (9.0, 9.0), (9.0, 9.0), stamp_ns=now + delay)
    assert_same(follower.sample(now), before, 1e-12)
    after = follower.sample(now + 1000)
    np.testing.assert_allclose(after.position, before.position + 1e-6 * before.velocity, atol=1e-9)
    np.testing.assert_allclose(after.velocity, before.velocity, atol=1e-3)


def test_the_first_trajectory_continues_from_the_measured_state():
    follower = TrajectoryFollower(JOINTS)
    assert follower.sample(EPOCH) is None
    q, v = np.array([0.5, -0.5]), np.array([0.1, 0.2])
    active = follower.start(smooth((1.0, 2.0)), EPOCH, q, v)
    q[:] = v[:] = 7.0
    assert follower.active is active
    expected = Reference(np.array([0.5, -0.5]), np.array([0.1, 0.2]), np.zeros(2))
    assert_same(follower.sample(EPOCH), expected, 1e-14)


def test_the_largest_values_that_pass_do_not_overflow():
    largest = ((1e9, -1e9), (-1e9, 1e9))
    path = trajectory((0.5, 2.0 ** 31 - 1.0), largest, (largest[0], (0.0, 0.0)), largest)
    follower = TrajectoryFollower(JOINTS)
    follower.start(path, EPOCH, (0.0, 0.0), (0.0, 0.0))
    for seconds in (0, 1, 2 ** 30, 2 ** 31):
        assert all(np.isfinite(x).all() for x in follower.sample(EPOCH + seconds * SECOND))


def test_a_reference_that_no_arm_can_follow_does_not_outlive_its_replacement():
    follower = TrajectoryFollower(JOINTS)
    follower.start(smooth((100.0, 200.0)), EPOCH, (0.0, 0.0), (1e9, 0.0))
    assert np.abs(follower.sample(EPOCH + 50 * SECOND).position).max() > 1e9
    follower.start(smooth((1.0, 2.0)), EPOCH + 50 * SECOND, (0.3, 0.4), (0.0, 0.0))
    assert_same(
        follower.sample(EPOCH + 50 * SECOND),
        Reference(np.array([0.3, 0.4]), np.zeros(2), np.zeros(2)), 1e-14)


@pytest.mark.parametrize(('position', 'velocity', 'words'), [
    ((1e308, 0.0), (0.0, 0.0), r'position\[0\] \(shoulder\) is 1e\+308, expected a number in'),
    ((0.0, 0.0), (0.0, -1e200), r'velocity\[1\] \(elbow\) is -1e\+200, expected a number in'),
])
def test_a_measured_state_that_no_arm_has_starts_nothing(position, velocity, words):
    follower = TrajectoryFollower(JOINTS)
    with pytest.raises(InvalidInputError, match=words):
        follower.start(smooth((1.0, 2.0)), EPOCH, position, velocity)
    assert follower.active is None


def test_after_clear_the_measured_state_counts_again():
    follower = TrajectoryFollower(JOINTS)
    follower.start(trajectory(), EPOCH, (0.0, 0.0), (0.0, 0.0))
    follower.clear()
    assert follower.sample(EPOCH) is None
    follower.start(trajectory(), EPOCH + SECOND, (0.7, 0.8), (0.0, 0.0))
    np.testing.assert_allclose(follower.sample(EPOCH + SECOND).position, (0.7, 0.8))


def test_the_old_trajectory_is_discarded_at_once():
    follower = TrajectoryFollower(JOINTS)
    old = trajectory((0.0, 10.0), ((0.0, 0.0), (10.0, 0.0)))
    new = trajectory((0.0, 1.0), ((0.0, 0.0), (1.0, 0.0)))
    follower.start(old, EPOCH, (0.0, 0.0), (0.0, 0.0))
    now = EPOCH + 2 * SECOND
    follower.start(new, now, (0.0, 0.0), (0.0, 0.0), stamp_ns=now + 2 * SECOND)
    for seconds, q in ((0, 2.0), (1, 1.0), (2, 0.0), (3, 1.0)):
        found = follower.sample(now + seconds * SECOND).position[0]
        assert found == pytest.approx(q, abs=1e-12)


def test_a_start_stamp_of_zero_is_now():
    follower = TrajectoryFollower(JOINTS)
    active = follower.start(trajectory(), EPOCH, (0.0, 0.0), (0.0, 0.0))
    assert (active.start_ns, active.end_ns) == (EPOCH, EPOCH + 2 * SECOND)


def test_an_end_in_the_past_is_refused_and_changes_nothing():
    follower = TrajectoryFollower(JOINTS)
    in_force = follower.start(trajectory(), EPOCH, (0.0, 0.0), (0.0, 0.0))
    with pytest.raises(TrajectoryError) as refusal:
        follower.start(
            trajectory(), 10 * SECOND, (0.0, 0.0), (0.0, 0.0), stamp_ns=8 * SECOND - 1)
    assert str(refusal.value) == (
        'header.stamp is 7.999999999 s and the last point comes 2 s later, which is 0.000000001 s '
        'before now (10.000000000 s), expected an end in the future, or a zero stamp to start now')
    assert follower.active is in_force
    active = follower.start(
        trajectory(), 10 * SECOND, (0.0, 0.0), (0.0, 0.0), stamp_ns=8 * SECOND)
    assert active.end_ns == 10 * SECOND


def test_a_set_point_may_be_late_by_its_age():
    follower = TrajectoryFollower(JOINTS, set_point_max_age=0.5)
    set_point = trajectory((0.0,), ((0.3, 0.4),), ((1.0, 0.0),))
    follower.start(set_point, EPOCH, (0.0, 0.0), (0.0, 0.0), stamp_ns=EPOCH - SECOND // 2)
    np.testing.assert_array_equal(follower.sample(EPOCH).position, (0.3, 0.4))
    with pytest.raises(TrajectoryError, match='is 0.500000001 s before now'):
        follower.start(set_point, EPOCH, (0.0, 0.0), (0.0, 0.0), stamp_ns=EPOCH - SECOND // 2 - 1)


def test_other_joints_than_the_follower_has_are_refused():
    other = make_trajectory(JOINTS, (1.0,), ((0.1, 0.2),), (), (), JOINTS[::-1])
    with pytest.raises(TrajectoryError, match=r"\['elbow', 'shoulder'\], expected \['shoulder'"):
        TrajectoryFollower(JOINTS).start(other, EPOCH, (0.0, 0.0), (0.0, 0.0))


@pytest.mark.parametrize(('q', 'v', 'words'), [
    ((0.0,), (0.0, 0.0), 'position has 1 values, expected 2'),
    ((0.0, 0.0), (0.0, math.nan), r'velocity\[1\] \(elbow\) is nan'),
])
def test_an_invalid_measured_state_is_rejected(q, v, words):
    with pytest.raises(InvalidInputError, match=words):
        TrajectoryFollower(JOINTS).start(trajectory(), EPOCH, q, v)


@laws
@given(q=values, target=values)
def test_a_continuous_joint_takes_the_shortest_angular_distance(q, target):
    follower = TrajectoryFollower(JOINTS, continuous_joints=('elbow',))
    path = trajectory((1.0,), ((target, target),))
    follower.start(path, EPOCH, (q, q), (0.0, 0.0))
    shoulder, elbow = follower.sample(EPOCH).position
    assert shoulder == q
    assert abs(target - elbow) <= math.pi + 1e-6
    assert (elbow - q) / math.tau == pytest.approx(round((elbow - q) / math.tau), abs=1e-9)
    np.testing.assert_array_equal(follower.sample(EPOCH + SECOND).position, (target, target))


@pytest.mark.parametrize(('turns', 'way'), [
    (0.5, 0.5), (1.5, 0.5), (-0.5, -0.5), (-1.5, -0.5), (0.5 + 1e-11, 0.5), (0.5 + 1e-6, -0.5)])
def test_half_a_turn_keeps_the_direction_of_the_numbers(turns, way):
    follower = TrajectoryFollower(('wheel',), continuous_joints=('wheel',))
    target = turns * math.tau
    path = make_trajectory(('wheel',), (1.0,), ((target,),), (), (), ('wheel',))
    follower.start(path, EPOCH, (0.0,), (0.0,))
    assert target - follower.sample(EPOCH).position[0] == pytest.approx(
        way * math.tau, abs=1e-5)


def test_a_continuous_joint_that_is_no_joint_is_refused():
    with pytest.raises(InvalidInputError, match=r"\['wrist'\], expected names of \['shoulder'"):
        TrajectoryFollower(JOINTS, continuous_joints=('wrist',))


def test_a_negative_age_is_refused():
    with pytest.raises(InvalidInputError, match='set_point_max_age is -1, expected a number >= 0'):
        TrajectoryFollower(JOINTS, set_point_max_age=-1.0)


# Validation ------------------------------------------------------------------------------------

@laws
@given(order=st.permutations(range(4)), fields=st.integers(1, 3), span=st.integers(0, 3 * SECOND))
def test_the_order_of_the_joints_in_a_message_does_not_matter(order, fields, span):
    joints = ('a', 'b', 'c', 'd')
    rows = np.random.default_rng(7).uniform(-1.0, 1.0, (3, 3, 4))
    rows[1, -1] = 0.0
    given_rows = [rows[k] if k < fields else () for k in range(3)]
    mixed_rows = [rows[k][:, order] if k < fields else () for k in range(3)]
    times, before = (0.5, 1.0, 2.0), Reference(*np.zeros((3, 4)))
    straight = make_trajectory(joints, times, *given_rows, joints)
    mixed = make_trajectory([joints[i] for i in order], times, *mixed_rows, joints)
    assert mixed.joint_names == joints
    left, right = (
        ActiveTrajectory(t, EPOCH, EPOCH, before).sample(EPOCH + span) for t in (straight, mixed))
    assert_same(left, right, 0.0)


def test_rows_come_as_a_message_holds_them():
    path = trajectory(
        (1.0, 2.0, 3.0),
        [array.array('d', (0.1, 0.2)), np.array((0.3, 0.4)), (1, 2)],
        [array.array('d', (1.0, 2.0)), array.array('d'), (0.0, 0.0)],
        [None, (), []],
        names=('elbow', 'shoulder'))
    assert [p.time_from_start for p in path.points] == [1.0, 2.0, 3.0]
    np.testing.assert_array_equal(path.points[0].position, (0.2, 0.1))
    np.testing.assert_array_equal(path.points[0].velocity, (2.0, 1.0))
    assert path.points[1].velocity is None
    assert all(p.acceleration is None for p in path.points)
    assert path.duration == 3.0
    assert not path.is_set_point


def test_the_senders_arrays_stay_the_senders():
    q = np.array([[0.1, 0.2], [0.3, 0.4]])
    path = trajectory((1.0, 2.0), q)
    q[:] = 9.0
    np.testing.assert_array_equal(path.points[1].position, (0.3, 0.4))


GOOD = {
    'names': JOINTS, 'times': (1.0, 2.0), 'q': ((0.1, 0.2), (0.3, 0.4)),
    'v': ((0.1, 0.2), (0.0, 0.0)), 'a': ((0.1, 0.2), (0.3, 0.4)),
}
REFUSALS = [
    ({'names': ()}, "joint_names is empty, expected ['shoulder', 'elbow']"),
    ({'names': ('shoulder', 'wrist')},
     "joint_names has 'wrist', expected only joints of this arm: ['shoulder', 'elbow']"),
    ({'names': ('elbow',)},
     "joint_names is ['elbow'], which lacks ['shoulder'], expected all of ['shoulder', 'elbow']"),
    ({'names': ('elbow', 'shoulder', 'elbow')},
     "joint_names has 'elbow' twice, expected each name once"),
    ({'times': ()}, 'points is empty, expected at least one point'),
    ({'times': (-0.5, 1.0)}, 'points[0].time_from_start is -0.5, expected a number in '),
    ({'times': (1.0, 1e10)}, 'points[1].time_from_start is 1e+10, expected a number in '),
    ({'times': (0.0, math.nan)}, 'points[1].time_from_start is nan, expected a finite number'),
    ({'times': (0.0, math.inf)}, 'points[1].time_from_start is inf, expected a finite number'),
    ({'times': (0.0, 'soon')}, "points[1].time_from_start is 'soon', expected a finite number"),
    ({'times': (1.0, 1.0)}, 'points[1].time_from_start is 1.0 s, expected more than the 1.0 s of '
                            'points[0], by 1 ns or more'),
    ({'times': (2.0, 1.5)}, 'points[1].time_from_start is 1.5 s, expected more than the 2.0 s'),
    ({'times': (1.0, 1.0 + 2e-10)}, 'points[1].time_from_start is 1.0000000002 s'),
    ({'q': ()}, 'points[0].positions is empty, expected 2 values, one for each of '
                "['shoulder', 'elbow']: a point needs its positions"),
    ({'q': ((0.1, 0.2), ())}, 'points[1].positions is empty, expected 2 values'),
    ({'q': ((0.1, 0.2),)}, 'positions has 1 rows, expected 2, one for each point'),
    ({'q': ((0.1, 0.2), (0.3,))}, 'points[1].positions has 1 values, expected 2, one for each of '
                                  "['shoulder', 'elbow']"),
    ({'q': (0.1, 0.2)}, 'points[0].positions has an array of shape (), expected 2'),
    ({'q': ((0.1, 0.2), (0.3, 'far'))},
     "points[1].positions[1] (elbow) is 'far', expected a finite number"),
    ({'q': ((0.1, 0.2), (0.3, '0.4'))},
     "points[1].positions[1] (elbow) is '0.4', expected a finite number"),
    ({'q': ((0.1, None), (0.3, 0.4))},
     f'points[0].positions[1] (elbow) is {None}, expected a finite number'),
    ({'times': (False, 1.0)}, 'points[0].time_from_start is False, expected a finite number'),
    ({'q': ((0.1, 0.2), (0.3, 10**400))}, 'points[1].positions[1] (elbow) is 1000'),
    ({'q': ((0.1, math.nan), (0.3, 0.4))},
     'points[0].positions[1] (elbow) is nan, expected a finite number'),
    ({'q': ((0.1, 0.2), (0.3, 1e308))},
     'points[1].positions[1] (elbow) is 1e+308, expected a number in [-1e+09, 1e+09]'),
    ({'v': ((-2e9, 0.2), (0.0, 0.0))}, 'points[0].velocities[0] (shoulder) is -2e+09, expected'),
    ({'v': ((0.1, 0.2, 0.3), (0.0, 0.0))}, 'points[0].velocities has 3 values, expected 2'),
    ({'v': ((-math.inf, 0.0), (0.0, 0.0))}, 'points[0].velocities[0] (shoulder) is -inf'),
    ({'v': ((0.1, 0.2),) * 3}, 'velocities has 3 rows, expected 2, one for each point'),
    ({'v': ((0.1, 0.2), (0.0, 0.3))},
     'points[1].velocities[1] (elbow) is 0.3, expected 0 at the last point, where the arm '
     'has to be at rest'),
    ({'v': ()}, 'points[0].velocities is empty although accelerations are given, expected 2 '
     'values, one for'),
    ({'a': ((0.1, 0.2), (0.0,))}, 'points[1].accelerations has 1 values, expected 2'),
    ({'a': ((0.1, 0.2), (0.0, math.nan))}, 'points[1].accelerations[1] (elbow) is nan'),
]


@pytest.mark.parametrize(('change', 'words'), REFUSALS, ids=[words for _, words in REFUSALS])
def test_a_refusal_names_point_field_value_and_expectation(change, words):
    assert isinstance(trajectory(**GOOD), JointTrajectory)
    with pytest.raises(TrajectoryError) as refusal:
        trajectory(**{**GOOD, **change})
    assert words in str(refusal.value)


def test_the_documented_words_are_the_words():
    page = (Path(__file__).parents[2] / 'docs' / 'trajectories.md').read_text(encoding='utf-8')
    table = page.split('## Rejected trajectories')[1].split('\n## ')[0]
    documented = re.findall(r'^\|[^|]+\| `(.+)` \|$', table, re.MULTILINE)
    spoken = set()
    for change, _ in REFUSALS:
        with pytest.raises(TrajectoryError) as refusal:
            trajectory(**{**GOOD, **change})
        spoken.add(str(refusal.value))
    with pytest.raises(TrajectoryError) as refusal:
        TrajectoryFollower(JOINTS).start(
            trajectory(), 10 * SECOND, (0.0, 0.0), (0.0, 0.0), stamp_ns=7 * SECOND)
    spoken.add(str(refusal.value))
    urdf = default_arm_urdf().replace('joint1', 'shoulder').replace('joint2', 'elbow').replace(
        'type="continuous"', 'type="revolute"').replace('<limit ', '<limit lower="-2" upper="2" ')
    for change in ({'q': ((0.1, 0.2), (0.3, 2.5))}, {'v': ((0.1, 11.0), (0.0, 0.0))}):
        with pytest.raises(TrajectoryError) as refusal:
            check_points(load_arm(urdf), trajectory(**{**GOOD, **change}))
        spoken.add(str(refusal.value))
    unread = [words for words in documented  # by test_message_bytes
              if words.endswith('would delay control') or 'cannot be read' in words]
    assert (len(documented), len(unread)) == (19, 3)
    assert [words for words in documented if words not in spoken] == unread


def test_the_index_in_a_refusal_is_the_senders():
    with pytest.raises(TrajectoryError, match=r'velocities\[0\] \(elbow\) is 0.3'):
        trajectory(v=((0.0, 0.0), (0.3, 0.0)), names=('elbow', 'shoulder'))


# Generation of trajectories --------------------------------------------------------------------

@laws
@given(q0=vectors, q1=vectors, T=spans, s=st.floats(0.0, 1.0))
def test_point_to_point_is_the_fifth_order_time_scaling(q0, q1, T, s):
    path = quintic_point_to_point(JOINTS, q0, q1, T)
    active = ActiveTrajectory(path, EPOCH, EPOCH, REST)
    span = round(s * T * SECOND)
    t = span / SECOND / T
    scaling = 10 * t**3 - 15 * t**4 + 6 * t**5
    found = active.sample(EPOCH + span).position
    np.testing.assert_allclose(found, q0 + scaling * (q1 - q0), atol=1e-6)


def test_point_to_point_has_the_known_greatest_velocity():
    path = quintic_point_to_point(JOINTS, (0.0, 0.0), (1.0, -2.0), 4.0)
    middle = ActiveTrajectory(path, EPOCH, EPOCH, REST).sample(EPOCH + 2 * SECOND)
    np.testing.assert_allclose(middle.velocity, 15.0 / 8.0 / 4.0 * np.array([1.0, -2.0]))
    np.testing.assert_allclose(middle.acceleration, 0.0, atol=1e-12)


@pytest.mark.parametrize('duration', [0.0, -1.0, math.nan])
def test_point_to_point_refuses_a_duration_that_is_none(duration):
    with pytest.raises(TrajectoryError, match=r'points\[1\].time_from_start is'):
        quintic_point_to_point(JOINTS, (0.0, 0.0), (1.0, 1.0), duration)


def segment_polynomials(path: JointTrajectory, joint: int) -> list[np.polynomial.Polynomial]:
    """Return one polynomial of the time since the start per segment, fitted to samples."""
    found = []
    for p0, p1 in pairwise(path.points):
        T = p1.time_from_start - p0.time_from_start
        t = np.linspace(0.0, T, 6)
        q = [sample_segment(x, 0.0, p0, T, p1).position[joint] for x in t]
        found.append(np.polynomial.Polynomial.fit(t, q, 5, domain=(0.0, T)))
    return found


def squared_jerk(path: JointTrajectory, joint: int) -> float:
    total = 0.0
    for polynomial in segment_polynomials(path, joint):
        integral = (polynomial.deriv(3) ** 2).integ()
        total += integral(polynomial.domain[1]) - integral(polynomial.domain[0])
    return float(total)


VIA_TIMES = (0.5, 1.2, 2.0, 3.5, 4.0)
VIA_POSITIONS = ((0.0, 1.0), (0.5, -0.3), (0.2, 0.8), (1.0, 0.0), (0.4, 0.1))


def test_via_points_are_met_and_jerk_and_snap_are_continuous():
    path = quintic_via_points(JOINTS, VIA_TIMES, VIA_POSITIONS)
    np.testing.assert_array_equal([p.position for p in path.points], VIA_POSITIONS)
    for end in (path.points[0], path.points[-1]):
        np.testing.assert_array_equal((end.velocity, end.acceleration), np.zeros((2, 2)))
    for joint in (0, 1):
        for left, right in pairwise(segment_polynomials(path, joint)):
            for order in range(5):
                before = left.deriv(order)(left.domain[1]) if order else left(left.domain[1])
                after = right.deriv(order)(0.0) if order else right(0.0)
                assert before == pytest.approx(after, rel=1e-7, abs=1e-7), (joint, order)


def test_via_points_have_the_least_jerk():
    path = quintic_via_points(JOINTS, VIA_TIMES, VIA_POSITIONS)
    q, v, a = (
        np.array([getattr(p, name) for p in path.points])
        for name in ('position', 'velocity', 'acceleration'))
    least = [squared_jerk(path, joint) for joint in (0, 1)]
    rng = np.random.default_rng(11)
    for _ in range(10):
        dv, da = (np.vstack((np.zeros(2), x, np.zeros(2))) for x in rng.normal(size=(2, 3, 2)))
        other = trajectory(VIA_TIMES, q, v + 0.01 * dv, a + 0.01 * da)
        for joint in (0, 1):
            assert squared_jerk(other, joint) > least[joint]


def test_two_via_points_are_point_to_point():
    via = quintic_via_points(JOINTS, (0.0, 2.0), ((0.0, 1.0), (2.0, 3.0)))
    straight = quintic_point_to_point(JOINTS, (0.0, 1.0), (2.0, 3.0), 2.0)
    for left, right in zip(via.points, straight.points):
        for name in ('time_from_start', 'position', 'velocity', 'acceleration'):
            np.testing.assert_array_equal(getattr(left, name), getattr(right, name))


def test_one_via_point_is_refused():
    with pytest.raises(TrajectoryError, match='1 point, expected at least a start and a goal'):
        quintic_via_points(JOINTS, (1.0,), ((0.0, 1.0),))
