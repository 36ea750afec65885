# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The services of `dynamics` over DDS: results, units, orders of joints, and warnings."""

from collections.abc import Iterator

from disturbances import wrench
import numpy as np
import pytest
from robot_dynamics.model import ArmModel, ExternalWrench
from robot_dynamics.ros.middleware.conversions import floats_to_ros, trajectory_to_ros
from robot_dynamics.trajectories.efforts import efforts_along
from robot_dynamics.trajectories.quintics import quintic_via_points
from robots import robot_urdf
from ros_harness import DYNAMICS, NodeProcess, RosClient
from service_bench import Q, Served, served, V
from service_requests import SERVICES
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint


@pytest.fixture(scope='module', params=['panda', 'kinova', 'ur10', 'tiago_pro'])
def robot(client: RosClient, request: pytest.FixtureRequest) -> Iterator[Served]:
    with served(client, f'/{request.param}', robot_urdf(request.param)) as node:
        yield node


def some_state(arm: ArmModel, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a position within the limits, a velocity and an acceleration."""
    random = np.random.default_rng(seed)
    low, high = np.maximum(arm.limits.lower, -2.0), np.minimum(arm.limits.upper, 2.0)
    n = arm.joint_count
    return random.uniform(low, high), random.uniform(-1, 1, n), random.uniform(-2, 2, n)


# --- reference values of the planar arm ----------------------------------------------------------

def test_manipulator_equation_of_the_planar_arm(planar):
    response = planar.answer(
        'manipulator_equation', position=Q, velocity=V, include_christoffel=True)
    assert response.mass_matrix == pytest.approx(
        [6.95846097, 1.56923048, 1.56923048, 0.53], abs=5e-9)
    assert response.gravity == pytest.approx([-49.52282521, -11.37087883], abs=5e-9)
    C = np.reshape(response.coriolis_matrix, (2, 2))
    assert pytest.approx([-0.234, 0.15], abs=5e-9) == C @ V
    assert response.nonlinear == pytest.approx(C @ V + response.gravity)
    assert list(response.friction) == [0.0, 0.0]
    h = 3.0 * 1.0 * 0.4 * np.sin(Q[1])
    assert response.christoffel == pytest.approx([0.0, -h, -h, -h, h, 0.0, 0.0, 0.0], abs=1e-12)
    assert response.kinetic_energy == pytest.approx(1.12904219, abs=5e-9)


def test_velocity_and_acceleration_left_out_are_zero(planar):
    still = planar.answer('inverse_dynamics', position=Q)
    assert still.effort == pytest.approx([-49.52282521, -11.37087883], abs=5e-9)
    assert list(still.terms.inertial) == [0.0, 0.0]
    assert list(planar.answer('manipulator_equation', position=Q).friction) == [0.0, 0.0]
    released = planar.answer('forward_dynamics', position=Q, effort=[0.0, 0.0])
    M = planar.dynamics.rigid_body.mass_matrix(np.array(Q))
    assert M @ released.acceleration == pytest.approx([49.52282521, 11.37087883], abs=5e-9)


def test_before_the_model_every_service_reports_it(client):
    with NodeProcess(DYNAMICS, {'joints': ['shoulder_pan_joint']}, namespace='/empty'):
        for service, kind in SERVICES.items():
            response = client.call(kind, f'/empty/dynamics/{service}')
            assert not response.success
            assert 'no model yet' in response.message


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
    arm = robot.arm
    q, v, a = some_state(arm, 2)
    order = np.random.default_rng(5).permutation(arm.joint_count)
    names = [arm.joint_names[i] for i in order]
    fields = {'position': floats_to_ros(q[order]), 'velocity': floats_to_ros(v[order])}
    response = robot.answer(
        'inverse_dynamics', joint_names=names, acceleration=floats_to_ros(a[order]), **fields)
    tau = robot.dynamics.inverse_dynamics(q, v, a)
    assert list(response.joint_names) == names
    assert response.effort == pytest.approx(tau[order])
    assert response.terms.effort == pytest.approx(tau[order])
    back = robot.answer(
        'forward_dynamics', joint_names=names, effort=response.effort, **fields)
    assert back.acceleration == pytest.approx(a[order], rel=1e-6, abs=1e-6)
    equation = robot.answer(
        'manipulator_equation', joint_names=names, include_christoffel=True, **fields)
    n = arm.joint_count
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
    arm, random = robot.arm, np.random.default_rng(7)
    n = arm.joint_count
    rows = random.uniform(-1.0, 1.0, (3, 1000, n))
    response = robot.answer('inverse_dynamics_batch', **{
        field: floats_to_ros(row)
        for field, row in zip(('position', 'velocity', 'acceleration'), rows)})
    effort = np.reshape(response.effort, (1000, n))
    assert effort == pytest.approx(robot.dynamics.inverse_dynamics_batch(*rows))
    for i in (0, 499, 999):
        assert effort[i] == pytest.approx(robot.dynamics.inverse_dynamics(*rows[:, i]))


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


def test_within_the_limits_there_is_no_warning(planar):
    for service, fields in (
            ('inverse_dynamics', {}), ('manipulator_equation', {}),
            ('inverse_dynamics_batch', {}), ('forward_dynamics', {'effort': [0.0, 0.0]})):
        answer = planar.answer(service, position=Q, velocity=V, **fields)
        assert (answer.message, list(answer.warnings)) == ('', [])


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
    for index in range(4):  # the same efforts as one by one, with warnings of the same joints
        one = planar.answer(
            'inverse_dynamics', position=Q, velocity=velocity[2 * index:2 * index + 2])
        assert {line.split(' is ')[0] for line in one.warnings} <= {
            line.split(' is ')[0] for line in response.warnings}


def test_every_service_has_warnings():
    for name, service in SERVICES.items():
        assert service.Response.get_fields_and_field_types().get('warnings') == (
            'sequence<string>'), name


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


def test_a_trajectory_that_is_too_quick_is_not_feasible(planar):
    path = quintic_via_points(
        planar.arm.joint_names, (0.0, 0.15, 0.3), [[0.0, 0.0], [1.5, 0.5], [0.0, 0.0]])
    response = planar.answer('inverse_dynamics_trajectory', trajectory=trajectory_to_ros(path))
    assert not response.feasible
    assert response.worst_ratio > 1.0
    assert response.worst_joint in planar.arm.joint_names
    assert response.warnings[-1] == response.message
    assert response.message.startswith(f'effort of {response.worst_joint!r} is ')


@pytest.mark.parametrize('names', [['joint2', 'joint1'], []])
def test_a_trajectory_is_in_its_own_order_or_in_the_nodes(planar, names):
    back = -1 if names else 1
    response = planar.answer('inverse_dynamics_trajectory', trajectory=JointTrajectory(
        joint_names=names, points=[JointTrajectoryPoint(positions=Q[::back])]))
    assert response.trajectory.joint_names == list(planar.arm.joint_names[::back])
    assert response.trajectory.points[0].effort[::back] == pytest.approx(
        [-49.52282521, -11.37087883], abs=5e-9)
