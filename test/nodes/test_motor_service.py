# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The services report motor quantities if there are motors, in the order of the request."""

from collections.abc import Iterator

import numpy as np
import pytest
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.conversions import trajectory_to_ros
from robot_dynamics.trajectories.efforts import efforts_along
from robot_dynamics.trajectories.quintics import quintic_via_points
from ros_harness import RosClient
from service_bench import Served, served
from simulated_arms import default_dynamics

NAMES = ['joint1', 'joint2']
MOTORS = {
    'torque_constant': [0.1, 0.05], 'gear_ratio': [100.0, 50.0], 'rotor_inertia': [1e-5, 2e-5],
    'resistance': [0.5, 0.8], 'efficiency': [0.8, 0.9], 'current_limit': [3.0, 50.0],
    'voltage_limit': [48.0, 48.0]}
PARAMETERS = {'joints': NAMES, **{
    f'actuator.{name}': value for name, value in MOTORS.items() if name != 'gear_ratio'}}
"""The gear ratios are those of the transmissions in the URDF."""
STATE = Q, V, A = np.array([[0.8, 0.5], [0.5, -0.3], [0.1, 0.2]])
MOTION = dict(zip(('position', 'velocity', 'acceleration'), STATE.tolist()))
BARE = default_dynamics()
DRIVEN = ArmDynamics(BARE.arm.with_actuators(make_actuators(NAMES, **MOTORS)))
EFFORT = DRIVEN.inverse_dynamics(*STATE)
LOAD = DRIVEN.arm.actuators.load(EFFORT, V, A)


TRANSMISSIONS = ''.join(
    f'<transmission name="t{i}"><joint name="joint{i}"/><actuator name="m{i}">'
    f'<mechanicalReduction>{reduction}</mechanicalReduction></actuator></transmission>'
    for i, reduction in ((1, 100), (2, 50)))


@pytest.fixture(scope='module')
def node(client: RosClient) -> Iterator[Served]:
    urdf = default_arm_urdf().replace('</robot>', f'{TRANSMISSIONS}</robot>')
    with served(client, '/motors', urdf, **PARAMETERS) as node:
        yield node


def test_inverse_dynamics_reports_the_load_of_the_motors(node):
    answer = node.answer('inverse_dynamics', joint_names=NAMES[::-1], **{
        name: values[::-1] for name, values in MOTION.items()})
    reflected = np.array([0.1, 0.05]) * A  # the inertia of the rotors at the joints
    assert EFFORT - BARE.inverse_dynamics(*STATE) == pytest.approx(reflected)
    assert list(answer.effort) == pytest.approx(EFFORT[::-1])
    assert list(answer.motor_current) == pytest.approx(LOAD.current[::-1])
    assert list(answer.motor_voltage) == pytest.approx(LOAD.voltage[::-1])
    assert list(answer.current_ratio) == pytest.approx(LOAD.current_ratio[::-1])
    assert list(answer.voltage_ratio) == pytest.approx(LOAD.voltage_ratio[::-1])
    assert LOAD.current_ratio[0] > 1.0
    assert any("current of the motor of 'joint1'" in words for words in answer.warnings)


def test_forward_dynamics_takes_the_rotors_along(node):
    answer = node.answer('forward_dynamics', position=Q, velocity=V, effort=EFFORT)
    assert list(answer.acceleration) == pytest.approx(A)
    assert len(answer.motor_current) == 2
    assert any("current of the motor of 'joint1'" in words for words in answer.warnings)


def test_a_trajectory_must_be_within_what_the_motors_have(node):
    path = quintic_via_points(NAMES, (0.0, 1.0, 2.0), [[0.0, 0.0], [1.5, -0.4], [0.2, 1.0]])
    answer = node.answer('inverse_dynamics_trajectory', trajectory=trajectory_to_ros(path))
    expected = efforts_along(DRIVEN, path)
    assert efforts_along(BARE, path).feasible  # only a motor is overloaded
    assert not answer.feasible
    assert answer.worst_joint == expected.worst_joint
    assert answer.worst_ratio == pytest.approx(expected.worst_ratio)
    assert answer.worst_ratio > 1.0
    assert answer.worst_time == expected.worst_time
    assert answer.message.startswith("current of the motor of 'joint1' is ")
    assert answer.warnings == [answer.message]
