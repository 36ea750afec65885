# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics connect` with a simulated arm that its own controller moves."""

from collections.abc import Iterator
import os
from pathlib import Path
import sys
from typing import Any

from geometry_msgs.msg import Vector3
import numpy as np
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_parameters import read_parameter_file
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.conversions import trajectory_to_ros
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from robot_dynamics_tools.commands.connect import main
from robot_dynamics_tools.connect.checks import Checklist
from robot_dynamics_tools.connect.robot import gravity_of_imu
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient
from ros_harness import DYNAMICS, NodeProcess, RosClient, running, SIMULATED_ARM
from sensor_msgs.msg import Imu, JointState
from trajectory_msgs.msg import JointTrajectory

URDF = default_arm_urdf()
JOINTS = ['joint1', 'joint2']
GRAVITY = [9.81, 0.0, 0.0]
"""Of a base that is mounted on its side."""
POSES = [[0.8, 0.5], [-0.6, 0.9], [0.4, -1.2], [-0.9, -0.7]]


@pytest.fixture(scope='module', autouse=True)
def nodes() -> Iterator[None]:
    """Run an arm on its side, whose first drive reports half of its torque, and a controller."""
    of_arm = {'joints': JOINTS, 'lock_step': True, 'gravity': GRAVITY}
    with running(
            NodeProcess(
                DYNAMICS, of_arm | {'robot_description': URDF}, node_name='controller'),
            NodeProcess(SIMULATED_ARM, of_arm | {
                'rate': 100.0, 'real_time_factor': 2.0, 'initial_position': POSES[0],
                'effort.report_scale': [2.0, 1.0]})):
        yield


@pytest.fixture(scope='module')
def client() -> Iterator[RosClient]:
    with RosClient() as started:
        yield started


@pytest.fixture
def moving(client: RosClient) -> None:
    """Let the controller move the arm through the poses again and again, and hold each for 3 s."""
    points = 8 * [pose for pose in [*POSES[1:], POSES[0]] for _ in range(2)]
    motion = make_trajectory(
        JOINTS, 3.0 * np.arange(1, len(points) + 1), points, np.zeros_like(points))
    topic = client.publisher(JointTrajectory, '/controller/joint_trajectory')
    with client.collect(JointState, '/controller/reference') as references:
        client.ask(topic, trajectory_to_ros(motion), references,
                   lambda reference: max(map(abs, reference.velocity)) > 0.1)


def run(path: Path, *options: Any) -> int:
    return main(['--passive', '--output', str(path), '--timeout', '60', *map(str, options)])


def test_the_file_has_mount_and_scale_of_the_arm(client, moving, capsys, tmp_path):
    output, page = tmp_path / 'my.yaml', tmp_path / 'my.html'
    with client.describing('') as publish:
        publish(URDF)
        status = run(output, '--poses', '4', '--duration', '60', '--report', page)
    out, err = capsys.readouterr()
    assert status == 0, out + err
    found = read_parameter_file(output)
    assert found['joints'] == JOINTS
    np.testing.assert_allclose(found['gravity'], GRAVITY, atol=0.05)
    np.testing.assert_allclose(found['effort.report_scale'], [2.0, 1.0], rtol=0.01)
    assert found['command'] == 'none'
    assert load_arm(found['robot_description']).limits.effort.tolist() == [150.0, 60.0]
    assert 'check    other commands: /controller (expected: no other node' in out
    assert 'check    mount: the base is tilted by 90°' in out
    assert 'good     watchdog: after 0.2 s' in out
    assert '4 / 4 poses' in err
    assert 'report of joint1' in page.read_text(encoding='utf-8')


@pytest.mark.parametrize(('options', 'said'), [
    ([], 'no description on /robot_description, expected robot_state_publisher, or --urdf FILE'),
    (['--topic', '/absent'], 'no joint states on /absent in 1 s; published topics of this type: '),
    (['--output', __file__], 'exists, expected the name of a new file, or --force'),
    (['--urdf', 'absent.urdf'], "--urdf is 'absent.urdf', which cannot be read: there is no such"),
])
def test_an_error_is_one_line(capsys, tmp_path, options, said):
    assert run(tmp_path / 'my.yaml', '--timeout', '1', *options) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count('\n') == 1
    assert not os.listdir(tmp_path)


def test_no_motion_without_a_terminal_to_ask_on(monkeypatch, capsys, tmp_path):
    with Path(os.devnull).open(encoding='utf-8') as nothing:
        monkeypatch.setattr(sys, 'stdin', nothing)
        assert main(['--output', str(tmp_path / 'my.yaml')]) == 2
    assert capsys.readouterr().err.startswith('connect: standard input is no terminal, expected')


def test_two_publishers_of_the_same_joints_are_named(client, capsys, tmp_path):
    topic, urdf = '/twice/joint_states', tmp_path / 'arm.urdf'
    urdf.write_text(URDF, encoding='utf-8')
    both = [client.publisher(JointState, topic, subscribers=0) for _ in range(2)]
    state = JointState(name=JOINTS, position=POSES[0])
    timer = client.node.create_timer(0.02, lambda: [each.publish(state) for each in both])
    assert run(tmp_path / 'my.yaml', '--topic', topic, '--urdf', urdf) == 1
    client.node.destroy_timer(timer)
    assert capsys.readouterr().err.endswith(
        'joint states: /twice/joint_states of /test_client, /test_client (expected: one publisher '
        'per joint)\n')


def test_an_arm_that_another_node_commands_is_not_commanded(capsys, tmp_path):
    urdf = tmp_path / 'arm.urdf'
    urdf.write_text(URDF, encoding='utf-8')
    assert main(['--yes', '--output', str(tmp_path / 'my.yaml'), '--urdf', str(urdf), '--poses',
                 '1', '--duration', '20', '--timeout', '60', '--gravity', '9.81', '0', '0']) == 1
    assert 'before the command: of /controller (expected: no other node' in capsys.readouterr().out


def test_an_imu_of_the_base_shows_its_mount(client):
    topic = client.publisher(Imu, '/base/imu', subscribers=0)
    message = Imu(linear_acceleration=Vector3(x=-9.7))
    message.header.frame_id, message.orientation_covariance[0] = 'base_link', -1.0
    timer = client.node.create_timer(0.05, lambda: topic.publish(message))
    with DynamicsClient(timeout=60.0) as own:
        own.wait(lambda: own.node.count_publishers('/base/imu'))
        gravity, where = gravity_of_imu(own, load_arm(URDF), Checklist())
    client.node.destroy_timer(timer)
    assert where == '/base/imu'
    np.testing.assert_allclose(gravity, GRAVITY, atol=1e-9)
