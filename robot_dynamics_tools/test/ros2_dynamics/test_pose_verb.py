# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The verb `pose` with a node."""

from collections.abc import Iterator, Sequence
import json

from children import run, TIMEOUT
from closed_loop import closed_loop, NAMES, send, START
from disturbances import set_payload
import numpy as np
import pytest
from robot_dynamics.model import load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.task_space.frame_kinematics import FrameKinematics
from ros_harness import Collector, LONG, NodeProcess, RosClient
from sensor_msgs.msg import JointState
from verb_bench import PROGRAM

NODE, PLANT = '/posed/dynamics', '/posed/simulated_arm'
ARM = load_arm(default_arm_urdf())
KINEMATICS = FrameKinematics(ARM, 'tool0')


@pytest.fixture(scope='module')
def node() -> Iterator[NodeProcess]:
    with closed_loop('/posed', {
            'joints': NAMES, 'cartesian.translation_stiffness': [200.0],
            'cartesian.rotation_stiffness': 0.0}) as process:
        yield process


@pytest.fixture
def states(client: RosClient, node: NodeProcess) -> Iterator[Collector]:
    """Return the joint states of the arm without a load, at rest at START."""
    set_payload(client, PLANT)
    client.set_parameters(NODE, {'command': 'computed_torque'})
    with client.collect(JointState, '/posed/joint_states') as collector:
        collector.wait_count(50)
        send(client, '/posed', (1.0, START))
        collector.wait_for(lambda m: rests_at(m, START), LONG)
        collector.clear()
        yield collector


def rests_at(state: JointState, q: Sequence[float], within: float = 1e-3) -> bool:
    return bool(np.abs(np.subtract(state.position, q)).max() < within and is_at_rest(state))


def is_at_rest(state: JointState) -> bool:
    return bool(np.abs(state.velocity).max() < 1e-3)


def place(q: Sequence[float]) -> np.ndarray:
    return KINEMATICS.pose(np.array(q))[0]


def test_the_verb_moves_to_a_pose_and_names_a_refusal(client, states):
    client.set_parameters(NODE, {'command': 'cartesian_impedance'})
    goal = place([START[0] - 0.1, START[1] + 0.1])
    words = [*PROGRAM, 'pose', '--node', NODE, '--timeout', str(TIMEOUT), '--json']
    done = run([*words, *map(str, goal)], text=True, capture_output=True)
    assert done.returncode == 0, done.stderr
    assert place(json.loads(done.stdout)['position']) == pytest.approx(goal, abs=2e-3)
    refused = run([*words, '0.1', '0', '9'], text=True, capture_output=True)
    assert refused.returncode == 1
    assert "rejected the goal: pose of 'tool0' is " in refused.stderr
