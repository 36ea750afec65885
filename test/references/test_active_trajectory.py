# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Following trajectories: references in time, the replacement of a trajectory, late starts."""

import math

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.references.active_trajectory import ActiveTrajectory
from robot_dynamics.references.reference_generator import ReferenceGenerator
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from two_joint_trajectories import (
    assert_same,
    EPOCH,
    JOINTS,
    laws,
    REST,
    SECOND,
    smooth,
    trajectory,
    values,
)

# Active trajectories ---------------------------------------------------------------------------

@pytest.mark.parametrize(('fields', 'continuous'), [
    (1, (True, False, True)),  # linear: the acceleration is zero on both sides
    (2, (True, True, False)), (3, (True, True, True)),
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


# Replacement -----------------------------------------------------------------------------------

@laws
@given(span=st.integers(1, 4 * SECOND), delay=st.integers(0, SECOND))
def test_a_replacement_continues_from_the_active_reference(span, delay):
    follower = ReferenceGenerator(JOINTS)
    follower.start(smooth((0.5, 1.0, 3.0), 1), EPOCH, (0.0, 0.0), (0.0, 0.0))
    now = EPOCH + span
    before = follower.sample(now)
    follower.start(smooth((0.4, 2.0), 2), now, (9.0, 9.0), (9.0, 9.0), stamp_ns=now + delay)
    assert_same(follower.sample(now), before, 1e-12)
    after = follower.sample(now + 1000)
    np.testing.assert_allclose(after.position, before.position + 1e-6 * before.velocity, atol=1e-9)
    np.testing.assert_allclose(after.velocity, before.velocity, atol=1e-3)


def test_the_first_trajectory_continues_from_the_measured_state():
    follower = ReferenceGenerator(JOINTS)
    assert follower.sample(EPOCH) is None
    q, v = np.array([0.5, -0.5]), np.array([0.1, 0.2])
    active = follower.start(smooth((1.0, 2.0)), EPOCH, q, v)
    q[:] = v[:] = 7.0
    assert follower.active is active
    expected = Reference(np.array([0.5, -0.5]), np.array([0.1, 0.2]), np.zeros(2))
    assert_same(follower.sample(EPOCH), expected, 1e-14)


@pytest.mark.parametrize(('position', 'velocity', 'words'), [
    ((1e308, 0.0), (0.0, 0.0), r'position\[0\] \(shoulder\) is 1e\+308, expected a number in'),
    ((0.0, 0.0), (0.0, -1e200), r'velocity\[1\] \(elbow\) is -1e\+200, expected a number in'),
    ((0.0,), (0.0, 0.0), 'position has 1 values, expected 2'),
])
def test_a_measured_state_that_no_arm_has_starts_nothing(position, velocity, words):
    follower = ReferenceGenerator(JOINTS)
    with pytest.raises(InvalidInputError, match=words):
        follower.start(smooth((1.0, 2.0)), EPOCH, position, velocity)
    assert follower.active is None


def test_an_end_in_the_past_is_refused_and_changes_nothing():
    follower, now = ReferenceGenerator(JOINTS), 10 * SECOND
    in_force = follower.start(trajectory(), EPOCH, (0.0, 0.0), (0.0, 0.0))
    with pytest.raises(TrajectoryError) as refusal:
        follower.start(trajectory(), now, (0.0, 0.0), (0.0, 0.0), stamp_ns=8 * SECOND - 1)
    assert str(refusal.value) == (
        'header.stamp is 7.999999999 s and the last point comes 2 s later, which is 0.000000001 s '
        'before now (10.000000000 s), expected an end in the future, or a zero stamp to start now')
    assert follower.active is in_force
    assert follower.start(
        trajectory(), now, (0.0, 0.0), (0.0, 0.0), stamp_ns=8 * SECOND).end_ns == now


def test_a_set_point_may_be_late_by_a_second():
    follower = ReferenceGenerator(JOINTS)
    set_point = trajectory((0.0,), ((0.3, 0.4),), ((1.0, 0.0),))
    follower.start(set_point, EPOCH, (0.0, 0.0), (0.0, 0.0), stamp_ns=EPOCH - SECOND)
    np.testing.assert_array_equal(follower.sample(EPOCH).position, (0.3, 0.4))
    with pytest.raises(TrajectoryError, match='is 1.000000001 s before now'):
        follower.start(set_point, EPOCH, (0.0, 0.0), (0.0, 0.0), stamp_ns=EPOCH - SECOND - 1)


def test_other_joints_than_the_follower_has_are_refused():
    other = make_trajectory(JOINTS, (1.0,), ((0.1, 0.2),), (), (), JOINTS[::-1])
    with pytest.raises(TrajectoryError, match=r"\['elbow', 'shoulder'\], expected \['shoulder'"):
        ReferenceGenerator(JOINTS).start(other, EPOCH, (0.0, 0.0), (0.0, 0.0))


@laws
@given(q=values, target=values)
def test_a_continuous_joint_takes_the_shortest_angular_distance(q, target):
    follower = ReferenceGenerator(JOINTS, continuous_joints=('elbow',))
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
    follower = ReferenceGenerator(('wheel',), continuous_joints=('wheel',))
    target = turns * math.tau
    path = make_trajectory(('wheel',), (1.0,), ((target,),), (), (), ('wheel',))
    follower.start(path, EPOCH, (0.0,), (0.0,))
    assert target - follower.sample(EPOCH).position[0] == pytest.approx(way * math.tau, abs=1e-5)
