# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The shipped parameter files and launch files are such as the nodes take."""

import ast
from pathlib import Path
import re
from typing import Any

import pytest
from robots import robot_path
from ros_harness import DYNAMICS, NodeProcess, RosClient, SIMULATED_ARM
from sensor_msgs.msg import JointState
import yaml

ROOT = Path(__file__).resolve().parents[2]
ROBOTS = {
    'default_arm.yaml': '',
    'ur10.yaml': 'ur10',
    'xarm7.yaml': 'xarm7',
}


def flat(tree: dict[str, Any], prefix: str = '') -> dict[str, Any]:
    entries: dict[str, Any] = {}
    for key, value in tree.items():
        name = f'{prefix}{key}'
        entries.update(flat(value, f'{name}.') if isinstance(value, dict) else {name: value})
    return entries


def test_every_file_is_tried() -> None:
    files = {path.name for path in (ROOT / 'config').glob('*.yaml')}
    assert {name for name in files if not name.startswith('planar')} == set(ROBOTS)


@pytest.mark.parametrize('file', ROBOTS)
def test_both_nodes_run_on_it(client: RosClient, file: str) -> None:
    path = ROOT / 'config' / file
    written = yaml.safe_load(path.read_text(encoding='utf-8'))
    parameters = {}
    if ROBOTS[file]:
        parameters['robot_description_file'] = str(robot_path(ROBOTS[file]))
    arguments = ('--ros-args', '--params-file', str(path))
    with NodeProcess(DYNAMICS, parameters, arguments=arguments, patient=False), \
            NodeProcess(  # on its brakes, as no effort reaches it
                SIMULATED_ARM, parameters, arguments=arguments,
                remaps={'effort_command': 'unused'}):
        for node, module in (('/dynamics', DYNAMICS), ('/simulated_arm', SIMULATED_ARM)):
            for name, value in flat(written[node]['ros__parameters']).items():
                taken = client.get_parameter(node, name)
                assert (list(taken) if isinstance(value, list) else taken) == value, (
                    f'{module}: {name}')
        state = client.wait_for(JointState, '/joint_states')
        assert list(state.name) == written['/dynamics']['ros__parameters']['joints']
        assert list(state.position) == pytest.approx(
            written['/simulated_arm']['ros__parameters']['initial_position'], abs=1e-3)
        efforts = client.wait_for(JointState, '/dynamics/gravity_compensation')
        assert list(efforts.name) == list(state.name)
        client.forget('/')


EXAMPLE = re.compile(r'^( +)# (( *)(\w+):( *\[.*)?)(#.*)?$')
"""A parameter, or a group of them, that stands in a comment."""


def uncommented(text: str) -> str:
    """Return a parameter file with its examples switched on."""
    return '\n'.join(
        f'{match[1]}{match[2]}' if (match := EXAMPLE.match(line)) else line
        for line in text.splitlines())


def test_the_examples_in_the_comments_are_taken_too(client: RosClient, tmp_path: Path) -> None:
    path = tmp_path / 'default_arm.yaml'
    text = uncommented((ROOT / 'config' / path.name).read_text(encoding='utf-8'))
    path.write_text(text, encoding='utf-8')
    written = {
        node: flat(entry['ros__parameters']) for node, entry in yaml.safe_load(text).items()}
    for node in written.values():
        assert {'friction.coulomb', 'actuator.torque_constant', 'robot_compensates'} <= set(node)
    assert 'actuator.backlash' in written['/simulated_arm']
    arguments = ('--ros-args', '--params-file', str(path))
    with NodeProcess(DYNAMICS, arguments=arguments, patient=False), \
            NodeProcess(SIMULATED_ARM, arguments=arguments):
        for node, parameters in written.items():
            for name, value in parameters.items():
                taken = client.get_parameter(node, name)
                assert (list(taken) if isinstance(value, list) else taken) == value, name
        client.wait_for(JointState, '/dynamics/gravity_compensation')
        client.forget('/')


@pytest.mark.parametrize(
    'path', sorted((ROOT / 'launch').glob('*.launch.py')), ids=lambda path: path.name)
def test_launch_files(path: Path) -> None:
    """Where `launch` is installed, they load; they always name executables that are installed."""
    tree = ast.parse(path.read_text(encoding='utf-8'))
    used = {
        keyword.value.value for call in ast.walk(tree) if isinstance(call, ast.Call)
        for keyword in call.keywords
        if keyword.arg == 'executable' and isinstance(keyword.value, ast.Constant)}
    setup = (ROOT / 'setup.py').read_text(encoding='utf-8')
    assert used
    for executable in used - {'robot_state_publisher', 'rviz2'}:
        assert f"'{executable}': " in setup
    pytest.importorskip('launch_ros', reason='launch_ros comes with apt, and has no wheel')
    scope: dict[str, Any] = {'__name__': path.stem}
    exec(compile(tree, str(path), 'exec'), scope)
    assert scope['generate_launch_description']().entities
