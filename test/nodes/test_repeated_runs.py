# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Runs of both nodes in lock-step, with noise, are bit for bit the same."""

from contextlib import ExitStack

from ros_harness import DYNAMICS, NodeProcess, RosClient, running, SIMULATED_ARM
from sensor_msgs.msg import JointState

ARM = {
    'rate': 500.0, 'real_time_factor': 4.0, 'seed': 7, 'position_noise': 1e-5,
    'velocity_noise': 1e-3, 'lock_step': True}


def stamp(m: JointState) -> int:
    return m.header.stamp.sec * 10**9 + m.header.stamp.nanosec


def efforts_of_a_run(
    client: RosClient, namespace: str, is_arm_first: bool,
) -> dict[int, list[float]]:
    """Return the efforts of the first second by their stamp [ns]."""
    nodes = [NodeProcess(DYNAMICS, {'lock_step': True}, namespace=namespace),
             NodeProcess(SIMULATED_ARM, ARM, namespace=namespace)]
    efforts = client.collect(JointState, f'{namespace}/effort_command')
    states = client.collect(JointState, f'{namespace}/joint_states')
    with efforts, states, ExitStack() as stack:
        for node in reversed(nodes) if is_arm_first else nodes:
            stack.enter_context(running(node))
            if node is nodes[1] and is_arm_first:
                states.wait_count(20)  # the first state, again and again
        efforts.wait_for(lambda m: stamp(m) >= 10**9)
        return {stamp(m): list(m.effort) for m in efforts.messages if stamp(m) <= 10**9}


def test_runs_are_bit_for_bit_the_same(client):
    """Also if the first state is published many times before it is answered."""
    first, second = (
        efforts_of_a_run(client, f'/run{k}', is_arm_first) for k, is_arm_first in enumerate(
            [False, True]))
    common = first.keys() & second.keys()
    assert len(common) > 450
    assert [t for t in sorted(common) if first[t] != second[t]] == []
