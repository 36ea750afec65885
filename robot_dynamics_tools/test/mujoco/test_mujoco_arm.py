# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The running node `mujoco_arm`, alone and in lock-step with `dynamics`."""

from collections.abc import Iterator
from importlib import import_module
from typing import Any

from absent_libraries import environment_without
from disturbances import push, ZERO
import numpy as np
import pytest
from robot_dynamics.ros.parameters.declared_parameters import NODES, OF_TOOLS
from robot_dynamics_tools.mujoco.mujoco_arm import SPECS
from ros_harness import DYNAMICS, log_of_failed_start, MUJOCO_ARM, NodeProcess, running
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

NAMES = ['joint1', 'joint2']
START = [0.4, 0.3]


@pytest.fixture(scope='module', autouse=True)
def mujoco() -> Any:
    return pytest.importorskip('mujoco')


@pytest.fixture(scope='module')
def loop() -> Iterator[NodeProcess]:
    """Run both nodes in lock-step; the names of the joints are those of the URDF."""
    arm = NodeProcess(
        MUJOCO_ARM, {'lock_step': True, 'initial_position': START, 'joints': NAMES},
        namespace='/mujoco')
    with running(arm, NodeProcess(DYNAMICS, {'lock_step': True}, namespace='/mujoco')):
        yield arm


def test_it_holds_and_is_pushed_and_reset(client, loop):
    with client.collect(JointState, '/mujoco/joint_states') as states:
        first = states.wait_for(lambda state: state.header.stamp.sec >= 2)
        assert list(first.name) == NAMES
        assert np.abs(np.array(first.position) - START).max() < 0.005
        assert np.abs(first.velocity).max() < 1e-3
        assert np.abs(first.effort).min() > 1.0  # holds its weight
        push(client, '/mujoco/mujoco_arm', (0.0, 0.0, 60.0), 'link2')
        states.wait_for(lambda state: np.abs(np.array(state.position) - START).max() > 0.02)
        push(client, '/mujoco/mujoco_arm', ZERO, 'link2')
        states.wait_for(lambda state: np.abs(np.array(state.position) - START).max() < 0.005)
    assert client.call(Trigger, '/mujoco/mujoco_arm/reset', Trigger.Request()).success


def test_invalid_messages_are_named_and_nothing_ends(client, loop):
    loop.provoke(
        lambda: push(client, '/mujoco/mujoco_arm', ZERO, 'elbow'),
        "Rejected a message of ~/external_wrench: header.frame_id is 'elbow', expected a body of "
        'the MJCF')
    effort = client.publisher(JointState, '/mujoco/effort_command', 1)
    loop.provoke(
        lambda: effort.publish(JointState(name=NAMES, effort=[float('inf'), 0.0])),
        'Rejected an effort: .*inf')
    with client.collect(JointState, '/mujoco/joint_states') as states:
        time = states.wait_for(lambda _: True).header.stamp
        states.wait_for(lambda state: state.header.stamp.sec > time.sec + 1)


def test_an_invalid_start_is_one_line():
    log = log_of_failed_start(MUJOCO_ARM, {'joints': ['joint1', 'elbow']})
    line, = [line for line in log.splitlines() if line.startswith('robot_dynamics: ')]
    assert "mjcf_joints[1] is 'elbow', expected the name" in line


def test_without_mujoco_the_extra_is_named(tmp_path):
    log = log_of_failed_start(MUJOCO_ARM, environment=environment_without(tmp_path, ['mujoco']))
    assert "(the extra 'mujoco') needs the library MuJoCo, which cannot be imported" in log


def test_other_nodes_accept_its_parameters_in_a_shared_file(tmp_path):
    known = {spec.name for name in NODES for spec in import_module(name).SPECS}
    assert {spec.name for spec in SPECS} <= known | OF_TOOLS
    file = tmp_path / 'shared.yaml'
    file.write_text('/**: {ros__parameters: {mjcf: a.xml, mjcf_joints: [a]}}\n', encoding='utf-8')
    with NodeProcess(DYNAMICS, namespace='/shared', arguments=[
            '--ros-args', '--params-file', str(file)]) as node:
        assert 'unknown parameter' not in node.log
