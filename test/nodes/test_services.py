# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The services of `dynamics` over DDS: results, units, orders of joints, and warnings.

Two nodes serve all tests: one of the planar arm, and one of an arm with prismatic fingers, one of
them a mimic joint.
"""

from collections.abc import Iterator
from typing import Any

from disturbances import wrench
from geometry_msgs.msg import Point
import numpy as np
import pinocchio as pin
import pytest
from robot_dynamics.model import ArmDerivatives, ArmModel, ExternalWrench
from robot_dynamics.ros.middleware.conversions import (
    floats_to_ros,
    trajectory_from_ros,
    trajectory_to_ros,
)
from robot_dynamics.task_space import TaskSpace, TaskSpaceState
from robot_dynamics.trajectories import efforts_along, make_trajectory, retime
from robot_dynamics.trajectories.quintics import quintic_via_points
from robots import robot_urdf
from ros_harness import DYNAMICS, NodeProcess, RosClient
from service_bench import Q, Served, served, V
from service_requests import SERVICES
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint


@pytest.fixture(scope='module')
def robot(client: RosClient) -> Iterator[Served]:
    with served(client, '/panda', robot_urdf('panda')) as node:
        yield node


def some_state(arm: ArmModel, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a position within the limits, a velocity and an acceleration."""
    random = np.random.default_rng(seed)
    low, high = np.maximum(arm.limits.lower, -2.0), np.minimum(arm.limits.upper, 2.0)
    n = arm.joint_count
    return random.uniform(low, high), random.uniform(-1, 1, n), random.uniform(-2, 2, n)


# --- real robots ---------------------------------------------------------------------------------

def test_numbers_are_those_of_the_library(robot):
    arm, dynamics = robot.arm, robot.dynamics
    q, v, a = some_state(arm, 1)
    fields = {'position': floats_to_ros(q), 'velocity': floats_to_ros(v)}
    response = robot.answer('inverse_dynamics', acceleration=floats_to_ros(a), **fields)
    terms = dynamics.terms(q, v, a)
    assert tuple(response.joint_names) == tuple(response.terms.joint_names) == arm.joint_names
    assert list(response.effort) == terms.effort.tolist()
    assert response.terms.kinetic_energy == terms.kinetic_energy
    assert response.terms.potential_energy == terms.potential_energy
    assert response.terms.header.stamp.sec > 0
    assert len(response.effort_deviation) == 0  # the arm has no uncertainty
    for name in ('inertial', 'coriolis', 'gravity', 'friction', 'external'):
        assert list(getattr(response.terms, name)) == getattr(terms, name).tolist()
    back = robot.answer('forward_dynamics', effort=response.effort, **fields)
    assert back.acceleration == pytest.approx(a, rel=1e-6, abs=1e-6)
    equation = robot.answer('manipulator_equation', **fields)
    n = arm.joint_count
    M = np.reshape(equation.mass_matrix, (n, n))
    assert pytest.approx(dynamics.rigid_body.mass_matrix(q)) == M
    assert M @ a + equation.nonlinear + equation.friction == pytest.approx(terms.effort)
    assert np.reshape(equation.coriolis_matrix, (n, n)) @ v + equation.gravity == (
        pytest.approx(np.array(equation.nonlinear)))
    assert equation.kinetic_energy == pytest.approx(0.5 * v @ M @ v)
    assert list(equation.christoffel) == []  # without `include_christoffel`


def test_the_order_of_a_request_is_that_of_its_answer(robot):
    q, v, a = some_state(robot.arm, 2)
    n = robot.arm.joint_count
    order = np.random.default_rng(5).permutation(n)
    names = [robot.arm.joint_names[i] for i in order]
    fields = {'joint_names': names, 'position': floats_to_ros(q[order]),
              'velocity': floats_to_ros(v[order])}
    response = robot.answer('inverse_dynamics', acceleration=floats_to_ros(a[order]), **fields)
    terms = robot.dynamics.terms(q, v, a)
    assert list(response.joint_names) == list(response.terms.joint_names) == names
    assert response.effort == pytest.approx(terms.effort[order])
    for name in ('inertial', 'coriolis', 'gravity', 'friction', 'external', 'effort'):
        assert getattr(response.terms, name) == pytest.approx(getattr(terms, name)[order])
    back = robot.answer('forward_dynamics', effort=response.effort, **fields)
    assert back.acceleration == pytest.approx(a[order], rel=1e-6, abs=1e-6)
    equation = robot.answer('manipulator_equation', include_christoffel=True, **fields)
    M = robot.dynamics.rigid_body.mass_matrix(q)
    assert np.reshape(equation.mass_matrix, (n, n)) == pytest.approx(M[np.ix_(order, order)])
    c = np.reshape(equation.christoffel, (n, n, n))
    assert c @ v[order] == pytest.approx(np.reshape(equation.coriolis_matrix, (n, n)))


