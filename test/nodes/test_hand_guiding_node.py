# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`~/force_feedback` and `~/set_point` of nodes with `command: hand_guiding`: two arms coupled."""

from collections.abc import Sequence
import re

from closed_loop import closed_loop, NAMES, START
from disturbances import push, ZERO
import numpy as np
from ros_harness import (
    DYNAMICS,
    LONG,
    MONITOR,
    NodeProcess,
    running,
    SIMULATED_ARM,
    UNHURRIED,
    wait_until,
)
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics

LAW = {'command': 'hand_guiding', 'joints': NAMES, 'hand_guiding.feedback_gain': [0.5]}
ROUGH = {'friction.coulomb': [8.0]}
"""Dry friction [N·m] that holds the arm against the forces that are felt."""
ARM = default_dynamics()


def is_at_rest(message: JointState) -> bool:
    return bool(np.abs(message.velocity).max() < 1e-3)


def test_a_force_is_felt_and_ends_with_its_messages(client):
    force = JointState(name=['gripper', *NAMES[::-1]], effort=[1.0, -6.0, 4.0])

    def excess(message: JointState) -> np.ndarray:
        at = states.messages[-1].position
        return np.subtract(message.effort, ARM.gravity(at))

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
        wait_until(lambda: is_felt(2.0, -3.0), 'the force', LONG)
        wait_until(lambda: is_felt(1.0, -2.0, deviation=[1.0, 1.0]), 'two deviations less', LONG)
        wait_until(lambda: bool(np.abs(excess(efforts.messages[-1])).max() < 0.1), 'its end', LONG)
        guided.provoke(lambda: publisher.publish(JointState(name=['joint1'], effort=[1.0])),
                       re.escape("name leaves out ['joint2']"))


def test_a_follower_follows_its_leader_which_feels_a_push_at_the_follower(client):
    """Nodes and remappings are those of leader_and_follower.launch.py."""
    effort = '/follower/dynamics_monitor/external_effort'
    leader = NodeProcess(DYNAMICS, {**UNHURRIED, **LAW, **ROUGH}, namespace='/leader', arguments=(
        '--ros-args', '-r', f'~/force_feedback:={effort}', '-r',
        f'~/force_feedback_deviation:={effort}_deviation'))
    follower = NodeProcess(
        DYNAMICS, {**UNHURRIED, 'joints': NAMES}, namespace='/follower', arguments=(
            '--ros-args', '-r', '~/set_point:=/leader/joint_states'))
    options = {'rate': 125.0, 'initial_position': START}
    arms = [NodeProcess(SIMULATED_ARM, {**options, **ROUGH}, namespace='/leader'),
            NodeProcess(SIMULATED_ARM, options, namespace='/follower'),
            NodeProcess(MONITOR, namespace='/follower')]

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
