# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The law of docs/examples/spring.py in a separate package, on a running node."""

import os
from pathlib import Path

from closed_loop import NAMES, START
import numpy as np
from page_law import install_page_law, PAGE_MODULE
import pytest
from ros_harness import DYNAMICS, NodeProcess, UNHURRIED, wait_until
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NODE = '/user/dynamics'
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
        assert client.get_parameter(NODE, 'spring.damping') == pytest.approx([30.0])
        assert 'spring.stiffness' in client.rejection(NODE, 'spring.stiffness', [1.0, -1.0])
        assert 'spring.damping' in client.rejection(NODE, 'spring.damping', [1.0, 2.0, 3.0])
        client.set_parameters(NODE, {'spring.damping': [3.0]})  # at which s is 1
        states = client.publisher(JointState, '/user/joint_states', 1)
        goals = client.publisher(JointTrajectory, f'{NODE}/joint_trajectory')
        pushes = client.publisher(Float64MultiArray, f'{NODE}/push')
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
        client.set_parameters(NODE, {'spring.stiffness': changed.tolist()})
        assert is_commanded(changed * ERROR)
        pushed = changed * ERROR + np.array([3.0, -2.0])
        wait_until(lambda: is_commanded(pushed, (3.0, -2.0)), 'the push')
