# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The sections of parameter files apply to the nodes to which rcl applies them."""

from collections.abc import Sequence
from pathlib import Path
import re
from typing import Any

from launch_values import BOTH, checked, write
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.launch_arguments import DYNAMICS
from robot_dynamics.ros.parameters.parameter_file import ParameterFile
from ros_harness import DYNAMICS as DYNAMICS_MODULE
from ros_harness import NodeProcess

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
def test_sections_apply_to_the_nodes_to_which_rcl_applies_them(
    namespace: str, tmp_path: Path,
) -> None:
    lines = [f'{name}: {{ros__parameters: {{of_{i}: {i}}}}}' for i, name in enumerate(SECTIONS)]
    lines += ['cell: {left: {dynamics: {ros__parameters: {nested: 1}}}}']
    path = write(tmp_path / 'many.yaml', '\n'.join(lines))
    taken = taken_by_rcl(namespace, [path])
    file = ParameterFile(Path(path), 'params')
    assert set(file.parameters(f'{namespace}/dynamics')) == {
        name for name in taken if name.startswith(('of_', 'nested'))}
    assert {'of_0', 'of_1'} <= set(taken)


@pytest.mark.parametrize('sections', [
    (), ('/**',), ('/**', '/left/dynamics'), ('/left/dynamics', '/**'),
    ('/left/dynamics', '/**', '/*/dynamics', '/right/dynamics')])
def test_arguments_take_precedence_over_the_file(
    sections: tuple[str, ...], tmp_path: Path,
) -> None:
    params = write(tmp_path / 'arm.yaml', '\n'.join(
        f'{section}: {{ros__parameters: {{gravity: [1.0, 1.0, 1.0], rate: 50.0}}}}'
        for section in sections)) if sections else ''
    arm = checked(params=params, namespace='left', gravity='0 0 -3', autostart='false')
    files = arm.parameter_files(DYNAMICS, 'gravity', 'robot_description')
    taken = taken_by_rcl('/left', files)
    assert list(taken['gravity']) == [0.0, 0.0, -3.0]
    assert taken['robot_description'] == default_arm_urdf()
    assert 'autostart' not in taken
    assert taken.get('rate') == (50.0 if sections else None)
    assert files[:-1] == ([params] if params else [])
    Path(files[-1]).unlink()


@pytest.mark.parametrize(('text', 'namespace', 'nodes'), [
    ('/**: {ros__parameters: {a: 1}}', 'left', BOTH),
    ('/dynamics: {ros__parameters: {a: 1}}', '', BOTH),
    ('dynamics: {ros__parameters: {a: 1}}', '', (DYNAMICS,)),
    ('/left/dynamics: {ros__parameters: {a: 1}}', 'left', BOTH),
    ('left: {dynamics: {ros__parameters: {a: 1}}}', 'left', BOTH),
    ('/left/dynamics: {ros__parameters: {a: 1}}\n/right/dynamics: {ros__parameters: {a: 2}}',
     'right', BOTH),
    ('/**: {ros__parameters: {a: 1}}\n/controller_manager: {ros__parameters: {a: 2}}', '', BOTH),
])
def test_a_parameter_file_for_the_nodes_is_accepted(
    text: str, namespace: str, nodes: tuple[str, ...], tmp_path: Path,
) -> None:
    params = write(tmp_path / 'arm.yaml', text)
    file = checked(nodes, params=params, namespace=namespace).file
    assert file is not None
    assert str(file.path) == params


@pytest.mark.parametrize(('text', 'reason'), [
    ('/dynamics: {ros__parameters: {a: 1}}',
     "whose sections ['/dynamics'] do not apply to /cell/left/dynamics; expected the section /**"),
    ('/**: {ros__parameters: {a: 1}}\ndynamics: {ros__parameters: {b: 1}}',
     "whose sections ['/dynamics'] do not apply to /cell/left/dynamics; expected the section /**"),
    ('/left/simulated_arm: {ros__parameters: {a: 1}}',
     "whose sections ['/left/simulated_arm'] do not apply to /cell/left/simulated_arm; expected"),
    ('/controller_manager: {ros__parameters: {a: 1}}',
     "whose sections ['/controller_manager'] do not apply to /cell/left/simulated_arm and "
     '/cell/left/dynamics; expected'),
    ('{}', 'which has no parameters; expected a section such as /** that contains'),
    ('joints: [joint1]', 'which has no parameters; expected a section such as /** that contains'),
    ('a: [', 'which cannot be read: while parsing a flow node'),
])
def test_a_parameter_file_that_the_nodes_would_ignore_is_an_error(
    text: str, reason: str, tmp_path: Path,
) -> None:
    params = write(tmp_path / 'arm.yaml', text)
    with pytest.raises(RobotDynamicsError) as error:
        checked(params=params, namespace='left', outer='/cell')
    assert str(error.value).startswith(f"launch argument params is '{params}', {reason}")
    assert str(error.value).endswith('No node was started.')


@pytest.mark.parametrize(
    'path', [*(ROOT / 'config').glob('*.yaml'), *(ROOT / 'config' / 'robots').glob('*.yaml')],
    ids=lambda path: path.name)
def test_the_parameter_files_of_this_package_apply_in_every_namespace(path: Path) -> None:
    for namespace in ('', 'left', 'cell/left'):
        file = checked(params=str(path), namespace=namespace, robot_description='<robot/>').file
        assert file is not None
        assert 'command' in file.parameters(f'/{namespace}/dynamics'.replace('//', '/'))


@pytest.mark.parametrize(('text', 'warns'), [
    ('/**: {ros__parameters: {command: none}}', False),
    ('/left/dynamics: {ros__parameters: {command: none}}', False),
    ('/**: {ros__parameters: {command: none}}\n/dynamics: {ros__parameters: {rate: 9.0}}', True),
    ('/dynamics: {ros__parameters: {command: none}}', True)])
def test_a_node_warns_of_sections_that_it_ignores(text: str, warns: bool, tmp_path: Path) -> None:
    params = write(tmp_path / 'arm.yaml', text)
    node = NodeProcess(DYNAMICS_MODULE, namespace='/left', patient=False, arguments=(
        '--ros-args', '--params-file', params))
    with node:
        if warns:
            node.wait_for_log(re.escape(
                f"Parameter file '{params}': sections ['/dynamics'] do not apply to "
                '/left/dynamics; expected the section /**'))
        else:
            node.wait_for_log('Active with command: none')
    assert ('do not apply' in node.log) == warns
