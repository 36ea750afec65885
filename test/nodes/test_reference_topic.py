# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`~/reference` of a real node: the reference at each state, and no message without one."""

from typing import Any

from fault_bench import NAMES, nanoseconds_of, Q, stamp_of
import numpy as np
import pytest
from robot_dynamics.references.follower import ActiveTrajectory
from robot_dynamics.ros.middleware.conversions import trajectory_to_ros
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.quintics import quintic_via_points
from ros_harness import DYNAMICS, NodeProcess
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

START = 12_000_000_789
"""When the trajectory begins [ns], by the stamps of the joint states."""


def state(nanoseconds: int, **fields: Any) -> JointState:
    """Return a joint state; the arm stays at its position, but its sample does not repeat."""
    q = [Q[0] + 1e-12 * (nanoseconds // 1000 % 997), Q[1] - 1e-12 * (nanoseconds // 1000 % 991)]
    message = JointState(**{'name': NAMES, 'position': q, 'velocity': [0.0, 0.0], **fields})
    message.header.stamp = stamp_of(nanoseconds)
    return message


def test_it_is_the_trajectory_at_the_stamp_of_the_state(client):
    """In the joint order of the node, independent of the order of the trajectory."""
    trajectory = quintic_via_points(
        NAMES, [0.0, 1.0, 2.5], [Q, [Q[0] + 0.7, Q[1] - 0.4], [Q[0] - 0.3, Q[1] + 0.2]])
    rest = Reference(np.array(Q), np.zeros(2), np.zeros(2))
    expected = ActiveTrajectory(trajectory, START, START, rest)
    parameters = {'joints': NAMES[::-1], 'require_measured_velocities': True}
    with NodeProcess(DYNAMICS, parameters, namespace='/reference'), \
            client.collect(JointState, '/reference/dynamics/reference') as references:
        references.wait_matched()
        states = client.publisher(JointState, '/reference/joint_states', 1)
        trajectories = client.publisher(
            JointTrajectory, '/reference/dynamics/joint_trajectory')
        with client.collect(
                JointState, '/reference/dynamics/gravity_compensation') as gravity:
            gravity.wait_matched()
            found = client.answer_to(states, state(START - 1_000_000_000), references)
            check_held(found)  # from the first state on
            message = trajectory_to_ros(trajectory)
            message.header.stamp = stamp_of(START)
            trajectories.publish(message)
            trajectories.wait_for_all_acked()
            client.get_parameter('/reference/dynamics', 'command')  # answered after that message
            check_held(client.answer_to(states, state(START - 500_000_000), references))
            for ns in range(START, START + 3_000_000_000, 70_000_123):
                found = client.answer_to(states, state(ns), references)
                position, velocity, _ = expected.sample(ns)
                assert list(found.name) == NAMES[::-1]
                assert found.position == pytest.approx(position[::-1], abs=1e-8)
                assert found.velocity == pytest.approx(velocity[::-1], abs=1e-8)
                assert list(found.effort) == []
            assert found.velocity == pytest.approx([0.0, 0.0], abs=1e-8)  # the end is held
            # a state without velocity ends the trajectory, and then the measured position is held
            client.answer_to(states, state(ns + 1_000_000, velocity=[]), gravity)
            check_held(client.answer_to(states, state(ns + 2_000_000), references))
            client.set_parameters('/reference/dynamics', {'command': 'gravity_compensation'})
            client.answer_to(states, state(ns + 3_000_000), gravity)
            client.set_parameters('/reference/dynamics', {'command': 'computed_torque'})
            check_held(client.answer_to(states, state(ns + 4_000_000), references))
    stamps = [nanoseconds_of(message.header.stamp) for message in references.messages]
    assert not {ns + 1_000_000, ns + 3_000_000} & set(stamps)


def check_held(message: JointState) -> None:
    """Check that a reference is a rest at `Q`."""
    assert message.position == pytest.approx(Q[::-1], abs=1e-8)
    assert message.velocity == pytest.approx([0.0, 0.0], abs=1e-7)
