# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`~/retime_trajectory` over DDS: results, order of the joints, and joint states meanwhile."""


import numpy as np
import pytest
from robot_dynamics.ros.middleware.conversions import trajectory_from_ros, trajectory_to_ros
from robot_dynamics.trajectories import efforts_along, make_trajectory, retime
from robot_dynamics.trajectories.quintics import quintic_via_points
from robots import robot_urdf
from ros_harness import DYNAMICS, NodeProcess
from service_bench import Served, served
from simulated_arms import two_link
from trajectory_msgs.msg import JointTrajectory

POINTS = [[0.0, 0.0], [0.9, -0.4], [0.2, 1.0]]


def request(node: Served) -> JointTrajectory:
    return trajectory_to_ros(quintic_via_points(node.arm.joint_names, (0.0, 0.7, 1.5), POINTS))


def rate_of(node: Served) -> float:
    """Return the effort rate of the node."""
    return float(node.client.get_parameter('/planar/dynamics', 'effort_rate_limit'))


def test_the_result_is_that_of_the_library(planar):
    response = planar.answer('retime_trajectory', trajectory=request(planar))
    path = trajectory_from_ros(request(planar), planar.arm.joint_names)
    rates = 0.75 * rate_of(planar)
    expected = retime(planar.dynamics, path, effort_rate_limits=rates)
    assert response.duration == pytest.approx(expected.duration)
    assert response.ratio == pytest.approx(response.duration / 1.5)
    assert response.message == expected.summary
    result = trajectory_from_ros(response.trajectory, planar.arm.joint_names)
    efforts = efforts_along(planar.dynamics, result)
    assert efforts.worst_ratio <= 1.0 + 2e-6
    for point, effort in zip(response.trajectory.points, efforts.efforts, strict=True):
        assert point.effort == pytest.approx(effort)
    assert tuple(response.limiting_joint) == expected.limiting_joint
    assert tuple(response.limited_quantity) == expected.limited_quantity
    assert list(response.warnings) == []


def test_efforts_that_may_jump_are_faster(planar):
    slow = planar.answer('retime_trajectory', trajectory=request(planar))
    fast = planar.answer(
        'retime_trajectory', trajectory=request(planar), efforts_may_jump=True)
    path = trajectory_from_ros(request(planar), planar.arm.joint_names)
    assert fast.duration == pytest.approx(retime(planar.dynamics, path).duration)
    assert fast.duration < slow.duration
    assert not len(fast.trajectory.points[1].accelerations)
    assert len(slow.trajectory.points[1].accelerations) == 2


def test_the_order_is_that_of_the_request(planar):
    message = request(planar)
    expected = planar.answer(
        'retime_trajectory', trajectory=message, acceleration_limits=[5.0, 50.0])
    message.joint_names = message.joint_names[::-1]
    for point in message.points:
        point.positions, point.velocities, point.accelerations = (
            values[::-1] for values in (point.positions, point.velocities, point.accelerations))
    response = planar.answer(
        'retime_trajectory', trajectory=message, acceleration_limits=[50.0, 5.0])
    assert response.duration == expected.duration
    assert response.trajectory.joint_names == message.joint_names
    for point, other in zip(
            response.trajectory.points, expected.trajectory.points, strict=True):
        assert list(point.positions) == list(other.positions[::-1])
        assert list(point.velocities) == list(other.velocities[::-1])
        assert list(point.effort) == list(other.effort[::-1])


def test_the_effort_limit_fraction_is_that_of_the_node(client):
    with NodeProcess(DYNAMICS, {'effort_limit_fraction': 0.7}, namespace='/weak'):
        weak = Served(client, '/weak', two_link())
        message = request(weak)
        of_node = weak.answer('retime_trajectory', trajectory=message)
        named = weak.answer(
            'retime_trajectory', trajectory=message, effort_limit_fraction=0.7)
        full = weak.answer('retime_trajectory', trajectory=message, effort_limit_fraction=1.0)
    assert of_node.duration == named.duration > full.duration


def test_slow_down(planar):
    response = planar.answer(
        'retime_trajectory', trajectory=request(planar), method='slow_down')
    assert response.ratio >= 1.0
    assert len(response.trajectory.points) == 3


def test_joint_states_are_answered_meanwhile(client):
    with served(client, '/busy', robot_urdf('panda')) as node:
        arm = node.arm
        t = np.linspace(0.0, 1.0, 1000)[:, np.newaxis]
        start = 0.5 * (np.maximum(arm.limits.lower, -2) + np.minimum(arm.limits.upper, 2))
        path = trajectory_to_ros(make_trajectory(
            arm.joint_names, 5.0 * t[:, 0], start + 0.2 * np.sin(3.0 * t + np.arange(len(start)))))
        node.answer_while_streaming(start.tolist(), 'retime_trajectory', trajectory=path)


@pytest.mark.parametrize(('fields', 'words'), [
    ({}, 'points is empty'),
    ({'method': 'quick'}, "method is 'quick', expected one of"),
    ({'acceleration_limits': [1.0, -1.0]}, "acceleration_limits of 'joint2' is -1"),
])
def test_bad_requests_are_rejected_by_name(planar, fields, words):
    trajectory = request(planar) if fields else JointTrajectory()
    response = planar.ask('retime_trajectory', trajectory=trajectory, **fields)
    assert not response.success
    assert words in response.message