def test_wrenches_on_a_link_count(robot):
    arm, link = robot.arm, robot.arm.link_names[-1]
    q, v, a = some_state(arm, 3)
    force, torque = (1.0, -2.0, 3.0), (0.3, 0.2, -0.1)
    fields = {'position': floats_to_ros(q), 'velocity': floats_to_ros(v),
              'external_wrenches': [wrench(link, force, torque), wrench(link, force, torque)]}
    response = robot.answer('inverse_dynamics', acceleration=floats_to_ros(a), **fields)
    twice = ExternalWrench(link, 2.0 * np.array(force), 2.0 * np.array(torque))
    assert response.effort == pytest.approx(robot.dynamics.inverse_dynamics(q, v, a, [twice]))
    assert response.terms.external == pytest.approx(robot.dynamics.rigid_body.external(q, [twice]))
    back = robot.answer('forward_dynamics', effort=response.effort, **fields)
    assert back.acceleration == pytest.approx(a, rel=1e-6, abs=1e-6)


def test_a_thousand_samples_at_once(robot):
    rows = np.random.default_rng(7).uniform(-1.0, 1.0, (3, 1000, robot.arm.joint_count))
    response = robot.answer('inverse_dynamics_batch', **{
        field: floats_to_ros(row)
        for field, row in zip(('position', 'velocity', 'acceleration'), rows)})
    effort = np.reshape(response.effort, rows[0].shape)
    assert effort[499] == pytest.approx(robot.dynamics.inverse_dynamics(*rows[:, 499]))
    assert effort == pytest.approx(robot.dynamics.inverse_dynamics_batch(*rows))


# --- warnings ------------------------------------------------------------------------------------

def test_a_state_outside_the_limits_is_answered_with_a_warning(robot):
    arm = robot.arm
    q, v, a = some_state(arm, 6)
    limited = int(np.argmax(np.isfinite(arm.limits.upper)))
    q[limited] = arm.limits.upper[limited] + 0.1
    v[0] = 2.0 * arm.limits.velocity[0]
    response = robot.answer(
        'inverse_dynamics', position=floats_to_ros(q), velocity=floats_to_ros(v),
        acceleration=floats_to_ros(a))
    assert response.effort == pytest.approx(robot.dynamics.inverse_dynamics(q, v, a))
    fields = {'position': floats_to_ros(q), 'velocity': floats_to_ros(v)}
    back = robot.answer('forward_dynamics', effort=response.effort, **fields)
    equation = robot.answer('manipulator_equation', **fields)
    for field, joint in (('position', limited), ('velocity', 0)):
        words = f"{field} of '{arm.joint_names[joint]}' is "
        for answer in (response, back, equation):
            assert any(line.startswith(words) for line in answer.warnings), answer.warnings


def test_an_effort_beyond_its_limit_is_a_warning(planar):
    response = planar.answer('inverse_dynamics', position=Q, acceleration=[100.0, 0.0])
    assert [line.split(' is ')[0] for line in response.warnings] == [
        "effort of 'joint1'", "effort of 'joint2'"]
    assert '[-150, 150]' in response.warnings[0]
    back = planar.answer('forward_dynamics', position=Q, effort=response.effort)
    assert back.warnings == response.warnings


def test_a_batch_warns_of_the_worst_sample_of_each_joint(planar):
    velocity = [*V, 12.0, 0.0, -20.0, 30.0, 11.0, 0.0]  # the limit is 10 rad/s
    response = planar.answer('inverse_dynamics_batch', position=Q * 4, velocity=velocity)
    speeds = [line for line in response.warnings if line.startswith('velocity')]
    assert speeds == [
        f"velocity of '{joint}' is {v} in sample 2, outside its limits [-10, 10]"
        for joint, v in (('joint1', '-20'), ('joint2', '30'))]


# --- trajectories --------------------------------------------------------------------------------

