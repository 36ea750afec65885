# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The topics of `dynamics`: joint states and references in, efforts and references out."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from builtin_interfaces.msg import Time
from fault_bench import nanoseconds_of, stamp_of
import numpy as np
import pytest
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.references.active_trajectory import ActiveTrajectory
from robot_dynamics.ros.middleware.conversions import trajectory_to_ros
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.quintics import quintic_via_points
from robot_dynamics_interfaces.msg import DynamicsTerms
from ros_harness import Collector, DYNAMICS, NodeProcess, RosClient, UNHURRIED, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NAMES = ['joint1', 'joint2']
Q = [np.pi / 4, np.pi / 6]
G = [-49.52282521, -11.37087883]
M = np.array([[6.95846097, 1.56923048], [1.56923048, 0.53]])
FREQUENCY = 15.0, 10.0
"""ω [rad/s] of the joints, at which the gains of states at 100 Hz are not lowered."""
STEP = 10_000_000
"""[ns] between two states."""


@dataclass
class Bench:
    """A node, a publisher of its joint states, and collectors of the topics that it publishes."""

    client: RosClient
    node: NodeProcess
    namespace: str
    states: Any
    trajectories: Any
    efforts: Collector
    gravity: Collector
    computed_torque: Collector
    count: int = 0
    """Number of states."""

    def state(self, q: Any = Q, names: Any = None) -> JointState:
        """Return a state of an arm at rest, STEP after the one before; its samples differ."""
        self.count += 1
        q = [each + 2.5e-16 * (self.count % 16) for each in q]
        message = JointState(name=names or NAMES, position=q, velocity=[0.0] * len(q))
        message.header.stamp = stamp_of(1_123_456_789 + STEP * self.count)
        return message

    def command(self, state: JointState) -> Any:
        """Return the effort command for a state."""
        return self.client.answer_to(self.states, state, self.efforts)

    def topic(self, name: str) -> str:
        return f'{self.namespace}/{name}'

    def follow(self, point: JointTrajectoryPoint) -> None:
        """Send a set-point."""
        self.trajectories.publish(JointTrajectory(joint_names=NAMES, points=[point]))


def make_bench(client: RosClient, node: NodeProcess, namespace: str) -> Bench:
    efforts, gravity, computed_torque = (
        client.collect(JointState, f'{namespace}/{topic}') for topic in (
            'effort_command', 'dynamics/gravity_compensation', 'dynamics/computed_torque'))
    for collector in (efforts, gravity, computed_torque):
        collector.wait_matched()
    return Bench(
        client, node, namespace,
        client.publisher(JointState, f'{namespace}/joint_states', 1),
        client.publisher(JointTrajectory, f'{namespace}/dynamics/joint_trajectory'),
        efforts, gravity, computed_torque)


START = 10_000_000_000_789
"""When the trajectory begins [ns], by the stamps of the joint states."""


@pytest.fixture(scope='module')
def node(client: RosClient) -> Iterator[Bench]:
    """Return a node with an order of joints other than the model's."""
    with NodeProcess(DYNAMICS, {
            **UNHURRIED, 'robot_description': default_arm_urdf(), 'joints': NAMES[::-1],
            'gains.natural_frequency': FREQUENCY[::-1], 'effort_rate_limit': 1e9},
            namespace='/topics') as process:
        yield make_bench(client, process, '/topics')


@pytest.fixture
def bench(node: Bench) -> Bench:
    """Return this node without a reference."""
    for command in ('gravity_compensation', 'computed_torque'):
        node.client.set_parameters('/topics/dynamics', {'command': command})
    return node


# --- computed torque -----------------------------------------------------------------------------

def test_a_set_point_is_followed(client, bench):
    """Its error is fed back with the gains of each joint; the arm does not move."""
    error = np.array([0.02, -0.03])
    inertial = M @ (np.square(FREQUENCY) * error)
    tau = G + inertial
    bench.command(bench.state())
    bench.follow(JointTrajectoryPoint(positions=(Q + error).tolist()))

    def torque() -> Any:
        return client.answer_to(bench.states, bench.state(), bench.computed_torque)

    wait_until(lambda: torque().effort == pytest.approx(tau[::-1], abs=5e-8), 'the set-point')
    assert list(torque().name) == ['joint2', 'joint1']
    client.set_parameters('/topics/dynamics', {'gains.natural_frequency': [8.0, 12.0]})
    assert torque().effort == pytest.approx((G + M @ ([144.0, 64.0] * error))[::-1], abs=5e-8)
    client.set_parameters('/topics/dynamics', {'gains.natural_frequency': FREQUENCY[::-1]})
    assert bench.command(bench.state()).effort == pytest.approx(tau[::-1], abs=5e-8)
    with client.collect(Float64MultiArray, bench.topic('dynamics/commands')) as commands, \
            client.collect(DynamicsTerms, bench.topic('dynamics/terms')) as all_terms:
        commands.wait_matched()
        all_terms.wait_matched()
        terms = client.answer_to(bench.states, bench.state(), all_terms)
        # repeated until one is published: the joint order of each subscriber is checked first
        numbers = client.ask(bench.states, bench.state(), commands, lambda message: True)
    assert numbers.data == pytest.approx(tau[::-1], abs=5e-8)  # the order of `joints`
    assert list(terms.joint_names) == ['joint2', 'joint1']
    assert terms.effort == pytest.approx(tau[::-1], abs=5e-8)
    assert terms.inertial == pytest.approx(inertial[::-1], abs=5e-8)
    assert terms.gravity == pytest.approx(G[::-1], abs=5e-8)


