# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Set-points, hand guiding, and the impedance of a frame on one pair of nodes, at run time.

`~/force_feedback` of a node with `command: hand_guiding`, and the law of docs/examples/spring.py
in a separate package.
"""

from collections.abc import Iterator, Sequence
import os
from pathlib import Path
import re

from closed_loop import closed_loop, NAMES, send, START
from diagnostic_msgs.msg import DiagnosticArray
from disturbances import push, set_payload, ZERO
from geometry_msgs.msg import PoseStamped
import numpy as np
from page_law import install_page_law, PAGE_MODULE
import pytest
from robot_dynamics.model import load_arm, make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.task_space.frame_kinematics import FrameKinematics
from ros_harness import Collector, DYNAMICS, LONG, NodeProcess, RosClient, UNHURRIED, wait_until
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NODE, PLANT = '/laws/dynamics', '/laws/simulated_arm'
KINEMATICS = FrameKinematics(load_arm(default_arm_urdf()), 'tool0')


@pytest.fixture(scope='module')
def node() -> Iterator[NodeProcess]:
    with closed_loop('/laws', {
            'joints': NAMES, 'cartesian.translation_stiffness': [200.0],
            'cartesian.rotation_stiffness': 0.0}) as process:
        yield process


@pytest.fixture
def states(client: RosClient, node: NodeProcess) -> Iterator[Collector]:
    """Return the joint states of the arm without a load, at rest at START."""
    set_payload(client, PLANT)
    client.set_parameters(NODE, {'command': 'computed_torque'})
    with client.collect(JointState, '/laws/joint_states') as collector:
        collector.wait_count(50)
        send(client, '/laws', (1.0, START))
        collector.wait_for(lambda m: rests_at(m, START), LONG)
        collector.clear()
        yield collector


def rests_at(state: JointState, q: Sequence[float], within: float = 1e-3) -> bool:
    return bool(np.abs(np.subtract(state.position, q)).max() < within and is_at_rest(state))


def is_at_rest(state: JointState) -> bool:
    return bool(np.abs(state.velocity).max() < 1e-3)


def test_set_points_of_a_leader_are_followed_and_bad_ones_are_refused(client, node, states):
    goal = [START[0] - 0.3, START[1] + 0.2]
    publisher = client.publisher(JointState, f'{NODE}/set_point')
    node.provoke(lambda: publisher.publish(JointState(name=NAMES, position=[0.1])),
                 'position has 1 values, expected 2')
    point = JointState(name=['gripper', *NAMES], position=[0.0, *goal], velocity=[0.0] * 3)
    client.ask(publisher, point, states, lambda m: rests_at(m, goal), LONG)


def test_a_push_moves_a_guided_arm_and_leaving_the_mode_holds_it(client, states):
    client.set_parameters(NODE, {'command': 'hand_guiding'})
    states.wait_count(len(states.messages) + 200)
    # `states` begins within 1e-3 of START and below 1e-3 rad/s, and 200 states are 1.6 s.
    assert states.messages[-1].position == pytest.approx(START, abs=2.6e-3)
    push(client, PLANT, (0.0, 0.0, 5.0))
    states.wait_for(lambda m: np.abs(np.subtract(m.position, START)).max() > 0.3, LONG)
    push(client, PLANT, ZERO)
    assert np.abs([m.velocity for m in states.messages]).max() < 2.0
    client.set_parameters(NODE, {'command': 'computed_torque'})
    wait_until(lambda: is_at_rest(states.messages[-1]), 'rest', LONG)
    held = states.messages[-1].position
    states.wait_count(len(states.messages) + 200)
    assert states.messages[-1].position == pytest.approx(held, abs=0.01)


# --- poses ---------------------------------------------------------------------------------------

def place(q: Sequence[float]) -> np.ndarray:
    return KINEMATICS.pose(np.array(q))[0]


def pose(translation: Sequence[float], frame_id: str = 'base_link', w: float = 1.0) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id = frame_id
    p = message.pose.position
    p.x, p.y, p.z = map(float, translation)
    message.pose.orientation.w = w
    return message


def test_a_pose_moves_the_frame_and_an_unknown_load_sags_by_its_weight_over_the_stiffness(
    client, states,
):
    client.set_parameters(NODE, {'command': 'cartesian_impedance'})
    goal = place([START[0] - 0.2, START[1] + 0.3])
    publisher = client.publisher(PoseStamped, f'{NODE}/pose_reference')

    def rests_below(m: JointState, sag: float) -> bool:
        return bool(np.allclose(goal - place(m.position), [0.0, 0.0, sag], atol=2e-3)
                    and is_at_rest(m))

    client.ask(publisher, pose(goal), states, lambda m: rests_below(m, 0.0), LONG)
    set_payload(client, PLANT, make_payload('tool0', 0.5))
    states.wait_for(lambda m: rests_below(m, 0.5 * 9.81 / 200.0), LONG)


@pytest.mark.parametrize(('message', 'words'), [
    (pose([0.5, 0.0, 0.5], 'map'), "header.frame_id is 'map', expected one of the links that no"),
    (pose([0.5, float('nan'), 0.5]), 'pose.position[1] (y) is nan'),
    (pose([0.5, 0.0, 0.5], w=1.02), 'pose.orientation has the norm 1.02, expected 1'),
    (pose([9.0, 0.0, 0.5]), "pose of 'tool0' is ")], ids=['frame', 'nan', 'norm', 'far'])
def test_a_wrong_pose_is_refused_by_name(client, node, message, words):
    client.set_parameters(NODE, {'command': 'cartesian_impedance'})

    def refuses(report: DiagnosticArray) -> bool:
        return any(pair.key == 'refusal of the latest' and words in pair.value
                   for status in report.status for pair in status.values)

    publisher = client.publisher(PoseStamped, f'{NODE}/pose_reference')
    with client.collect(DiagnosticArray, '/diagnostics') as diagnostics:
        client.ask(publisher, message, diagnostics, refuses)
    assert 'Traceback' not in node.log


def test_wrong_parameters_of_the_laws_are_refused_by_name(client, node):
    for name, value in (
            ('cartesian.translation_stiffness', [1.0, 2.0]),
            ('cartesian.translation_stiffness', [-1.0]), ('cartesian.rotation_stiffness', -1.0),
            ('cartesian.frame', 'hand'), ('impedance.stiffness', [1.0, 2.0, 3.0]),
            ('hand_guiding.speed', [1.0, 2.0, 3.0])):
        assert name in client.rejection(NODE, name, value)
    assert 'Traceback' not in node.log


LAW = {'command': 'hand_guiding', 'joints': NAMES}
ROUGH = {'friction.coulomb': [8.0]}
"""Dry friction [N·m] that holds the arm against the forces that are felt."""
MODEL = default_dynamics()


def test_a_force_is_felt_and_ends_with_its_messages(client):
    force = JointState(name=['gripper', *NAMES[::-1]], effort=[1.0, -10.0, 8.0])

    def excess(message: JointState) -> np.ndarray:
        return np.subtract(message.effort, MODEL.gravity(states.messages[-1].position))

    with client.collect(JointState, '/felt/joint_states') as states, \
            client.collect(JointState, '/felt/effort_command') as efforts, closed_loop(
                '/felt', {**UNHURRIED, **LAW, **ROUGH}, lock_step=False, **ROUGH) as guided:
        publisher = client.publisher(JointState, '/felt/dynamics/force_feedback')
        deviations = client.publisher(JointState, '/felt/dynamics/force_feedback_deviation')
        states.wait_count(100)
        efforts.wait_count(100)

        def is_felt(*expected: float, deviation: Sequence[float] = ()) -> bool:
            if deviation:
                deviations.publish(JointState(name=NAMES, effort=deviation))
            publisher.publish(force)
            return bool(np.allclose(excess(efforts.messages[-1]), expected, atol=0.1))
        wait_until(lambda: is_felt(2.4, -3.0), 'the force', LONG)
        wait_until(lambda: is_felt(1.8, -2.4, deviation=[1.0, 1.0]), 'two deviations less', LONG)
        wait_until(lambda: bool(np.abs(excess(efforts.messages[-1])).max() < 0.1), 'its end', LONG)
        guided.provoke(lambda: publisher.publish(JointState(name=['joint1'], effort=[1.0])),
                       re.escape("name leaves out ['joint2']"))


USER_NODE = '/user/dynamics'
ERROR = np.array([0.05, -0.02])
"""[rad] of the reference from the position of the arm."""


def test_the_law_has_25_lines():
    law = PAGE_MODULE[PAGE_MODULE.index('class Spring'):PAGE_MODULE.index('if __name__')]
    assert len([line for line in law.splitlines() if line.strip()]) <= 25


def test_a_law_in_another_package_has_parameters_and_a_topic(client, tmp_path: Path):
    """The parameters have names, defaults and ranges, and act at the next state."""
    install_page_law(tmp_path)
    gravity, changed = default_dynamics().gravity(START), np.array([10.0, 15.0])
    state = JointState(name=NAMES, position=START, velocity=[0.0, 0.0])
    state.header.stamp.sec = 1
    with NodeProcess(
            DYNAMICS, {
                **UNHURRIED, 'joints': NAMES, 'command': 'own_spring',
                'spring.stiffness': [20.0], 'effort_rate_limit': 1e9},
            namespace='/user', environment={
                'PYTHONPATH': f'{tmp_path}{os.pathsep}{os.environ.get("PYTHONPATH", "")}'}), \
            client.collect(JointState, '/user/effort_command') as commands:
        assert client.get_parameter(USER_NODE, 'spring.damping') == pytest.approx([30.0])
        assert 'spring.stiffness' in client.rejection(USER_NODE, 'spring.stiffness', [1.0, -1.0])
        assert 'spring.damping' in client.rejection(USER_NODE, 'spring.damping', [1.0, 2.0, 3.0])
        client.set_parameters(USER_NODE, {'spring.damping': [3.0]})  # at which s is 1
        states = client.publisher(JointState, '/user/joint_states', 1)
        goals = client.publisher(JointTrajectory, f'{USER_NODE}/joint_trajectory')
        pushes = client.publisher(Float64MultiArray, f'{USER_NODE}/push')
        client.answer_to(states, state, commands)
        goals.publish(JointTrajectory(joint_names=NAMES, points=[
            JointTrajectoryPoint(positions=np.add(START, ERROR).tolist())]))

        def is_commanded(beyond_gravity: np.ndarray, push: tuple[float, ...] = ()) -> bool:
            if push:
                pushes.publish(Float64MultiArray(data=push))
            state.header.stamp.nanosec += 1_000_000
            effort = client.answer_to(states, state, commands).effort
            return bool(np.allclose(effort, gravity + beyond_gravity))

        wait_until(  # until the reference rests
            lambda: all(is_commanded(20.0 * ERROR) for _ in range(20)),
            'the stiffness of the start')
        client.set_parameters(USER_NODE, {'spring.stiffness': changed.tolist()})
        assert is_commanded(changed * ERROR)
        pushed = changed * ERROR + np.array([3.0, -2.0])
        wait_until(lambda: is_commanded(pushed, (3.0, -2.0)), 'the push')
