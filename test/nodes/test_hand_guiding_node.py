# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`command: hand_guiding`, `~/force_feedback` and `~/set_point` on running nodes."""

from collections.abc import Callable, Iterator
from typing import Any

from closed_loop import closed_loop, NAMES, START
from disturbances import push, ZERO
import numpy as np
import pytest
from rclpy.publisher import Publisher
from ros_harness import DYNAMICS, LONG, NodeProcess, RosClient, running, SIMULATED_ARM, wait_until
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics

LAW = {'command': 'hand_guiding', 'joints': NAMES, 'hand_guiding.feedback_gain': [0.5]}
ROUGH = {'friction.coulomb': [8.0]}
"""Dry friction [N·m] that holds the arm against the forces that are felt."""
ARM = default_dynamics()


def is_at_rest(message: JointState) -> bool:
    return bool(np.abs(message.velocity).max() < 1e-3)


def publish_until(publisher: Publisher, message: Any, is_so: Callable[[], bool]) -> None:
    """Publish again and again: the inputs take the newest message, without a receipt."""
    def published() -> bool:
        publisher.publish(message)
        return is_so()
    wait_until(published, str(message)[:100], LONG)


def test_a_push_moves_the_arm_and_leaving_the_mode_holds_it(client):
    with client.collect(JointState, '/guided/joint_states') as states, \
            closed_loop('/guided', LAW, rate=500.0):
        states.wait_count(200)
        assert states.messages[-1].position == pytest.approx(START, abs=1e-4)
        push(client, '/guided/simulated_arm', (0.0, 0.0, 5.0))
        moved = states.wait_for(
            lambda m: np.abs(np.subtract(m.position, START)).max() > 0.3, LONG)
        push(client, '/guided/simulated_arm', ZERO)
        speeds = np.abs([m.velocity for m in states.messages])
        assert moved
        assert speeds.max() < 2.0
        client.set_parameters('/guided/dynamics', {'command': 'computed_torque'})
        wait_until(lambda: is_at_rest(states.messages[-1]), 'rest', LONG)
        held = states.messages[-1].position
        states.wait_count(len(states.messages) + 200)
        assert states.messages[-1].position == pytest.approx(held, abs=0.01)


@pytest.fixture
def guided(client: RosClient) -> Iterator[NodeProcess]:
    with closed_loop('/felt', {**LAW, **ROUGH}, rate=250.0, lock_step=False, **ROUGH) as node:
        yield node


def test_a_force_is_felt_and_ends_with_its_messages(client, guided):
    force = JointState(name=['gripper', *NAMES[::-1]], effort=[1.0, -0.6, 0.4])
    publisher = client.publisher(JointState, '/felt/dynamics/force_feedback')

    def excess(message: JointState) -> np.ndarray:
        at = states.messages[-1].position
        return np.subtract(message.effort, ARM.gravity(at))

    with client.collect(JointState, '/felt/joint_states') as states, \
            client.collect(JointState, '/felt/effort_command') as efforts:
        states.wait_count(100)
        efforts.wait_count(100)

        def is_felt() -> bool:
            publisher.publish(force)
            return bool(np.allclose(excess(efforts.messages[-1]), [0.2, -0.3], atol=0.1))
        wait_until(is_felt, 'the force', LONG)
        wait_until(lambda: bool(np.abs(excess(efforts.messages[-1])).max() < 0.1), 'its end', LONG)
        publish_until(publisher, JointState(name=['joint1'], effort=[1.0]),
                      lambda: "name leaves out ['joint2']" in guided.log)


def test_a_follower_follows_its_leader_which_feels_a_push_at_the_follower(client):
    """Nodes and remappings are those of leader_and_follower.launch.py."""
    effort = '/follower/dynamics/external_effort'
    leader = NodeProcess(DYNAMICS, {**LAW, **ROUGH}, namespace='/leader', arguments=(
        '--ros-args', '-r', f'~/force_feedback:={effort}', '-r',
        f'~/force_feedback_deviation:={effort}_deviation'))
    follower = NodeProcess(DYNAMICS, {'joints': NAMES}, namespace='/follower', arguments=(
        '--ros-args', '-r', '~/set_point:=/leader/joint_states'))
    options = {'rate': 250.0, 'initial_position': START}
    arms = [NodeProcess(SIMULATED_ARM, {**options, **ROUGH}, namespace='/leader'),
            NodeProcess(SIMULATED_ARM, options, namespace='/follower')]

    def error() -> float:
        at = [one.messages[-1].position for one in (led, followed)]
        return float(np.abs(np.subtract(*at)).max())

    with client.collect(JointState, '/leader/joint_states') as led, \
            client.collect(JointState, '/follower/joint_states') as followed, \
            client.collect(JointState, '/leader/effort_command') as efforts, \
            running(leader, follower, *arms):
        for one in (led, followed, efforts):
            one.wait_count(100)
        push(client, '/leader/simulated_arm', (0.0, 0.0, 40.0))
        wait_until(lambda: np.abs(np.subtract(led.messages[-1].position, START)).max() > 0.3,
                   'a motion of the leader', LONG)
        push(client, '/leader/simulated_arm', ZERO)
        wait_until(lambda: is_at_rest(led.messages[-1]) and error() < 0.01, 'the follower', LONG)
        push(client, '/follower/simulated_arm', (0.0, 0.0, 10.0))

        def is_felt() -> bool:
            at = led.messages[-1].position
            felt = np.subtract(efforts.messages[-1].effort, ARM.gravity(at))
            return bool(np.abs(felt).max() > 1.0)
        wait_until(is_felt, 'the push at the leader', LONG)


def test_set_points_of_a_leader_are_followed_and_bad_ones_are_refused(client):
    goal = [START[0] - 0.3, START[1] + 0.2]
    with client.collect(JointState, '/moved/joint_states') as states, \
            closed_loop('/moved', {'joints': NAMES}) as node:
        states.wait_count(50)
        publisher = client.publisher(JointState, '/moved/dynamics/set_point')
        publish_until(publisher, JointState(name=NAMES, position=[0.1]),
                      lambda: 'position has 1 values, expected 2' in node.log)
        point = JointState(name=['gripper', *NAMES], position=[0.0, *goal], velocity=[0.0] * 3)
        publish_until(publisher, point, lambda: bool(
            np.abs(np.subtract(states.messages[-1].position, goal)).max() < 1e-3))


def test_illegal_options_are_refused_by_name(client):
    with NodeProcess(DYNAMICS, {'joints': NAMES}, namespace='/illegal') as node:
        for name, value in (('hand_guiding.friction_share', [0.9]),
                            ('hand_guiding.feedback_gain', [0.6]),
                            ('hand_guiding.speed', [1.0, 2.0, 3.0])):
            assert name in client.rejection('/illegal/dynamics', name, value)
        assert 'Traceback' not in node.log
