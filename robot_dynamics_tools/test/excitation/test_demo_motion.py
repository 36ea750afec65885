# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The motion of the demo: smooth, at rest at both ends, and within every limit."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics.trajectories.quintics import quintic_point_to_point
from robot_dynamics_tools.excitation.demo_motion import (
    make_reference_motion,
    rest_to_rest_seconds,
    sample_trajectory,
)
from robots import robot_urdf

DEFAULT = 'default'
ARMS = (DEFAULT, 'ur10', 'panda', 'tiago_no_hand')
SHARE = 0.6  # of the limits of velocity and effort that a motion uses at most
ACCELERATION = 6.0  # [rad/s², m/s²], the largest one
TOLERANCE = 1.02  # the planner checked the limits at fewer instants than this test


def arm_called(name):
    return load_arm(robot_urdf(name))


def check_limits(arm, motion, duration):
    """Check a motion densely, with efforts computed sample by sample."""
    times = np.linspace(0.0, duration, 1501)
    q, v, a = sample_trajectory(motion.trajectory, times)
    limits = arm.limits
    span = np.where(np.isfinite(limits.upper - limits.lower), limits.upper - limits.lower, 0.0)
    margin = 0.9 * 0.05 * span
    assert (q >= limits.lower + margin).all()
    assert (q <= limits.upper - margin).all()
    assert (np.abs(v) <= TOLERANCE * SHARE * limits.velocity).all()
    assert np.abs(a).max() <= TOLERANCE * ACCELERATION
    dynamics = ArmDynamics(arm)
    held = np.abs(dynamics.rigid_body.gravity(motion.start) / limits.effort).max()
    allowed = SHARE if held <= SHARE else 0.5 * (1.0 + held)
    for i in range(0, len(times), 50):
        effort = dynamics.inverse_dynamics(q[i], v[i], a[i])
        assert (np.abs(effort) <= TOLERANCE * allowed * limits.effort).all()
    return q, v, a


@pytest.mark.parametrize(('name', 'duration'), [
    *((name, 10.0) for name in ARMS), (DEFAULT, 2.0), ('ur10', 2.0)])
def test_a_motion_keeps_all_limits_and_moves_every_joint(name, duration):
    arm = arm_called(name)
    motion = make_reference_motion(arm, duration)
    q, v, a = check_limits(arm, motion, duration)
    for ends in (0, -1):
        np.testing.assert_allclose(q[ends], motion.start, atol=1e-9)
        np.testing.assert_allclose(v[ends], 0.0, atol=1e-9)
        np.testing.assert_allclose(a[ends], 0.0, atol=1e-8)
    assert motion.trajectory.duration == duration
    assert (np.ptp(q, axis=0) > 1e-3).all()
    shapes = ((q - q[0]) / np.ptp(q, axis=0)).T[:6]  # the pattern has six joints
    assert duration < 10.0 or all(
        np.abs(shapes[i] - shapes[:i]).max(axis=1).min() > 0.1 for i in range(1, len(shapes)))
    assert name != DEFAULT or motion.start == pytest.approx([np.pi / 4, np.pi / 6])
    assert (name, duration) != ('ur10', 10.0) or 0.75 < np.abs(q - q[0]).max() < 0.85  # [rad]
    assert 0.0 < motion.effort_ratio < 1.0
    assert motion.worst_joint in arm.joint_names


@settings(max_examples=20)
@given(st.floats(0.5, 60.0), st.lists(st.floats(0.3, 3.0), min_size=1, max_size=4))
def test_any_planar_arm_any_duration(duration, lengths):
    n = len(lengths)
    arm = load_arm(planar_arm_urdf(
        [1.0] * n, lengths, [0.5 * length for length in lengths], [0.1] * n))
    check_limits(arm, make_reference_motion(arm, duration), duration)


def test_a_start_that_is_given_is_used():
    arm = arm_called('panda')
    start = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.7, 0.004])
    motion = make_reference_motion(arm, 5.0, start)
    np.testing.assert_array_equal(motion.start, start)
    q, _, _ = check_limits(arm, motion, 5.0)
    # the finger comes near its lower limit, up to 5 % of its range of 0.04 m
    assert q[:, 7].min() == pytest.approx(0.05 * 0.04, abs=1e-4)


def test_an_arm_near_its_limits_still_moves_below_them():
    # Held horizontally, this pendulum takes 80 % of its limit at any start of the search.
    arm = load_arm(planar_arm_urdf([1.0], [1.0], [0.5], [0.1], effort_limits=[4.905 / 0.8]))
    motion = make_reference_motion(arm, 5.0, np.array([np.pi / 2]))
    assert 0.79 < motion.effort_ratio <= 0.9
    check_limits(arm, motion, 5.0)


def test_invalid_values_are_rejected():
    arm = arm_called(DEFAULT)
    with pytest.raises(InvalidInputError, match=r'duration is 0\.49, expected a number >= 0\.5'):
        make_reference_motion(arm, 0.49)
    with pytest.raises(InvalidInputError, match='start has 1 values'):
        make_reference_motion(arm, 1.0, np.zeros(1))
    weak = load_arm(planar_arm_urdf([1.0], [1.0], [0.5], [0.1], effort_limits=[1.0]))
    with pytest.raises(InvalidInputError, match="'joint1' needs 4.91 times its effort limit of 1"):
        make_reference_motion(weak, 5.0, np.array([np.pi / 2]))
    panda = arm_called('panda')
    with pytest.raises(InvalidInputError, match="start of 'panda_joint4' is 1"):
        make_reference_motion(panda, 5.0, np.ones(8))


@pytest.mark.parametrize(('distance', 'velocity'), [
    ((2.0, -0.5), (1.0, 1.0)), ((0.1, -3.0), (0.2, 9.0)), ((0.01, 0.0), (5.0, np.inf))])
def test_a_point_to_point_motion_uses_its_limits(distance, velocity):
    T = rest_to_rest_seconds(np.array(distance), np.array(velocity))
    motion = quintic_point_to_point(('a', 'b'), (0.0, 0.0), distance, T)
    _, v, a = sample_trajectory(motion, np.linspace(0.0, T, 2001))
    used = max(np.max(np.abs(v) / velocity), np.max(np.abs(a)) / ACCELERATION)
    assert used == pytest.approx(1.0, rel=1e-3) if T > 0.5 else used < 1.0
