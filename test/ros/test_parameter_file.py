# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The sections of parameter files apply to the nodes to which rcl applies them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from launch_values import arm_of, DYNAMICS, write
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.parameters.parameter_file import ParameterFile
from ros_harness import DYNAMICS as DYNAMICS_MODULE
from ros_harness import log_of_failed_start

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