def test_a_trajectory_gets_its_efforts(planar):
    path = quintic_via_points(
        planar.arm.joint_names, (0.0, 1.0, 2.5), [[0.0, 0.0], [1.5, -0.4], [0.2, 1.0]])
    message = trajectory_to_ros(path)
    message.header.frame_id = 'kept'
    response = planar.answer('inverse_dynamics_trajectory', trajectory=message)
    expected = efforts_along(planar.dynamics, path)
    assert response.trajectory.header.frame_id == 'kept'
    for sent, returned, effort in zip(
            message.points, response.trajectory.points, expected.efforts, strict=True):
        assert returned.positions == sent.positions
        assert returned.time_from_start == sent.time_from_start
        assert returned.effort == pytest.approx(effort)
    assert response.feasible
    assert list(response.warnings) == []
    assert response.worst_joint == expected.worst_joint
    assert response.worst_ratio == pytest.approx(expected.worst_ratio)
    assert response.worst_time == expected.worst_time
    response = planar.answer('inverse_dynamics_trajectory', trajectory=JointTrajectory(
        joint_names=['joint2', 'joint1'], points=[JointTrajectoryPoint(positions=Q[::-1])]))
    assert response.trajectory.joint_names == ['joint2', 'joint1']
    assert response.trajectory.points[0].effort == pytest.approx(
        [-11.37087883, -49.52282521], abs=5e-9)
    path = quintic_via_points(
        planar.arm.joint_names, (0.0, 0.15, 0.3), [[0.0, 0.0], [1.5, 0.5], [0.0, 0.0]])
    response = planar.answer('inverse_dynamics_trajectory', trajectory=trajectory_to_ros(path))
    assert not response.feasible
    assert response.warnings[-1] == response.message
    assert response.message.startswith(f'effort of {response.worst_joint!r} is ')


# --- task space and derivatives ------------------------------------------------------------------

POINT = (0.1, -0.2, 0.05)
LINK = 'panda_hand'


def states_of(node: Served, count: int) -> tuple[Any, Any]:
    rng, n = np.random.default_rng(11), node.arm.joint_count
    q = rng.normal(size=(count, n))
    q[0] = 0.0  # singular
    return q, rng.normal(size=(count, n))


def assert_equal(response: Any, states: TaskSpaceState, columns: list[int]) -> None:
    """Compare a response with the library; `columns` are the arm's joints in its order."""
    samples, n = len(states.rank), len(columns)
    for name in (
            'bias_acceleration', 'inverse_inertia', 'inertia', 'gravity_force', 'coriolis_force',
            'translation_singular_values', 'rotation_singular_values',
            'translation_manipulability', 'rotation_manipulability'):
        np.testing.assert_allclose(
            getattr(response, name), getattr(states, name).ravel(), rtol=1e-9, atol=1e-9)
    assert list(response.rank) == states.rank.tolist()
    J = np.reshape(response.jacobian, (samples, 6, n))
    np.testing.assert_allclose(J, states.jacobian[:, :, columns], atol=1e-12)
    inverse = np.reshape(response.dynamic_inverse, (samples, n, 6))
    np.testing.assert_allclose(inverse, states.dynamic_inverse[:, columns], atol=1e-9)
    margin = np.reshape(response.position_margin, (samples, n))
    np.testing.assert_allclose(margin, states.position_margin[:, columns])
    for pose, place, rotation in zip(
            response.pose, states.translation, states.rotation, strict=True):
        p, o = pose.position, pose.orientation
        np.testing.assert_allclose((p.x, p.y, p.z), place, atol=1e-12)
        turned = pin.Quaternion(o.w, o.x, o.y, o.z).toRotationMatrix()
        np.testing.assert_allclose(turned, rotation, atol=1e-12)
    lost = np.reshape(response.lost_directions, (-1, 6))
    assert len(lost) == (6 - states.rank).sum()


@pytest.mark.parametrize('reference', ['', 'local'])
def test_task_space_is_that_of_the_library(robot, reference):
    q, v = states_of(robot, 4)
    x, y, z = POINT
    order = -1 if reference else 1
    names = robot.arm.joint_names[::order]
    response = robot.answer(
        'task_space', frame=LINK, point=Point(x=x, y=y, z=z), reference=reference,
        joint_names=names, position=q[:, ::order].ravel().tolist(),
        velocity=v[:, ::order].ravel().tolist())
    expected = TaskSpace(robot.arm, LINK, POINT, reference or 'base_aligned').batch(q, v)
    assert list(response.joint_names) == list(names)
    assert_equal(response, expected, list(range(8))[::order])
    assert any('position' in warning for warning in response.warnings)


