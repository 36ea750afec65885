# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`~/feed_forward` and `~/position_offset` of real nodes, with the drives of `simulated_arm`."""

from closed_loop import closed_loop, collecting, NAMES, send, START
import numpy as np
import pytest
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from ros_harness import DYNAMICS, LONG, NodeProcess, running, SIMULATED_ARM, UNHURRIED
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics

STIFFNESS, DAMPING = [240.0, 31.0], [20.0, 3.0]
DRIVES = {'joints': NAMES, 'drive.stiffness': STIFFNESS, 'drive.damping': DAMPING}
BODY = default_dynamics().rigid_body


def stamp_of(message: JointState) -> int:
    return stamp_from_ros(message.header.stamp)


def test_the_drives_hold_and_move_the_arm_without_sag(client):
    """Gravity alone would be an error of 140 and 370 mrad; the feed-forward leaves 2 mrad."""
    namespace = '/drives'
    with collecting(
            client, namespace, 'joint_states', 'dynamics/feed_forward') as (states, commands), \
            closed_loop(namespace, **DRIVES):
        states.wait_count(200)
        assert states.messages[-1].position == pytest.approx(START, abs=1e-6)
        held = commands.wait_for(lambda m: stamp_of(m) >= 100_000_000)
        assert list(held.name) == NAMES
        assert held.effort == pytest.approx(BODY.gravity(np.array(START)), rel=1e-6)
        goal = [START[0] - 0.4, START[1] + 0.4]
        send(client, namespace, (2.0, goal))
        states.wait_for(lambda m: np.abs(np.array(m.position) - goal).max() < 2e-3 and (
            np.abs(m.velocity).max() < 1e-3), LONG)
        reference = {stamp_of(m): m for m in commands.messages}
        errors = [np.subtract(reference[stamp_of(m)].position, m.position)
                  for m in states.messages if stamp_of(m) in reference]
    assert np.abs(errors).max() < 2e-3
    moving = [m for m in commands.messages if np.abs(np.subtract(m.position, goal)).min() > 0.1
              and np.abs(np.subtract(m.position, START)).min() > 0.1]
    assert len(moving) > 20
    assert all(all(m.velocity) for m in moving)  # 0 would let the drives brake the arm


def test_drives_without_a_torque_input_take_the_offset(client):
    """A message without efforts: the position error of the drive is the effort over k_p."""
    arm = NodeProcess(
        SIMULATED_ARM, {'rate': 250.0, 'lock_step': True, 'initial_position': START, **DRIVES},
        namespace='/offset', remaps={'dynamics/feed_forward': 'dynamics/position_offset'})
    node = NodeProcess(
        DYNAMICS, {'joints': NAMES, 'drive.stiffness': STIFFNESS, 'lock_step': True},
        namespace='/offset')
    with running(node, arm), collecting(
            client, '/offset', 'joint_states', 'dynamics/position_offset') as (states, commands):
        states.wait_count(500)
        found = commands.wait_for()
        assert states.messages[-1].position == pytest.approx(START, abs=1e-6)
    offset = np.subtract(found.position, START)
    assert offset == pytest.approx(BODY.gravity(np.array(START)) / STIFFNESS, rel=1e-6)
    assert not len(found.effort)


def test_no_command_follows_an_invalid_state(client):
    """Only fresh and valid states are answered; without a stiffness there is no offset."""
    with NodeProcess(DYNAMICS, UNHURRIED, namespace='/fresh') as node, \
            client.collect(JointState, '/fresh/dynamics/position_offset') as offsets, \
            client.collect(JointState, '/fresh/dynamics/feed_forward') as commands:
        commands.wait_matched()
        states = client.publisher(JointState, '/fresh/joint_states', 1)
        good = JointState(name=NAMES, position=START, velocity=[0.0, 0.0])
        good.header.stamp = client.node.get_clock().now().to_msg()
        client.answer_to(states, good, commands)
        bad = JointState(name=NAMES, position=[0.1, float('nan')], velocity=[0.0, 0.0])
        bad.header.stamp = client.node.get_clock().now().to_msg()
        node.provoke(lambda: states.publish(bad), 'Dropped a joint state: position of')
        assert all(message.header.stamp == good.header.stamp for message in commands.messages)
        node.wait_for_log('position_offset: drive.stiffness is empty')
        assert not offsets.messages


def test_the_drives_refuse_a_wrong_command(client):
    with NodeProcess(SIMULATED_ARM, DRIVES, namespace='/refusing') as arm:
        commands = client.publisher(JointState, '/refusing/dynamics/feed_forward')
        arm.provoke(
            lambda: commands.publish(JointState(name=NAMES, position=START, effort=[0.0, 0.0])),
            'Rejected an effort: velocity is empty')
