# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`command: cartesian_impedance` on running nodes: poses, refusals, a load, the verb `pose`."""

from collections.abc import Iterator, Sequence
import json

from children import run, TIMEOUT
from closed_loop import closed_loop, NAMES, publish, START
from diagnostic_msgs.msg import DiagnosticArray
from disturbances import set_payload
from geometry_msgs.msg import PoseStamped
import numpy as np
import pytest
from robot_dynamics.model import load_arm, make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.task_space.frame_kinematics import FrameKinematics
from ros_harness import DYNAMICS, log_of_failed_start, LONG, NodeProcess, RosClient
from sensor_msgs.msg import JointState
from verb_bench import PROGRAM

LAW = {'command': 'cartesian_impedance', 'condition_references': True, 'scale_gains': True,
       'joints': NAMES, 'cartesian.translation_stiffness': [200.0],
       'cartesian.rotation_stiffness': 0.0}
KINEMATICS = FrameKinematics(load_arm(default_arm_urdf()), 'tool0')
NAMESPACE = '/cartesian'


@pytest.fixture(scope='module')
def node() -> Iterator[NodeProcess]:
    with closed_loop(NAMESPACE, LAW, rate=500.0) as process:
        yield process


def place(q: Sequence[float]) -> np.ndarray:
    return KINEMATICS.pose(np.array(q))[0]


def send_pose(
    client: RosClient, translation: Sequence[float], frame_id: str = 'base_link', w: float = 1.0,
) -> None:
    message = PoseStamped()
    message.header.frame_id = frame_id
    p = message.pose.position
    p.x, p.y, p.z = map(float, translation)
    message.pose.orientation.w = w
    publish(client, f'{NAMESPACE}/dynamics/pose_reference', message)


def test_a_pose_moves_the_frame_and_an_unknown_load_sags_by_its_weight_over_the_stiffness(
    client, node,
):
    goal = place([START[0] - 0.2, START[1] + 0.3])
    with client.collect(JointState, f'{NAMESPACE}/joint_states') as states:
        states.wait_count(200)
        assert states.messages[-1].position == pytest.approx(START, abs=1e-4)
        send_pose(client, goal)
        states.wait_for(
            lambda m: np.abs(place(m.position) - goal).max() < 1e-3
            and np.abs(m.velocity).max() < 1e-3, LONG)
        for mass, sag in ((0.5, 0.5 * 9.81 / 200.0), (0.0, 0.0)):
            set_payload(client, f'{NAMESPACE}/simulated_arm', make_payload('tool0', mass))
            states.wait_for(
                lambda m: np.allclose(  # noqa: B023
                    goal - place(m.position), [0.0, 0.0, sag], atol=2e-3)  # noqa: B023
                and np.abs(m.velocity).max() < 1e-3, LONG)


@pytest.mark.parametrize(('translation', 'frame_id', 'w', 'words'), [
    ([0.5, 0.0, 0.5], 'map', 1.0, "header.frame_id is 'map', expected one of the links that no"),
    ([0.5, 0.0, 0.5], 'tool0', 1.0, "header.frame_id is 'tool0', expected"),
    ([0.5, 0.0, 0.5], '', 1.0, "header.frame_id is '', expected"),
    ([0.5, float('nan'), 0.5], 'base_link', 1.0, 'pose.position[1] (y) is nan'),
    ([0.5, 0.0, 0.5], 'base_link', 3.0, 'pose.orientation has the norm 3, expected 1'),
    ([9.0, 0.0, 0.5], 'base_link', 1.0, "pose of 'tool0' is ")])
def test_a_wrong_pose_is_refused_by_name(client, node, translation, frame_id, w, words):
    def refuses(message: DiagnosticArray) -> bool:
        return any(pair.key == 'refusal of the latest' and words in pair.value
                   for status in message.status for pair in status.values)

    with client.collect(DiagnosticArray, '/diagnostics') as diagnostics:
        send_pose(client, translation, frame_id, w)
        diagnostics.wait_for(refuses, LONG)
    assert 'Traceback' not in node.log


def test_the_verb_moves_to_a_pose_and_names_a_refusal(client, node):
    goal = place(START)
    words = [
        *PROGRAM, 'pose', '--node', f'{NAMESPACE}/dynamics', '--timeout', str(TIMEOUT), '--json']
    done = run([*words, *map(str, goal)], text=True, capture_output=True)
    assert done.returncode == 0, done.stderr
    assert place(json.loads(done.stdout)['position']) == pytest.approx(goal, abs=2e-3)
    turned = run([*words, *map(str, goal), '--rpy', '0', '-0.3', '0'], text=True,
                 capture_output=True)
    assert turned.returncode == 0, turned.stderr
    refused = run([*words, '0.1', '0', '9'], text=True, capture_output=True)
    assert refused.returncode == 1
    assert "rejected the goal: pose of 'tool0' is " in refused.stderr


def test_a_wrong_parameter_is_refused_at_the_start_and_at_run_time(client, node):
    for name, value in (
            ('cartesian.translation_stiffness', [1.0, 2.0]),
            ('cartesian.translation_stiffness', [-1.0]), ('cartesian.rotation_stiffness', -1.0),
            ('cartesian.damping_ratio', 0.0), ('cartesian.frame', 'hand')):
        assert name in client.rejection(f'{NAMESPACE}/dynamics', name, value)
    assert "cartesian.frame is 'hand', expected one of the links" in log_of_failed_start(
        DYNAMICS, {'joints': NAMES, 'cartesian.frame': 'hand'}, namespace='/wrong_frame')
