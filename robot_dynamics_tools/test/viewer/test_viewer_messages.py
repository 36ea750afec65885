# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Messages of the viewer: references, loads and pushes that it sends, and received states."""

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Vector3
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import numpy.testing as npt
import pinocchio as pin
import pytest
from robot_dynamics.arrays import wrap_to_pi
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.references.reference_generator import ReferenceGenerator
from robot_dynamics.ros.middleware.conversions import payload_from_ros, trajectory_from_ros
from robot_dynamics.trajectories.quintics import quintic_point_to_point
from robots import must_have_everything
from sampled_segment import sample_segment
from sensor_msgs.msg import JointState

if not must_have_everything():
    pytest.importorskip('viser', reason='the viewer needs viser')
    pytest.importorskip('trimesh', reason='the viewer needs trimesh')
from robot_dynamics_tools.viewer import actions
from robot_dynamics_tools.viewer.app import values_of
from robot_dynamics_tools.viewer.node import worst_words
from viewer_bench import arm_called, one_joint

SECOND = 1_000_000_000
RISE_TIME, SHORTEST_MOTION = 0.25, 0.5
"""[s] from rest to the largest velocity at least, and of a motion at least."""


def check_motion_time(arm, fastest, q, goal, speed):
    """Check on the motion that no joint is too fast, and that the motion is not slower."""
    T = actions.motion_time(arm, q, goal, speed)
    turns = np.array(arm.joint_kinds) == 'continuous'  # dynamics takes the shorter direction
    goal = np.where(turns, q + wrap_to_pi(goal - q), goal)
    p0, p1 = quintic_point_to_point(arm.joint_names, q, goal, T).points
    samples = [sample_segment(t, 0.0, p0, T, p1) for t in np.linspace(0.0, T, 401)]
    v = np.abs([sample.velocity for sample in samples]).max(axis=0) / (speed * fastest)
    a = np.abs([sample.acceleration for sample in samples]).max(axis=0) / (speed * fastest)
    used = max(v.max(), RISE_TIME * a.max(), SHORTEST_MOTION / T)
    assert used == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize('name', ['default', 'panda'])
def test_no_motion_is_too_fast_and_none_takes_longer_than_that(name):
    arm = arm_called(name)
    positions = st.lists(
        st.floats(-3.0, 3.0), min_size=arm.joint_count, max_size=arm.joint_count).map(np.array)

    @settings(deadline=None, derandomize=True, max_examples=30)
    @given(positions, positions, st.floats(0.05, 1.0))
    def check(q, goal, speed):
        check_motion_time(arm, arm.limits.velocity, q, goal, speed)

    check()


@pytest.mark.parametrize('way', [1e-6, 0.01, 3.0])
def test_joints_without_a_limit_have_a_moderate_speed(way):
    for kind, limit, fastest in (
            ('continuous', '', 1.0), ('prismatic', 'lower="-5" upper="5"', 0.25),
            ('revolute', 'lower="-5" upper="5" velocity="0"', 1.0)):
        arm = one_joint(kind, limit)
        check_motion_time(arm, np.array([fastest]), np.zeros(1), np.array([way]), 0.5)


def test_a_reference_arrives_at_rest_and_stays():
    arm, seconds = arm_called('panda'), 1.2345678901
    q, goal = np.linspace(-0.3, 0.3, arm.joint_count), np.linspace(0.7, -0.5, arm.joint_count)
    message = actions.reference_to(arm, goal, seconds, 'me')
    assert (message.header.frame_id, message.header.stamp) == ('me', Time())  # starts immediately
    first, second = (point.time_from_start.sec for point in message.points)
    assert second - first == 3600  # [s] that it holds the goal
    trajectory = trajectory_from_ros(message, arm.joint_names)
    assert not trajectory.is_set_point
    follower = ReferenceGenerator(arm.joint_names)
    follower.start(trajectory, 7 * SECOND, q, np.zeros(arm.joint_count))
    for later in (0.0, 1.0, 1800.0, 7200.0):
        reference = follower.sample(7 * SECOND + round((seconds + later) * SECOND))
        npt.assert_allclose(reference.position, goal, atol=1e-9)
        npt.assert_allclose(np.concatenate(reference[1:]), 0.0, atol=1e-6)


@settings(deadline=None, derandomize=True)
@given(st.floats(1e-3, 1e3))
def test_a_load_is_a_ball_that_is_accepted(mass):
    arm = arm_called('default')
    payload = payload_from_ros(arm, actions.ball('tool0', mass))
    assert (payload.link, payload.mass, *payload.com) == ('tool0', mass, 0.0, 0.0, 0.0)
    radius = np.sqrt(payload.inertia[0, 0] / (0.4 * mass))
    npt.assert_allclose(payload.inertia, 0.4 * mass * radius**2 * np.eye(3), atol=1e-15)
    assert 2000.0 * 4.0 / 3.0 * np.pi * radius**3 == pytest.approx(mass)


def test_no_mass_clears_a_load_and_a_strange_one_is_refused():
    assert payload_from_ros(arm_called('default'), actions.ball('tool0', 0.0)) is None
    with pytest.raises(InvalidInputError, match='payload'):
        actions.ball('tool0', float('nan'))


@settings(deadline=None, derandomize=True)
@given(*2 * [st.tuples(*3 * [st.floats(-200.0, 200.0)])])
def test_a_push_is_the_same_force_whatever_the_link_is_turned_by(turn, force):
    R = pin.exp3(np.array(turn))
    message = actions.force_on('hand', np.array(force), R)
    f = message.wrench.force
    assert message.header.frame_id == 'hand'
    npt.assert_allclose(R @ [f.x, f.y, f.z], force, atol=1e-9)
    assert message.wrench.torque == Vector3()


def test_values_are_found_by_name():
    arm = arm_called('default')
    state = JointState(
        name=['joint2', 'finger', 'joint1'], position=[2.0, float('nan'), 1.0], velocity=[4.0])
    npt.assert_array_equal(values_of(arm, state), [1.0, 2.0])
    assert values_of(arm, state, 'velocity') is None
    for position in ([], [1.0], [1.0, float('nan')], [float('inf'), 1.0]):
        assert values_of(arm, JointState(name=['joint1', 'joint2'], position=position)) is None


def test_a_status_that_is_not_ok_is_shown_by_its_name():
    levels = [getattr(DiagnosticStatus, name) for name in ('OK', 'WARN', 'ERROR', 'STALE')]
    message = DiagnosticArray(status=[
        DiagnosticStatus(name=f'/left/dynamics: part {i}', message=f'why {i}', level=level)
        for i, level in enumerate(levels)])
    assert worst_words(message) == ['part 1: why 1', 'part 2: why 2', 'part 3: why 3']
