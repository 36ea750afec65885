# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A parameter file describes the same arm to the offline tools and to the nodes.

Its sections apply to the nodes to which rcl applies them.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from launch_values import arm_of, DYNAMICS, write
import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from robot_dynamics.exceptions import InvalidInputError, ModelError, RobotDynamicsError
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_parameters import arm_from_parameters, read_parameter_file
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.ros.dynamics.parameters import SPECS
from robot_dynamics.ros.parameters.declared_parameters import DeclaredParameters
from robot_dynamics.ros.parameters.parameter_file import ParameterFile
from robot_dynamics.ros.parameters.robot_description import (
    check_joint_count,
    SIMULATED_ACTUATOR_SPECS,
)
from ros_harness import DYNAMICS as DYNAMICS_MODULE
from ros_harness import log_of_failed_start
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


ROOT = Path(__file__).resolve().parents[2]

SECTIONS = (
    '/**', '/**/dynamics', '/*/dynamics', '/left/dynamics', 'left/dynamics', '/dynamics',
    'dynamics', '/left/*', '/left/**', '/*', '/right/dynamics', '/left/simulated_arm',
    '/left/dynamics_2', '/left')


def taken_by_rcl(namespace: str, files: Sequence[str]) -> dict[str, Any]:
    """Return the parameters that a node called dynamics takes from files."""
    context = Context()
    arguments = [text for file in files for text in ('--params-file', file)]
    rclpy.init(args=['--ros-args', *arguments], context=context)
    node = Node('dynamics', namespace=namespace, context=context,
                automatically_declare_parameters_from_overrides=True)
    parameters = node.get_parameters_by_prefix('')
    taken = {name: parameter.value for name, parameter in parameters.items()}
    node.destroy_node()
    rclpy.shutdown(context=context)
    return taken


@pytest.mark.parametrize('namespace', ['', '/left', '/cell/left'])
def test_sections_apply_to_the_nodes_to_which_rcl_applies_them(namespace, tmp_path):
    lines = [f'{name}: {{ros__parameters: {{of_{i}: {i}}}}}' for i, name in enumerate(SECTIONS)]
    lines += ['cell: {left: {dynamics: {ros__parameters: {nested: 1}}}}']
    path = write(tmp_path / 'many.yaml', '\n'.join(lines))
    taken = taken_by_rcl(namespace, [path])
    file = ParameterFile(Path(path), 'params')
    assert set(file.parameters(f'{namespace}/dynamics')) == {
        name for name in taken if name.startswith(('of_', 'nested'))}
    assert {'of_0', 'of_1'} <= set(taken)


@pytest.mark.parametrize('sections', [
    (), ('/left/dynamics', '/**', '/*/dynamics', '/right/dynamics')])
def test_arguments_take_precedence_over_the_file(sections, tmp_path):
    params = write(tmp_path / 'arm.yaml', '\n'.join(
        f'{section}: {{ros__parameters: {{gravity: [1.0, 1.0, 1.0], rate: 50.0}}}}'
        for section in sections)) if sections else ''
    arm = arm_of(params=params, namespace='left', gravity='[0, 0, -3]')
    files = arm.parameter_files(DYNAMICS)
    taken = taken_by_rcl('/left', files)
    assert list(taken['gravity']) == [0.0, 0.0, -3.0]
    assert taken['robot_description'] == default_arm_urdf()
    assert taken.get('rate') == (50.0 if sections else None)
    assert files[:-1] == ([params] if params else [])
    Path(files[-1]).unlink()


@pytest.mark.parametrize(('text', 'reason'), [
    ('joints: [joint1]', 'which has no parameters; expected a section such as /** that contains'),
    ('a: [', 'which cannot be read: while parsing a flow node'),
])
def test_a_file_that_is_no_parameter_file_is_an_error(text, reason, tmp_path):
    params = write(tmp_path / 'arm.yaml', text)
    with pytest.raises(RobotDynamicsError) as error:
        arm_of(params=params)
    assert str(error.value).startswith(f"launch argument params is '{params}', {reason}")


def test_the_parameter_files_of_this_package_apply_in_every_namespace():
    files = [*(ROOT / 'config').glob('*.yaml'), *(ROOT / 'config' / 'robots').glob('*.yaml')]
    assert len(files) > 5
    for path in files:
        for namespace in ('', '/left', '/cell/left'):
            assert 'command' in ParameterFile(path, 'params').parameters(f'{namespace}/dynamics')


@pytest.mark.parametrize(('text', 'node', 'ignored'), [
    ('/**: {ros__parameters: {a: 1}}', '/left/dynamics', []),
    ('dynamics: {ros__parameters: {a: 1}}', '/dynamics', []),
    ('left: {dynamics: {ros__parameters: {a: 1}}}', '/left/dynamics', []),
    ('/left/dynamics: {ros__parameters: {a: 1}}\n/right/dynamics: {ros__parameters: {a: 2}}',
     '/right/dynamics', []),
    ('/**: {ros__parameters: {a: 1}}\n/controller_manager: {ros__parameters: {a: 2}}',
     '/dynamics', []),
    ('/**: {ros__parameters: {a: 1}}\n/dynamics: {ros__parameters: {b: 1}}',
     '/left/dynamics', ['/dynamics']),
    ('/controller_manager: {ros__parameters: {a: 1}}', '/dynamics', ['/controller_manager']),
])
def test_sections_that_a_node_ignores(text, node, ignored, tmp_path):
    file = ParameterFile(Path(write(tmp_path / 'arm.yaml', text)), 'params')
    assert file.ignored_sections(node) == ignored


def test_a_node_does_not_move_an_arm_with_sections_that_it_ignores(tmp_path):
    bad = write(tmp_path / 'bad.yaml', '/dynamics: {ros__parameters: {command: none}}')
    log = log_of_failed_start(DYNAMICS_MODULE, arguments=(
        '--ros-args', '-r', '__ns:=/left', '--params-file', bad))
    assert (f"Parameter file '{bad}': sections ['/dynamics'] do not apply to "
            '/left/dynamics; expected the section /**, for every node') in log