def test_derivatives_on_request(robot):
    rng, n = np.random.default_rng(13), 8
    q, v, a = rng.normal(size=(3, n))
    names = robot.arm.joint_names[::-1]
    fields = {'joint_names': names, 'position': q[::-1].tolist(), 'velocity': v[::-1].tolist(),
              'acceleration': a[::-1].tolist()}
    without = robot.answer('inverse_dynamics', **fields)
    response = robot.answer('inverse_dynamics', include_derivatives=True, **fields)
    by = ArmDerivatives(robot.arm).inverse_dynamics(q, v, a)
    for name in ('position', 'velocity', 'acceleration'):
        given = np.reshape(getattr(response, f'effort_{name}_derivative'), (n, n))
        np.testing.assert_allclose(given, getattr(by, name)[::-1, ::-1], atol=1e-9)
        assert not len(getattr(without, f'effort_{name}_derivative'))
    assert list(response.effort) == list(without.effort)


# --- retiming ------------------------------------------------------------------------------------

POINTS = [[0.0, 0.0], [0.9, -0.4], [0.2, 1.0]]


def request(node: Served) -> JointTrajectory:
    return trajectory_to_ros(quintic_via_points(node.arm.joint_names, (0.0, 0.7, 1.5), POINTS))


def test_a_retimed_trajectory_is_that_of_the_library(planar):
    response = planar.answer('retime_trajectory', trajectory=request(planar))
    path = trajectory_from_ros(request(planar), planar.arm.joint_names)
    rates = 0.75 * np.array([1500.0, 600.0])
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


def test_the_order_of_limits_and_points_is_that_of_the_request(planar):
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
    for point, other in zip(response.trajectory.points, expected.trajectory.points, strict=True):
        assert list(point.positions) == list(other.positions[::-1])
        assert list(point.velocities) == list(other.velocities[::-1])
        assert list(point.effort) == list(other.effort[::-1])


def test_the_effort_limit_fraction_is_that_of_the_node_and_slow_down_keeps_the_points(planar):
    message = request(planar)
    fields = {'trajectory': message, 'efforts_may_jump': True}
    full = planar.answer('retime_trajectory', effort_limit_fraction=1.0, **fields)
    named = planar.answer('retime_trajectory', effort_limit_fraction=0.7, **fields)
    planar.client.set_parameters('/planar/dynamics', {'effort_limit_fraction': 0.7})
    of_node = planar.answer('retime_trajectory', **fields)
    planar.client.set_parameters('/planar/dynamics', {'effort_limit_fraction': 1.0})
    assert of_node.duration == named.duration > full.duration
    path = trajectory_from_ros(message, planar.arm.joint_names)
    assert full.duration == pytest.approx(retime(planar.dynamics, path).duration)
    assert full.duration < planar.answer('retime_trajectory', trajectory=message).duration
    assert not len(full.trajectory.points[1].accelerations)
    response = planar.answer('retime_trajectory', trajectory=message, method='slow_down')
    assert response.ratio >= 1.0
    assert len(response.trajectory.points) == 3


def test_joint_states_are_answered_meanwhile(robot):
    arm = robot.arm
    t = np.linspace(0.0, 1.0, 1000)[:, np.newaxis]
    start = 0.5 * (np.maximum(arm.limits.lower, -2) + np.minimum(arm.limits.upper, 2))
    path = trajectory_to_ros(make_trajectory(
        arm.joint_names, 5.0 * t[:, 0], start + 0.2 * np.sin(3.0 * t + np.arange(len(start)))))
    robot.answer_while_streaming(start.tolist(), 'retime_trajectory', trajectory=path)


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


# --- before the model ----------------------------------------------------------------------------

def test_before_the_model_every_service_reports_it(client):
    with NodeProcess(DYNAMICS, {'joints': ['shoulder_pan_joint']}, namespace='/empty'):
        for service, kind in SERVICES.items():
            response = client.call(kind, f'/empty/dynamics/{service}')
            assert not response.success
            assert 'no model yet' in response.message
            assert list(response.warnings) == []
