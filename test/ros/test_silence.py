# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What `dynamics` names when no joint states arrive, or nothing receives the command."""

from bounded_waits import wait_until
import pytest
import rclpy
from robot_dynamics.ros.dynamics.silence import no_receiver, no_states, Silence
from ros_harness import RosClient
from sensor_msgs.msg import JointState


@pytest.fixture(scope='module')
def node():
    with RosClient() as client:
        yield client.node


def test_what_is_found_instead_of_joint_states_is_named(node):
    def reason(received=None):
        return no_states(node, ['joint1'], received)

    states = node.create_publisher(JointState, '/arm/joint_states', 1)
    wait_until(lambda: '/arm/joint_states' in reason(), 'the other topic')
    assert reason() == (
        '/joint_states has no publisher, but /arm/joint_states: set '
        '`-r joint_states:=/arm/joint_states`')
    node.create_publisher(JointState, '/joint_states', 1)
    wait_until(lambda: 'no publisher' not in reason(), 'the publisher')
    assert 'which sends nothing: start its driver' in reason()
    assert "has the joints ['a'], expected ['joint1']: set `-r joint" in reason(['a'])
    node.destroy_publisher(states)


def test_a_receiver_elsewhere_is_named_and_an_observer_is_none(node):
    topics = ['/effort_command']
    assert 'start the driver, or its effort controller' in no_receiver(node, topics)
    recorder = rclpy.create_node('rosbag2_recorder', context=node.context)
    recorder.create_subscription(JointState, '/effort_command', print, 1)
    wait_until(lambda: 'except /rosbag2_recorder, which only observe: start the driver' in (
        no_receiver(node, topics)), 'the recorder')
    node.create_subscription(JointState, '/arm/effort_command', print, 1)
    wait_until(lambda: "`-r 'effort_command:=/arm/effort_command'`" in no_receiver(
        node, topics), 'the receiver')
    node.create_subscription(JointState, '/effort_command', print, 1)
    wait_until(lambda: not no_receiver(node, topics), 'the receiver of the topic')
    recorder.destroy_node()


def test_each_reason_is_logged_once_after_some_time(monkeypatch):
    now, logged = [0.0], []
    monkeypatch.setattr('time.monotonic', lambda: now[0])
    silence = Silence(logged.append)
    for now[0], found, count in (
            (1.4, 'no node', 0), (1.6, 'no node', 1), (2.2, 'no publisher', 2),
            (2.3, 'no node', 2), (2.4, '', 2), (3.0, 'no node', 2)):
        silence.reason(found)
        assert logged == ['no node', 'no publisher'][:count]
