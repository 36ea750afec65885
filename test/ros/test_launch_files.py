# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The launch files: their arguments, the files that these name, and the nodes that they start.

Tests of the arguments need no launch. Where `ros2 launch` is installed, the
launch files run as well.
"""

import ast
from collections.abc import Iterator
from contextlib import contextmanager
import importlib.util
from pathlib import Path
import shutil
import signal
import subprocess
import sys

import children
from fault_table import fault
from launch_values import arm_of, BOTH, DYNAMICS, write
import pytest
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.launch_arguments import ARGUMENTS, arm_arguments, values_by_arm
from robots import robot_path
from ros_harness import DYNAMICS as DYNAMICS_MODULE
from sensor_msgs.msg import JointState

ROOT = Path(__file__).resolve().parents[2]
DIRECTORIES = ROOT / 'launch', ROOT / 'robot_dynamics_tools' / 'launch'
FILES = sorted(file for directory in DIRECTORIES for file in directory.glob('*.launch.py'))
SEVERAL = {'several_arms', 'leader_and_follower'}
"""Launch files for several arms, which choose the namespaces."""
HAS_LAUNCH = bool(shutil.which('ros2')) and importlib.util.find_spec('launch_ros') is not None
with_launch = pytest.mark.skipif(
    not HAS_LAUNCH, reason='ros2 launch comes with apt, and has no wheel')
every_file = pytest.mark.parametrize('path', FILES, ids=lambda path: path.name)


def calls(path: Path, function: str) -> list[ast.Call]:
    """Return the calls of a function in a Python file."""
    tree = ast.parse(path.read_text(encoding='utf-8'))
    return [node for node in ast.walk(tree)
            if isinstance(node, ast.Call) and ast.unparse(node.func) == function]


# --- the launch files as texts -------------------------------------------------------------------

@every_file
def test_every_argument_is_declared_described_and_used(path):
    call, = calls(path, 'declared')
    left_out = {keyword.arg for keyword in call.keywords
                if isinstance(keyword.value, ast.Constant) and keyword.value.value is None}
    several = path.name.partition('.')[0] in SEVERAL
    assert left_out == ({'namespace'} if several else set())
    text = path.read_text(encoding='utf-8')
    for call in calls(path, 'DeclareLaunchArgument'):
        name = ast.literal_eval(call.args[0])
        keywords = {str(keyword.arg): ast.literal_eval(keyword.value) for keyword in call.keywords}
        assert set(keywords) == {'default_value', 'description'}
        assert keywords['description'].endswith('.')
        assert name == 'arms' or f"LaunchConfiguration('{name}')" in text
    for call in calls(path, 'switch'):
        name, description = map(ast.literal_eval, call.args)
        assert f"is_true(context, '{name}')" in text
        assert description.endswith('.')
    assert ('values_by_arm(' in text) == (path.name == 'several_arms.launch.py')


def test_every_common_argument_has_a_description_and_is_used():
    class Recorded(dict[str, str]):
        used: set[str] = set()

        def __getitem__(self, name: str) -> str:
            self.used.add(name)
            return super().__getitem__(name)

    values = Recorded({name: default for name, (default, _) in ARGUMENTS.items()})
    arm_arguments(values, BOTH)
    assert values.used == set(ARGUMENTS) == {
        'robot', 'robot_description', 'params', 'namespace', 'use_sim_time', 'autostart',
        'gravity', 'log_level'}
    assert all(len(text) > 30 and text.endswith('.') for _, text in ARGUMENTS.values())


def test_launch_files_name_executables_that_are_installed():
    names = {word for path in FILES for call in calls(path, 'node') for word in (
        ast.literal_eval(one) for one in call.args[1:2] if isinstance(one, ast.Constant))}
    assert names == {'dynamics', 'dynamics_monitor', 'simulated_arm', 'mujoco_arm'}
    for directory, executables in zip(DIRECTORIES, (
            ('dynamics_node', 'simulated_arm'), ('dynamics_monitor', 'mujoco_arm'))):
        setup = (directory.parent / 'setup.py').read_text(encoding='utf-8')
        for executable in executables:
            assert f"'{executable}': " in setup


# --- arguments -----------------------------------------------------------------------------------

def test_without_arguments_a_simulated_arm_gets_the_embedded_description():
    arm = arm_of()
    assert (arm.namespace, arm.file, arm.log_level) == ('/', None, 'info')
    assert arm.description == default_arm_urdf()
    assert arm.overrides == {'robot_description': default_arm_urdf()}
    alone = arm_of((DYNAMICS,))
    assert alone.description is None
    assert alone.overrides == {}


def test_arguments_become_parameters():
    arm = arm_of(use_sim_time='true', autostart='false', gravity='[0, 0, 9.81]',
                  robot=str(robot_path('ur10')), log_level='debug', namespace='cell/left')
    assert (arm.namespace, arm.log_level) == ('/cell/left', 'debug')
    assert '<robot' in arm.description
    assert arm.overrides == {
        'use_sim_time': True, 'autostart': False, 'gravity': [0.0, 0.0, 9.81],
        'robot_description': arm.description, 'robot_description_file': ''}
    assert arm_of(robot_description='<robot/>').description == '<robot/>'


def test_a_parameter_file_may_give_the_description(tmp_path):
    urdf = write(tmp_path / 'arm.urdf', default_arm_urdf())
    params = write(tmp_path / 'arm.yaml', (
        f'/left/dynamics: {{ros__parameters: {{robot_description_file: {urdf}}}}}'))
    arm = arm_of(params=params, namespace='left')
    assert arm.description == default_arm_urdf()
    assert arm.overrides == {}
    params = write(
        tmp_path / 'arm.yaml', '/**: {ros__parameters: {robot_description: "<robot/>"}}')
    assert arm_of(params=params).description == '<robot/>'
    arm = arm_of(params=params, robot=urdf)
    assert arm.description == arm.overrides['robot_description'] == default_arm_urdf()


@pytest.mark.parametrize(('namespace', 'outer', 'expected'), [
    ('', '', '/'), ('/left/', '', '/left'), ('left', '/cell', '/cell/left'),
    ('', '/cell', '/cell'), ('/left', '/cell', '/left')])
def test_namespaces_are_absolute(namespace, outer, expected):
    assert arm_of((DYNAMICS,), outer, namespace=namespace).namespace == expected


def test_each_of_several_arms_has_its_files():
    values = {'arms': 'left, right', 'params': 'a.yaml,b.yaml', 'robot': 'arm.urdf', 'gravity': ''}
    left, right = values_by_arm(values)
    assert (left['namespace'], left['params'], left['robot']) == ('left', 'a.yaml', 'arm.urdf')
    assert (right['namespace'], right['params'], right['robot']) == ('right', 'b.yaml', 'arm.urdf')
    assert [arm['params'] for arm in values_by_arm({**values, 'params': ''})] == ['', '']
    with pytest.raises(RobotDynamicsError, match="is 'a.yaml,b.yaml', expected one file for all"):
        values_by_arm({**values, 'arms': 'a,b,c'})


@pytest.mark.parametrize(('values', 'words'), [
    pytest.param(
        {'params': 'no/such.yaml'}, ', which cannot be read: ',
        marks=fault(
            'External files and web pages', 'a launch argument names a missing parameter file',
            'rejected with the path, before any node is started')),
    ({'robot': 'package://no_such_package/arm.urdf'},
     ", but there is no package 'no_such_package' in this environment"),
    ({'robot': 'http://nowhere/arm.urdf'}, ', expected a path, file:// or package://')])
def test_a_file_that_cannot_be_read_is_an_error(values, words):
    """The message names the argument, and its value."""
    with pytest.raises(RobotDynamicsError) as error:
        arm_of(**values)
    (name, value), = values.items()
    assert str(error.value).startswith(f'launch argument {name} is {value!r}{words}')


@pytest.mark.parametrize(('values', 'words'), [
    ({'gravity': 'down'}, 'gravity'), ({'namespace': 'my arm'}, '__ns:=/my arm')])
def test_the_node_rejects_an_invalid_argument(values, words):
    """The node gets what the launch files pass on, ends with status 1, and names the argument."""
    arm = arm_of((DYNAMICS,), **values)
    files = [word for file in arm.parameter_files(DYNAMICS) for word in ('--params-file', file)]
    done = children.run(
        [sys.executable, '-m', DYNAMICS_MODULE, '--ros-args', '--log-level', arm.log_level,
         '-r', f'__ns:={arm.namespace}', *files], text=True, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT)
    assert done.returncode == 1, done.stdout
    assert words in done.stdout.splitlines()[-1]


# --- the launch files where launch is installed --------------------------------------------------

def launch(file: str, *arguments: str) -> list[str]:
    """Return the command that launches a file of this package."""
    path, = (path for path in FILES if path.name == f'{file}.launch.py')
    return ['ros2', 'launch', str(path), *arguments]


@contextmanager
def launched(file: str, *arguments: str) -> Iterator[None]:
    """Run a launch file; at the end, SIGINT must end all its nodes with status 0."""
    process = children.popen(
        launch(file, *arguments), text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        yield
    finally:
        process.send_signal(signal.SIGINT)
        log, _ = process.communicate(timeout=children.TIMEOUT)
        print(log)
    assert log.count('process has finished cleanly') == log.count('process started') > 0


@with_launch
@every_file
def test_ros2_launch_describes_all_arguments(path):
    name = path.name.partition('.')[0]
    shown = children.run(
        [*launch(name), '--show-args'], text=True, stdout=subprocess.PIPE, check=True).stdout
    names = set(ARGUMENTS) - ({'namespace'} if name in SEVERAL else set())
    names |= {'arms'} if name == 'several_arms' else set()
    assert all(f"    '{argument}':\n        " in shown for argument in names)
    assert 'no description given' not in shown


ARM = 'joints: [joint1, joint2], state_timeout: 60.0, state_max_age: 0.0'


@with_launch
def test_the_loops_of_two_arms_close(client, tmp_path):
    left = write(tmp_path / 'left.yaml', (
        f'/**: {{ros__parameters: {{{ARM}, rate: 50.0, gravity: [0.0, 0.0, -1.62]}}}}'))
    right = write(tmp_path / 'right.yaml', (
        f'/**: {{ros__parameters: {{{ARM}, rate: 50.0}}}}\n'
        '/right/dynamics: {ros__parameters: {effort_limit_fraction: 0.5}}'))
    with launched('several_arms', f'params:={left},{right}', 'tf:=false'):
        for arm in ('left', 'right'):
            client.wait_for(JointState, f'/{arm}/effort_command')
            client.wait_for(JointState, f'/{arm}/joint_states')
        assert list(client.get_parameter('/left/simulated_arm', 'gravity')) == [0.0, 0.0, -1.62]
        assert list(client.get_parameter('/right/dynamics', 'gravity')) == [0.0, 0.0, -9.81]
        assert client.get_parameter('/left/dynamics', 'effort_limit_fraction') == 1.0
        assert client.get_parameter('/right/dynamics', 'effort_limit_fraction') == 0.5
        client.forget('/left')
        client.forget('/right')