# --- the reference -------------------------------------------------------------------------------

def state(nanoseconds: int, **fields: Any) -> JointState:
    """Return a joint state; the arm stays at its position, but its sample does not repeat."""
    q = [Q[0] + 1e-12 * (nanoseconds // 1000 % 997), Q[1] - 1e-12 * (nanoseconds // 1000 % 991)]
    message = JointState(**{'name': NAMES, 'position': q, 'velocity': [0.0, 0.0], **fields})
    message.header.stamp = stamp_of(nanoseconds)
    return message


def check_held(message: JointState) -> None:
    """Check that a reference is a rest at `Q`."""
    assert message.position == pytest.approx(Q[::-1], abs=1e-8)
    assert message.velocity == pytest.approx([0.0, 0.0], abs=1e-7)


def test_the_reference_is_the_trajectory_at_the_stamp_of_the_state(client, bench):
    """In the joint order of the node, independent of the order of the trajectory."""
    trajectory = quintic_via_points(
        NAMES, [0.0, 1.0, 2.5], [Q, [Q[0] + 0.7, Q[1] - 0.4], [Q[0] - 0.3, Q[1] + 0.2]])
    rest = Reference(np.array(Q), np.zeros(2), np.zeros(2))
    expected = ActiveTrajectory(trajectory, START, START, rest)
    states, trajectories, gravity = bench.states, bench.trajectories, bench.gravity
    with client.collect(JointState, '/topics/dynamics/reference') as references:
        references.wait_matched()
        found = client.answer_to(states, state(START - 100 * STEP), references)
        check_held(found)  # from the first state on
        for ns in range(START - 99 * STEP, START - 50 * STEP, STEP):
            client.answer_to(states, state(ns), references)
        message = trajectory_to_ros(trajectory)
        message.header.stamp = stamp_of(START)
        trajectories.publish(message)
        trajectories.wait_for_all_acked()
        client.get_parameter('/topics/dynamics', 'command')  # answered after that message
        for ns in range(START - 50 * STEP, START, STEP):
            check_held(client.answer_to(states, state(ns), references))
        for ns in range(START, START + 300 * STEP, STEP + 123):
            found = client.answer_to(states, state(ns), references)
            position, velocity, _ = expected.sample(ns)
            assert list(found.name) == NAMES[::-1]
            assert found.position == pytest.approx(position[::-1], abs=1e-8)
            assert found.velocity == pytest.approx(velocity[::-1], abs=1e-8)
            assert list(found.effort) == []
        assert found.velocity == pytest.approx([0.0, 0.0], abs=1e-8)  # the end is held
        found = client.answer_to(states, state(ns + 1_000_000, velocity=[]), references)
        assert found.position == pytest.approx(position[::-1], abs=1e-8)
        client.set_parameters('/topics/dynamics', {'command': 'gravity_compensation'})
        client.answer_to(states, state(ns + 3_000_000), gravity)
        client.set_parameters('/topics/dynamics', {'command': 'computed_torque'})
        check_held(client.answer_to(states, state(ns + 4_000_000), references))
        stamps = [nanoseconds_of(message.header.stamp) for message in references.messages]
    assert ns + 3_000_000 not in stamps


# --- gravity compensation ------------------------------------------------------------------------

def test_the_command_for_a_state_carries_its_stamp(client, bench):
    client.set_parameters('/topics/dynamics', {'command': 'gravity_compensation'})
    bench.computed_torque.clear()
    for stamp in (Time(sec=1_790_000_000, nanosec=987_654_321),
                  Time(sec=2**31 - 1, nanosec=999_999_999)):
        message = bench.state()
        message.header.stamp = stamp
        command = bench.command(message)
        assert command.header.stamp == stamp
        assert list(command.name) == NAMES[::-1]
        assert command.effort == pytest.approx(G[::-1], abs=5e-9)
        assert list(command.position) == list(command.velocity) == []
        gravity = bench.gravity.wait_for(lambda m, stamp=stamp: m.header.stamp == stamp)
        assert gravity.effort == command.effort
    assert bench.computed_torque.messages == []  # there is no reference


# --- the robot description -----------------------------------------------------------------------

def test_a_description_on_its_topic_replaces_the_embedded_arm_if_there_is_no_parameter(
    client, bench,
):
    one = planar_arm_urdf([2.0], [1.0], [0.5], [0.1], name='one_link', joint_names=['hinge'])
    with client.describing('/described') as publish:
        publish(one)
        with NodeProcess(DYNAMICS, namespace='/described') as process:
            process.wait_for_log("Model 'one_link'")  # transient local: published before
            other = make_bench(client, process, '/described')
            effort = other.command(other.state([np.pi / 2], ['hinge']))
    assert list(effort.name) == ['hinge']
    assert effort.effort == pytest.approx([-2.0 * 9.81 * 0.5])


def test_another_description_than_that_of_the_parameters_is_named_and_not_used(client, bench):
    heavy = planar_arm_urdf([5.0, 4.0], [1.0, 0.8], [0.5, 0.4], [0.1, 0.05])
    with client.describing('/topics') as publish:
        publish(heavy)
        bench.node.wait_for_log('that on the topic robot_description has the velocity limit 100')
    effort = bench.command(bench.state([np.pi / 4, np.pi / 6]))
    np.testing.assert_allclose(sorted(effort.effort), [-49.52282521, -11.37087883])
