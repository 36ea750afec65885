# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A parameter file describes the same arm to the offline tools and to the nodes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.context import Context
from rclpy.node import Node
from robot_dynamics.exceptions import InvalidInputError, ModelError
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_parameters import arm_from_parameters, read_parameter_file
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.ros.dynamics.parameters import SPECS
from robot_dynamics.ros.parameters.declared_parameters import DeclaredParameters
from robot_dynamics.ros.parameters.robot_description import (
    check_joint_count,
    SIMULATED_ACTUATOR_SPECS,
)
import yaml

GEARED = default_arm_urdf().replace(
    '</robot>', '<transmission name="t"><joint name="joint1"/><actuator name="m">'
    '<mechanicalReduction>100</mechanicalReduction></actuator></transmission></robot>')
"""The default arm, whose URDF states the gear ratio of one of two joints."""
FRICTION = {
    'viscous': [0.2, 0.1], 'coulomb': [2.0, 1.0], 'static': [3.0, 1.5],
    'stribeck_velocity': [0.04, 0.05], 'offset': [0.5, -0.25], 'sigmoid': [0.5, 0.2],
    'sigmoid_velocity': [0.02, 0.03], 'load_coefficient': [0.05, 0.02],
    'presliding_distance': [0.01, 0.02]}
MOTORS = {
    'torque_constant': [0.1, 0.2], 'gear_ratio': [100.0, -50.0], 'back_emf_constant': [0.11, 0.21],
    'resistance': [0.5, 0.8], 'inductance': [5e-4, 6e-4], 'rotor_inertia': [1e-5, 2e-5],
    'efficiency': [0.8, 0.85], 'current_limit': [20.0, 15.0], 'voltage_limit': [48.0, 24.0],
    'current_time_constant': [3e-4, 4e-4], 'backlash': [1e-3, 2e-3], 'restitution': [0.1, 0.2]}
EVERYTHING = {
    'joints': ['joint2', 'joint1'], 'gravity': [0.0, 1.0, -9.0],
    'friction': FRICTION, 'actuator': MOTORS, 'uncertainty': {
        'parameters': ['viscous(joint1)', 'm(link2)'], 'covariance': [0.04, 0.01, 0.09],
        'noise_deviation': [0.5, 0.3], 'noise_bandwidth': 5.0}}


def values_of_node(path: Path) -> dict[str, Any]:
    """Return the values that a node declares for both nodes, started with a parameter file."""
    context = Context()
    context.init(['--ros-args', '--params-file', str(path)])
    try:
        node = Node('dynamics', context=context, start_parameter_services=False,
                    enable_rosout=False)
        try:
            return dict(
                DeclaredParameters(
                    node, (*SPECS, *SIMULATED_ACTUATOR_SPECS), lambda _: None,
                    lambda _: None).values)
        finally:
            node.destroy_node()
    finally:
        context.shutdown()


