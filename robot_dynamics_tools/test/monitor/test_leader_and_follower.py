# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A leader in hand guiding feels, by `dynamics_monitor`, a push at the arm that follows it."""

from closed_loop import NAMES, START
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
