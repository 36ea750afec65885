# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Joints, controllers and threshold of robots.md and real_robot.md fit each other."""

from pathlib import Path
import re
from xml.etree import ElementTree

from robot_dynamics.model.arm import load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
import yaml

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / 'docs' / 'robots.md').read_text(encoding='utf-8')
ROBOT_PAGE = (ROOT / 'docs' / 'real_robot.md').read_text(encoding='utf-8')
TYPES = {
    'joint_state_broadcaster': 'joint_state_broadcaster/JointStateBroadcaster',
    'effort_controller': 'effort_controllers/JointGroupEffortController'}


def controllers(text: str) -> tuple[dict[str, str], list[str]]:
    """Return the types of the controllers by name, and the joints of the effort controller."""
    block, = re.findall(
        r'```yaml\n(?:# controllers.yaml\n)?(controller_manager:.*?)```', text, re.DOTALL)
    values = {name: node['ros__parameters'] for name, node in yaml.safe_load(block).items()}
    types = {name: one['type'] for name, one in values['controller_manager'].items()
             if isinstance(one, dict)}
    return types, values['effort_controller']['joints']


def hardware() -> str:
    """Return the tag of the hardware component."""
    tag, = re.findall(r'```xml\n(.*?)```', PAGE, re.DOTALL)
    return str(tag)


def test_the_recipe_has_all_joints_everywhere():
    arm = load_arm(default_arm_urdf().replace('</robot>', f'{hardware()}</robot>'))
    tag = ElementTree.fromstring(hardware())
    types, joints = controllers(PAGE)
    assert types == TYPES
    assert joints == list(arm.joint_names) == [joint.get('name') for joint in tag.iter('joint')]
    assert f'joints:="[{", ".join(joints)}]"' in PAGE
    for joint in tag.iter('joint'):
        assert [one.get('name') for one in joint.findall('command_interface')] == ['effort']
        assert [one.get('name') for one in joint.findall('state_interface')] == [
            'position', 'velocity', 'effort']


def test_the_topics_of_the_hardware_are_those_of_the_simulated_arm():
    parameters = {
        one.get('name'): one.text for one in ElementTree.fromstring(hardware()).iter('param')}
    assert f'joint_states:={parameters["joint_states_topic"]} ' in PAGE
    assert f'effort_command:={parameters["joint_commands_topic"]}\n' in PAGE
    assert float(parameters['trigger_joint_command_threshold'] or 0) < 0.0


def test_the_controller_for_a_real_robot_has_the_joints_of_its_parameter_file():
    types, joints = controllers(ROBOT_PAGE)
    for text in (ROBOT_PAGE, PAGE):  # both start the controllers that they configure
        assert f'spawner {" ".join(TYPES)}\n' in text
        assert 'controller:=effort_controller' in text
    nodes = yaml.safe_load((ROOT / 'config' / 'ur10.yaml').read_text(encoding='utf-8'))
    assert types == TYPES
    assert [joints] == [node['ros__parameters']['joints'] for node in nodes.values()
                        if 'joints' in node['ros__parameters']][:1]