def both_values(tmp_path: Path, parameters: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the interpretation of one parameter file by the tools and by a node."""
    path = tmp_path / 'dynamics.yaml'
    path.write_text(yaml.safe_dump({'dynamics': {'ros__parameters': parameters}}))
    return [read_parameter_file(path), values_of_node(path)]


def numbers_of(arm: ArmModel) -> dict[str, Any]:
    """Return all numbers of an arm that depend on parameters."""
    parts = {'friction': arm.friction, 'motors': arm.actuators, 'limits': arm.limits,
             'uncertainty': arm.uncertainty}
    numbers = {f'{part}.{name}': value.tolist() for part, record in parts.items()
               if record is not None for name, value in vars(record).items()
               if isinstance(value, np.ndarray)}
    return {**numbers, 'joints': arm.joint_names,
            'armature': arm.pinocchio_model.armature.tolist(),
            'gravity': arm.pinocchio_model.gravity.linear.tolist()}


def test_a_tool_and_a_node_read_the_same_arm(tmp_path):
    offline, of_node = (
        numbers_of(arm_from_parameters(GEARED, values))
        for values in both_values(tmp_path, EVERYTHING))
    assert offline == of_node
    assert offline['joints'] == ('joint2', 'joint1')
    for part, given in (('friction', FRICTION), ('motors', MOTORS)):
        for name, value in given.items():
            assert offline[f'{part}.{name}'] == value
    assert offline['uncertainty.noise_deviation'] == [0.5, 0.3]
    assert np.array(offline['uncertainty.root']).shape == (2, 2)
    assert sorted(offline['armature']) == pytest.approx([0.05, 0.1])


def test_a_reflected_inertia_needs_no_motor(tmp_path):
    offline, of_node = both_values(tmp_path, {
        'joints': ['joint2', 'joint1'], 'friction': {'sigmoid': [0.5]},
        'actuator': {'reflected_inertia': [0.05, 0.1]}})
    assert numbers_of(arm_from_parameters(GEARED, offline)) == numbers_of(
        arm_from_parameters(GEARED, of_node))  # also the defaults
    for values in (offline, of_node):
        arm = arm_from_parameters(GEARED, values)
        assert arm.friction.sigmoid.tolist() == [0.5, 0.5]
        assert arm.actuators is None
        assert arm.reflected_inertia.tolist() == [0.05, 0.1]
        part = arm_from_parameters(GEARED, values, ['joint1'])
        assert part.reflected_inertia.tolist() == [0.1]



def test_a_tool_and_a_node_read_the_same_numbers(tmp_path):
    path = tmp_path / 'dynamics.yaml'
    path.write_text('dynamics: {ros__parameters: {gravity: [1e-3, -.5e+1, 1.e1]}}')
    assert read_parameter_file(path)['gravity'] == [1e-3, -5.0, 10.0]
    assert list(values_of_node(path)['gravity']) == [1e-3, -5.0, 10.0]


@pytest.mark.parametrize(('parameters', 'words'), [
    ({'actuator': {'torque_constant': [0.1]}},
     r"actuator\.gear_ratio is empty, and no <transmission> .* for \['joint2'\]"),
    ({'actuator': {'rotor_inertia': [1e-4]}},
     r'actuator\.torque_constant is empty, .* only actuator\.reflected_inertia needs no motor'),
    ({'actuator': {'rotor_inertia': [1e-4], 'reflected_inertia': [0.5]}},
     r"rotor_inertia of 'joint1' is 0\.0001 and actuator\.reflected_inertia is 0\.5"),
    ({'uncertainty': {'parameters': ['viscous(joint1)', 'viscous(joint2)'],
                      'covariance': [1.0, 2.0, 1.0]}},
     r'uncertainty\.covariance has the eigenvalue -1 .* expected a positive semidefinite'),
])
def test_both_refuse_with_the_same_message(tmp_path, parameters, words):
    messages = set()
    for values in both_values(tmp_path, parameters):
        with pytest.raises(InvalidInputError, match=words) as refusal:
            arm_from_parameters(GEARED, values)
        messages.add(str(refusal.value))
    assert len(messages) == 1


def test_a_tool_may_use_some_joints_of_the_parameters():
    values = {'joints': ['joint2', 'joint1'], 'friction.viscous': [2.0, 1.0],
              'actuator.torque_constant': [0.2, 0.1]}
    arm = arm_from_parameters(GEARED, values, ['joint1'])
    assert arm.friction.viscous.tolist() == [1.0]
    assert arm.actuators.torque_constant.tolist() == [0.1]
    assert arm.actuators.gear_ratio.tolist() == [100.0]
    three = planar_arm_urdf([1.0] * 3, [0.5] * 3, [0.2] * 3, [0.01] * 3)
    with pytest.raises(InvalidInputError, match=r"viscous has no value for \['joint3'\]"):
        arm_from_parameters(three, values, ['joint3', 'joint1'])
    with pytest.raises(
            InvalidInputError, match=r'friction\.load_coefficient is 0\.1, expected an array'):
        arm_from_parameters(GEARED, {'friction.load_coefficient': 0.1})


def test_a_node_uses_at_most_100_joints():
    def chain(n):
        return load_arm(planar_arm_urdf([1.0] * n, [0.5] * n, [0.2] * n, [0.01] * n))
    check_joint_count(chain(100))
    with pytest.raises(ModelError, match='has 101 joints that move, expected at most 100'):
        check_joint_count(chain(101))
