# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`~/force_feedback` of a node with `command: hand_guiding`."""

from collections.abc import Sequence
import re

from closed_loop import closed_loop, NAMES
import numpy as np
from ros_harness import LONG, UNHURRIED, wait_until
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics

LAW = {'command': 'hand_guiding', 'joints': NAMES}
ROUGH = {'friction.coulomb': [8.0]}
"""Dry friction [N·m] that holds the arm against the forces that are felt."""
ARM = default_dynamics()


def test_a_force_is_felt_and_ends_with_its_messages(client):
    force = JointState(name=['gripper', *NAMES[::-1]], effort=[1.0, -10.0, 8.0])

    def excess(message: JointState) -> np.ndarray:
        return np.subtract(message.effort, ARM.gravity(states.messages[-1].position))

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
