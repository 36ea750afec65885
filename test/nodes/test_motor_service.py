# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The services report motor quantities if there are motors, in the order of the request."""

from collections.abc import Iterator

import numpy as np
import pytest
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.conversions import trajectory_to_ros
from robot_dynamics.trajectories.efforts import efforts_along
from robot_dynamics.trajectories.quintics import quintic_via_points
from robot_dynamics_interfaces.srv import (
    ForwardDynamics,
    InverseDynamics,
    InverseDynamicsBatch,
    InverseDynamicsTrajectory,
)
from ros_harness import DYNAMICS, NodeProcess, RosClient

NAMES = ['joint1', 'joint2']
MOTORS = {
    'torque_constant': [0.1, 0.05], 'gear_ratio': [100.0, 50.0], 'rotor_inertia': [1e-5, 2e-5],
    'resistance': [0.5, 0.8], 'efficiency': [0.8, 0.9], 'current_limit': [3.0, 50.0],
    'voltage_limit': [48.0, 48.0]}
PARAMETERS = {'joints': NAMES, **{f'actuator.{name}': value for name, value in MOTORS.items()}}
Q, V, A = [0.8, 0.5], [0.5, -0.3], [0.1, 0.2]


def with_transmissions(*reductions: object) -> str:
    """Return the default arm with transmissions of these reductions, from the first joint on."""
    elements = ''.join(
        f'<transmission name="t{i}"><joint name="joint{i}"/><actuator name="m{i}">'
        f'<mechanicalReduction>{reduction}</mechanicalReduction></actuator></transmission>'
        for i, reduction in enumerate(reductions, start=1))
    return default_arm_urdf().replace('</robot>', f'{elements}</robot>')


@pytest.fixture(scope='module', autouse=True)
def node() -> Iterator[None]:
    with NodeProcess(DYNAMICS, PARAMETERS):
        yield


@pytest.fixture(scope='module')
def dynamics() -> ArmDynamics:
    arm = load_arm(default_arm_urdf())
    return ArmDynamics(arm.with_actuators(make_actuators(NAMES, **MOTORS)))


def test_inverse_dynamics_reports_the_load_of_the_motors(
        client: RosClient, dynamics: ArmDynamics) -> None:
    answer = client.call(InverseDynamics, '/dynamics/inverse_dynamics', InverseDynamics.Request(
        joint_names=NAMES[::-1], position=Q[::-1], velocity=V[::-1], acceleration=A[::-1]))
    q, v, a = (np.array(x) for x in (Q, V, A))
    effort = dynamics.inverse_dynamics(q, v, a)
    bare = ArmDynamics(load_arm(default_arm_urdf())).inverse_dynamics(q, v, a)
    assert effort - bare == pytest.approx(np.array([0.1, 0.05]) * a)  # the reflected inertia
    actuators = dynamics.arm.actuators
    load = actuators.load(effort, v, a)
    assert list(answer.effort) == pytest.approx(effort[::-1])
    assert list(answer.motor_current) == pytest.approx(load.current[::-1])
    assert list(answer.motor_voltage) == pytest.approx(load.voltage[::-1])
    assert list(answer.current_ratio) == pytest.approx(load.current_ratio[::-1])
    assert list(answer.voltage_ratio) == pytest.approx(load.voltage_ratio[::-1])
    assert load.current_ratio[0] > 1.0
    assert any("current of the motor of 'joint1'" in words for words in answer.warnings)


def test_forward_dynamics_takes_the_rotors_along(
        client: RosClient, dynamics: ArmDynamics) -> None:
    effort = dynamics.inverse_dynamics(*(np.array(x) for x in (Q, V, A)))
    answer = client.call(ForwardDynamics, '/dynamics/forward_dynamics', ForwardDynamics.Request(
        position=Q, velocity=V, effort=effort.tolist()))
    assert list(answer.acceleration) == pytest.approx(A)
    assert len(answer.motor_current) == 2
    assert any("current of the motor of 'joint1'" in words for words in answer.warnings)


def test_a_trajectory_must_be_within_what_the_motors_have(
        client: RosClient, dynamics: ArmDynamics) -> None:
    path = quintic_via_points(NAMES, (0.0, 1.0, 2.0), [[0.0, 0.0], [1.5, -0.4], [0.2, 1.0]])
    answer = client.call(
        InverseDynamicsTrajectory, '/dynamics/inverse_dynamics_trajectory',
        InverseDynamicsTrajectory.Request(trajectory=trajectory_to_ros(path)))
    expected = efforts_along(dynamics, path)
    effort_alone = efforts_along(ArmDynamics(load_arm(default_arm_urdf())), path)
    assert effort_alone.feasible  # only a motor is overloaded
    assert answer.success
    assert not answer.feasible
    assert answer.worst_joint == expected.worst_joint
    assert answer.worst_ratio == pytest.approx(expected.worst_ratio)
    assert answer.worst_ratio > 1.0
    assert answer.worst_time == expected.worst_time
    assert answer.message.startswith("current of the motor of 'joint1' is ")
    assert answer.warnings == [answer.message]


def test_a_batch_warns_of_the_motors_too(client: RosClient) -> None:
    one, batch = (
        client.call(kind, f'/dynamics/{name}', kind.Request(
            position=Q, velocity=V, acceleration=A))
        for kind, name in ((InverseDynamics, 'inverse_dynamics'),
                           (InverseDynamicsBatch, 'inverse_dynamics_batch')))
    assert [line.replace(' in sample 0', '') for line in batch.warnings] == list(one.warnings)
    assert any('current of the motor' in line for line in batch.warnings)


def test_the_urdfs_transmissions_are_the_gear_ratios(
        client: RosClient, dynamics: ArmDynamics) -> None:
    parameters = {
        **PARAMETERS, 'actuator.gear_ratio': [], 'robot_description': with_transmissions(100, 50)}
    with NodeProcess(DYNAMICS, parameters, namespace='/described'):
        answer = client.call(
            InverseDynamics, '/described/dynamics/inverse_dynamics',
            InverseDynamics.Request(position=Q, velocity=V, acceleration=A))
    q, v, a = (np.array(x) for x in (Q, V, A))
    effort = dynamics.inverse_dynamics(q, v, a)
    assert list(answer.effort) == pytest.approx(effort)
    actuators = dynamics.arm.actuators
    assert list(answer.motor_current) == pytest.approx(actuators.load(effort, v, a).current)
