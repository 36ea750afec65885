# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The node `simulated_arm` with a presliding distance: a joint yields before it slides."""

import numpy as np
import pytest
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from ros_harness import NodeProcess, RosClient, SIMULATED_ARM
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

START, NAMES = [1.0, 0.5], ['joint1', 'joint2']
COULOMB, DISTANCE = np.array([4.0, 1.5]), np.array([4e-4, 2e-4])
PARAMETERS = {
    'lock_step': True, 'joints': NAMES, 'initial_position': START, 'gravity': [0.0, 0.0, 0.0],
    'friction.viscous': [0.2], 'friction.coulomb': COULOMB.tolist()}
SHARES = np.array([0.5, -0.25])
"""Of F_c: the step of effort."""
STEPS = 400


def displacement(client: RosClient, namespace: str) -> np.ndarray:
    """Return the largest and the last displacement (2, 2) under the step of effort."""
    with client.collect(JointState, f'{namespace}/joint_states') as states:
        efforts = client.publisher(JointState, f'{namespace}/effort_command')
        state, positions = states.wait_for(), []
        for _ in range(STEPS):
            answer = JointState(
                header=state.header, name=NAMES, effort=(SHARES * COULOMB).tolist())
            before = stamp_from_ros(state.header.stamp)
            state = client.ask(
                efforts, answer, states,
                lambda message, then=before: stamp_from_ros(message.header.stamp) > then)
            states.clear()
            positions.append(state.position)
        moved = np.array(positions) - START
        return np.array([np.abs(moved).max(axis=0), moved[-1]])


def test_a_joint_yields_by_its_part_of_the_presliding_distance(client: RosClient) -> None:
    parameters = {**PARAMETERS, 'friction.presliding_distance': DISTANCE.tolist()}
    with NodeProcess(SIMULATED_ARM, parameters, namespace='/yields'):
        largest, last = displacement(client, '/yields')
        assert last == pytest.approx(SHARES * DISTANCE, rel=0.01)
        assert (largest < DISTANCE).all()
        again = client.call(Trigger, '/yields/simulated_arm/reset', Trigger.Request())
        assert again.success
        _, last = displacement(client, '/yields')  # the bristles are relaxed at first
        assert last == pytest.approx(SHARES * DISTANCE, rel=0.01)


def test_without_the_distance_it_does_not_move(client: RosClient) -> None:
    with NodeProcess(SIMULATED_ARM, PARAMETERS, namespace='/sticks'):
        assert np.abs(displacement(client, '/sticks')).max() == 0.0
