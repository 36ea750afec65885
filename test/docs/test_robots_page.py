# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""drivers.md and the parameter files: a node runs with each, on messages of the driver."""

from dataclasses import dataclass
from pathlib import Path
import re
from typing import Any

import numpy as np
import pytest
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics.ros.dynamics.parameters import SPECS as DYNAMICS_SPECS
from robot_dynamics.ros.simulated_arm.node import SPECS as SIMULATED_ARM_SPECS
from robots import robot_urdf
from ros_harness import Collector, DYNAMICS, has_stamp, NodeProcess, RosClient, wait_until
from sensor_msgs.msg import JointState
import yaml

ROOT = Path(__file__).resolve().parents[2]
FILES = ROOT / 'config' / 'robots'
PAGE = (ROOT / 'docs' / 'evidence' / 'drivers.md').read_text(encoding='utf-8')
NODE = '/cell/arm_model'
"""Another namespace and name than the default, as the files are for any of both."""
NAN = float('nan')


@dataclass(frozen=True)
class Driver:
    """The joint states of a driver, and the robot of the test."""

    names: tuple[str, ...]
    """In the order of the message, a gripper included."""
    effort: tuple[float, ...] = ()
    """NaN where the driver has no effort; () for 0 at every joint."""
    robot: str = ''
    """Of example-robot-data; '' for a generated chain with the joints of the file."""

    def message(self) -> JointState:
        """Return the joint states of an arm at rest."""
        n = len(self.names)
        return JointState(
            name=self.names, position=[0.3] * n,
            velocity=[0.0] * n, effort=self.effort or [0.0] * n)


def numbered(prefix: str, count: int) -> tuple[str, ...]:
    """Return `count` names, which end with 1, 2 and so on."""
    return tuple(f'{prefix}{j}' for j in range(1, count + 1))


DRIVERS = {
    'ros2_control.yaml': Driver(
        (*numbered('joint', 6), 'finger'), (*[0.0] * 6, NAN)),
    'ur.yaml': Driver((
        'elbow_joint', 'shoulder_lift_joint', 'shoulder_pan_joint', 'wrist_1_joint',
        'wrist_2_joint', 'wrist_3_joint'), robot='ur10'),
    'franka_fr3.yaml': Driver(numbered('fr3_joint', 7)),
    'franka_panda.yaml': Driver(numbered('panda_joint', 7), robot='panda'),
    'kinova_gen3.yaml': Driver(
        (*numbered('joint_', 7), 'finger_joint'), (*[0.0] * 7, NAN)),
    'xarm.yaml': Driver(numbered('joint', 7), (NAN,) * 7, robot='xarm7'),
    'kuka_lbr.yaml': Driver(numbered('lbr_A', 7)),
    'openarm.yaml': Driver(
        (*numbered('openarm_joint', 7), 'openarm_finger_joint1')),
    'piper.yaml': Driver((*numbered('joint', 6), 'gripper')),
    'yam.yaml': Driver(numbered('joint', 6)),
    'dm4310.yaml': Driver(numbered('joint', 6)),
}
"""Of Piper the joint states that a relay has completed."""
SPECS = {spec.name: spec for spec in (*SIMULATED_ARM_SPECS, *DYNAMICS_SPECS)}
COMPENSATING = {'ur.yaml', 'franka_fr3.yaml', 'franka_panda.yaml', 'kuka_lbr.yaml', 'yam.yaml'}
RUN = ('ros2_control.yaml', 'ur.yaml', 'kuka_lbr.yaml')
"""A gripper, another order of the joints without effort, and a generated chain."""


def parameters_of(file: str) -> dict[str, Any]:
    """Return the parameters that a file sets, by name."""
    tree = yaml.safe_load((FILES / file).read_text(encoding='utf-8'))
    assert list(tree) == ['/**'], 'expected parameters for any namespace and node name'
    assert list(tree['/**']) == ['ros__parameters']
    return dict(tree['/**']['ros__parameters'])


def joints_of(file: str) -> list[str]:
    """Return the joints that the node must use."""
    return list(parameters_of(file).get('joints', numbered('joint', 6)))


def description(file: str) -> str:
    """Return a URDF that has the joints of the file."""
    if DRIVERS[file].robot:
        return robot_urdf(DRIVERS[file].robot)
    joints = joints_of(file)
    ones = [1.0] * len(joints)
    return planar_arm_urdf(ones, ones, ones, ones, joint_names=joints)


def test_the_page_names_every_file_and_separates_documentation_from_trials():
    files = {path.name for path in FILES.iterdir()}
    assert set(re.findall(r'config/robots/([\w.]+)', PAGE)) == files == set(DRIVERS)
    for text in re.split(r'^## .+$', PAGE, flags=re.MULTILINE)[1:]:
        if 'config/robots/' in text:
            before, source, _ = re.split(r'\*\*From the documentation|\*\*Tried here', text)
            assert before == text.split('**From the documentation')[0]
            assert re.search(r'\b(?=\w*\d)[0-9a-f]{7}\b|\b\d+\.\d+\.\d+\b', source), 'no version'


@pytest.mark.parametrize('file', DRIVERS)
def test_files_are_valid_command_nothing_and_tune_nothing(file):
    parameters = parameters_of(file)
    assert parameters['command'] == 'none'
    assert ('robot_compensates' in parameters) == (file in COMPENSATING)
    assert not {'gains', 'friction', 'actuator', 'robot_description'} & set(parameters)
    assert 'robot_description_file' in (FILES / file).read_text(encoding='utf-8')
    for name, value in parameters.items():
        SPECS[name].check(value)
    assert set(joints_of(file)) <= set(DRIVERS[file].names)


def answer(client: RosClient, states: Any, message: JointState, answers: Collector) -> JointState:
    """Publish the message with the present time until it is answered; return the answer."""
    def is_answered() -> bool:
        message.header.stamp = client.node.get_clock().now().to_msg()
        states.publish(message)
        return answers.find(has_stamp(message.header.stamp), 0.5) is not None

    wait_until(is_answered, 'effort for the joint states of the driver')
    return answers.wait_for(has_stamp(message.header.stamp))


def running(file: str) -> NodeProcess:
    """Return a node with this file and a robot that has its joints."""
    return NodeProcess(
        DYNAMICS, {'robot_description': description(file)},
        arguments=('--ros-args', '--params-file', str(FILES / file)),
        namespace='/cell', node_name='arm_model')


@pytest.mark.parametrize('file', [pytest.param(
    file, marks=() if file in RUN else pytest.mark.soak) for file in DRIVERS])
def test_the_node_runs_on_the_file(client, file):
    """It publishes g(q) for the joints of the file and joint states as the driver sends them."""
    message = DRIVERS[file].message()
    with running(file), \
            client.collect(JointState, f'{NODE}/gravity_compensation') as efforts, \
            client.collect(JointState, '/cell/effort_command') as commands:
        efforts.wait_matched()
        commands.wait_matched()
        states = client.publisher(JointState, '/cell/joint_states')
        gravity = answer(client, states, message, efforts)
        assert list(gravity.name) == joints_of(file)
        assert np.linalg.norm(gravity.effort) > 1.0
        assert not commands.messages
        client.forget(NODE)
