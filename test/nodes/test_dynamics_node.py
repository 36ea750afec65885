# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The topics of `dynamics`: joint states in, efforts out."""

from collections.abc import Iterator
from dataclasses import dataclass
import threading
import time
from typing import Any

from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import numpy as np
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.ros.dynamics.control_path import ControlCounters
from robot_dynamics.ros.dynamics.state_report import StateReport
from robot_dynamics_interfaces.msg import DynamicsTerms
from robots import robot_urdf
from ros_harness import (
    BEST_EFFORT,
    Collector,
    DYNAMICS,
    LATCHED,
    NodeProcess,
    RosClient,
    TIMEOUT,
    wait_until,
)
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NAN = float('nan')
NAMES = ['joint1', 'joint2']
Q, V = [np.pi / 4, np.pi / 6], [0.5, 0.3]
G = [-49.52282521, -11.37087883]
TAU = [-48.74713301, -10.95795578]


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
    next_second: int = 0

    def state(self, q: Any = Q, v: Any = V, names: Any = None) -> JointState:
        """Return a joint state with a unique stamp."""
        self.next_second += 1
        message = JointState(name=names or NAMES, position=q, velocity=v)
        message.header.stamp = Time(sec=self.next_second, nanosec=123_456_789)
        return message

    def command(self, state: JointState) -> Any:
        """Return the effort command for a state."""
        return self.client.answer_to(self.states, state, self.efforts)

    def topic(self, name: str) -> str:
        return f'{self.namespace}/{name}'

    def follow(self, *points: JointTrajectoryPoint, stamp: Time | None = None) -> None:
        """Send a trajectory."""
        message = JointTrajectory(joint_names=NAMES, points=points)
        message.header.stamp = stamp or Time()
        self.trajectories.publish(message)


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


@pytest.fixture(scope='module')
def bench(client: RosClient) -> Iterator[Bench]:
    """Return the node on the default arm; no test sends it a reference."""
    with NodeProcess(
            DYNAMICS, {'robot_description': default_arm_urdf()}, namespace='/gravity') as node:
        yield make_bench(client, node, '/gravity')


# --- gravity compensation ------------------------------------------------------------------------

def test_the_command_for_a_state_carries_its_stamp(bench: Bench) -> None:
    state = bench.state()
    message = bench.command(state)
    assert message.header.stamp == state.header.stamp
    assert list(message.name) == NAMES
    assert message.effort == pytest.approx(G, abs=5e-9)
    assert list(message.position) == list(message.velocity) == []
    gravity = bench.gravity.wait_for(lambda m: m.header.stamp == state.header.stamp)
    assert gravity.effort == message.effort
    assert bench.computed_torque.messages == []  # there is no reference


@pytest.mark.parametrize('stamp', [
    Time(sec=1_790_000_000, nanosec=987_654_321), Time(sec=2**31 - 1, nanosec=999_999_999)])
def test_every_nanosecond_of_a_stamp_is_preserved(bench: Bench, stamp: Time) -> None:
    state = bench.state()
    state.header.stamp = stamp
    assert bench.command(state).header.stamp == stamp


@pytest.mark.parametrize('state', [
    {'names': ['joint2', 'joint1'], 'q': Q[::-1], 'v': V[::-1]},
    {'names': ['wheel', 'joint2', 'lid', 'joint1'], 'q': [9.0, Q[1], -9.0, Q[0]], 'v': [1.0] * 4},
    {'v': []},
    {'names': ['joint1', 'wheel', 'joint2'], 'q': [Q[0], NAN, Q[1]], 'v': [0.0, NAN, 0.0]},
])
def test_joint_states_are_matched_by_name(bench: Bench, state: dict[str, Any]) -> None:
    message = bench.command(bench.state(**state))
    assert list(message.name) == NAMES
    assert message.effort == pytest.approx(G, abs=5e-9)


@pytest.mark.parametrize(('state', 'words'), [
    ({'q': [NAN, 0.0]}, "position of 'joint1' is nan"),
    ({'v': [0.0, float('inf')]}, "velocity of 'joint2' is inf"),
    ({'q': [1.0]}, 'position has 1 values, expected 2 as name has'),
    ({'v': [1.0] * 3}, 'velocity has 3 values, expected 2 as name has'),
    ({'names': ['joint1', 'joint1', 'joint2'], 'q': [0.0] * 3, 'v': []}, "'joint1' twice"),
])
def test_a_bad_state_is_dropped_alone_and_reported(
    bench: Bench, state: dict[str, Any], words: str,
) -> None:
    bad = bench.state(**state)
    with bench.client.collect(DiagnosticArray, '/diagnostics') as diagnostics:
        diagnostics.wait_matched()
        report = bench.client.ask(
            bench.states, bad, diagnostics,
            lambda message: any(
                words in status.message and status.level == DiagnosticStatus.ERROR
                for status in message.status))
    assert report.status[0].name == '/gravity/dynamics: joint states'
    assert bench.command(bench.state()).effort == pytest.approx(G, abs=5e-9)
    assert not any(
        message.header.stamp == bad.header.stamp for message in bench.efforts.messages)


def test_states_of_other_joints_are_ignored(bench: Bench) -> None:
    other = bench.state(names=['left', 'right'])
    bench.states.publish(other)
    assert bench.command(bench.state()).effort == pytest.approx(G, abs=5e-9)
    assert not any(m.header.stamp == other.header.stamp for m in bench.efforts.messages)


def test_commands_are_the_same_numbers_in_the_same_order(bench: Bench) -> None:
    with bench.client.collect(Float64MultiArray, bench.topic('dynamics/commands')) as commands:
        commands.wait_matched()
        numbers = bench.client.ask(
            bench.states, bench.state(), commands, lambda message: len(message.data) == 2)
        assert numbers.data == pytest.approx(G, abs=5e-9)


def test_best_effort_subscribers_are_served_too(bench: Bench) -> None:
    with bench.client.collect(
            JointState, bench.topic('effort_command'), BEST_EFFORT) as efforts:
        efforts.wait_matched()
        answer = bench.client.answer_to(bench.states, bench.state(), efforts)
        assert answer.effort == pytest.approx(G, abs=5e-9)


def test_the_terms_of_gravity_compensation(bench: Bench) -> None:
    with bench.client.collect(DynamicsTerms, bench.topic('dynamics/terms')) as terms:
        terms.wait_matched()
        message = bench.client.answer_to(bench.states, bench.state(), terms)
    assert message.effort == pytest.approx(G, abs=5e-9)
    assert message.gravity == pytest.approx(G, abs=5e-9)
    assert list(message.inertial) == list(message.coriolis) == [0.0, 0.0]
    assert message.kinetic_energy == pytest.approx(1.12904219, abs=5e-9)


# --- references ----------------------------------------------------------------------------------

@pytest.fixture(scope='module')
def tracking(client: RosClient) -> Iterator[Bench]:
    """Return a node that receives references; `joints` sets an order other than the model's."""
    parameters = {'joints': ['joint2', 'joint1'], 'gains.kp': [100.0, 200.0],
                  'gains.kd': [10.0, 20.0]}
    with NodeProcess(DYNAMICS, parameters, namespace='/tracking') as node:
        yield make_bench(client, node, '/tracking')


def expected_torque(q: Any, v: Any, q_ref: Any, v_ref: Any = (0.0, 0.0),
                    a_ref: Any = (0.0, 0.0)) -> list[float]:
    """Return computed torque in the order of `tracking`, from states in the order of `NAMES`."""
    kp, kd = np.array([200.0, 100.0]), np.array([20.0, 10.0])
    q, v = np.array(q), np.array(v)
    a = np.array(a_ref) + kd * (np.array(v_ref) - v) + kp * (np.array(q_ref) - q)
    tau = ArmDynamics(load_arm(default_arm_urdf())).inverse_dynamics(q, v, a)
    return [float(tau[1]), float(tau[0])]


def settle(tracking: Bench, reference: Any) -> Any:
    """
    Send states until the computed torque is that of a constant reference; return the torque.

    Each state has a new stamp, because the node may receive the first state before the reference.
    """
    wanted = expected_torque(Q, V, *reference)
    tracking.computed_torque.clear()
    deadline = time.monotonic() + TIMEOUT
    while time.monotonic() < deadline:
        tracking.states.publish(tracking.state())
        found = tracking.computed_torque.find(
            lambda message: message.effort == pytest.approx(wanted, abs=1e-9), 0.5)
        if found is not None:
            return found
    raise AssertionError(f'the computed torque did not become {wanted} in {TIMEOUT:g} s')


def test_a_set_point_is_followed(tracking: Bench) -> None:
    tracking.command(tracking.state())
    tracking.follow(JointTrajectoryPoint(
        positions=Q, velocities=V, accelerations=[0.1, 0.2]))
    message = settle(tracking, (Q, V, [0.1, 0.2]))
    assert list(message.name) == ['joint2', 'joint1']
    assert message.effort == pytest.approx(TAU[::-1], abs=5e-9)
    state = tracking.state()
    assert tracking.command(state).effort == pytest.approx(TAU[::-1], abs=5e-9)
    with tracking.client.collect(
            Float64MultiArray, tracking.topic('dynamics/commands')) as commands, \
            tracking.client.collect(
                DynamicsTerms, tracking.topic('dynamics/terms')) as all_terms:
        commands.wait_matched()
        all_terms.wait_matched()
        terms = tracking.client.answer_to(tracking.states, tracking.state(), all_terms)
        # repeated until one is published: the joint order of each subscriber is checked first
        numbers = tracking.client.ask(
            tracking.states, tracking.state(), commands, lambda message: True)
    assert numbers.data == pytest.approx(TAU[::-1], abs=5e-9)  # the order of `joints`
    assert list(terms.joint_names) == ['joint2', 'joint1']
    assert terms.effort == pytest.approx(TAU[::-1], abs=5e-9)
    parts = [np.array(getattr(terms, name)) for name in (
        'inertial', 'coriolis', 'gravity', 'friction', 'external')]
    assert sum(parts) == pytest.approx(np.array(terms.effort))
    assert terms.coriolis == pytest.approx([0.15, -0.234], abs=5e-9)


def test_the_error_is_fed_back_with_the_gains_of_each_joint(tracking: Bench) -> None:
    tracking.follow(JointTrajectoryPoint(positions=[Q[0] + 0.02, Q[1] - 0.03]))
    settle(tracking, ([Q[0] + 0.02, Q[1] - 0.03],))


def test_a_trajectory_moves_with_the_stamps_of_the_states(tracking: Bench) -> None:
    tracking.follow(JointTrajectoryPoint(positions=Q))
    settle(tracking, (Q,))
    start = tracking.next_second + 3
    points = [
        JointTrajectoryPoint(positions=q, time_from_start=Duration(sec=seconds))
        for q, seconds in (([0.0, 0.0], 0), ([1.0, -1.0], 4))]
    tracking.follow(*points, stamp=Time(sec=start))
    while tracking.next_second < start:  # a jump of the stamps would end the trajectory
        tracking.command(tracking.state())
    for _ in range(3):
        state = tracking.state(v=[0.25, -0.25])
        stamp = state.header.stamp
        t = stamp.sec - start + 1e-9 * stamp.nanosec
        wanted = expected_torque(Q, [0.25, -0.25], [t / 4, -t / 4], [0.25, -0.25])
        # repeated until the torque matches: the trajectory may arrive after the first state
        tracking.client.ask(
            tracking.states, state, tracking.computed_torque,
            lambda m, stamp=stamp, wanted=wanted: (  # type: ignore[misc]
                m.header.stamp == stamp and m.effort == pytest.approx(wanted)))


def test_a_continuous_joint_takes_the_shortest_angular_distance(tracking: Bench) -> None:
    tracking.follow(JointTrajectoryPoint(positions=[Q[0] + 4 * np.pi + 0.01, Q[1] - 2 * np.pi]))
    wanted = expected_torque(Q, V, [Q[0] + 0.01, Q[1]])
    tracking.client.ask(
        tracking.states, tracking.state(), tracking.computed_torque,
        lambda message: message.effort == pytest.approx(wanted, abs=1e-6))


@pytest.mark.parametrize(('trajectory', 'words'), [
    (JointTrajectory(joint_names=['elbow']), "joint_names has 'elbow'"),
    (JointTrajectory(joint_names=NAMES), 'points is empty'),
    (JointTrajectory(joint_names=NAMES, points=[JointTrajectoryPoint(positions=[NAN, 0.0])]),
     'points[0].positions[0] (joint1) is nan'),
])
def test_a_refused_trajectory_is_reported_and_the_old_one_followed_on(
    tracking: Bench, trajectory: JointTrajectory, words: str,
) -> None:
    tracking.follow(JointTrajectoryPoint(positions=Q))
    settle(tracking, (Q,))
    with tracking.client.collect(DiagnosticArray, '/diagnostics') as diagnostics:
        diagnostics.wait_matched()
        report = tracking.client.ask(
            tracking.trajectories, trajectory, diagnostics,
            lambda message: any(
                words in value.value for status in message.status for value in status.values))
    status, = (
        status for status in report.status if status.name == '/tracking/dynamics: reference')
    assert status.level == DiagnosticStatus.WARN
    assert status.message == 'following'
    assert int(next(v.value for v in status.values if v.key == 'refused')) >= 1
    settle(tracking, (Q,))


# --- the parameters of the command ---------------------------------------------------------------

def test_the_parameter_command_chooses(tracking: Bench) -> None:
    tracking.follow(JointTrajectoryPoint(positions=[Q[0] + 0.02, Q[1]]))
    torque = settle(tracking, ([Q[0] + 0.02, Q[1]],))
    client, node = tracking.client, tracking.topic('dynamics')
    assert tracking.command(tracking.state()).effort == torque.effort
    client.set_parameters(node, {'command': 'gravity_compensation'})
    assert tracking.command(tracking.state()).effort == pytest.approx(G[::-1], abs=5e-9)
    client.set_parameters(node, {'command': 'none'})
    client.answer_to(tracking.states, tracking.state(), tracking.gravity)
    tracking.efforts.wait_for(lambda message: not any(message.effort))  # the end of the ramp
    client.set_parameters(node, {'command': 'computed_torque'})
    for _ in range(3):  # the reference has ended: gravity compensation until the next reference
        effort = tracking.command(tracking.state()).effort
        assert effort == pytest.approx(G[::-1], abs=5e-9)
    tracking.follow(JointTrajectoryPoint(positions=[Q[0] + 0.02, Q[1]]))
    assert settle(tracking, ([Q[0] + 0.02, Q[1]],)).effort == torque.effort


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_the_parameter_effort_scale_clamps(tracking: Bench, sign: float) -> None:
    """The clamp is the scaled limit, or the gravity torque if that is larger."""
    client, node = tracking.client, tracking.topic('dynamics')
    goal = [Q[0] + sign, Q[1] - 1.5 * sign]
    tracking.follow(JointTrajectoryPoint(positions=goal))
    torque = settle(tracking, (goal,))
    client.set_parameters(node, {'effort_scale': 0.1})
    state = tracking.state()
    assert tracking.command(state).effort == pytest.approx(
        [6.0, 15.0] if sign > 0.0 else G[::-1], abs=5e-9)
    free = tracking.computed_torque.wait_for(lambda m: m.header.stamp == state.header.stamp)
    assert free.effort == torque.effort
    assert (sign * np.array(torque.effort) > [6.0, 15.0]).all()
    client.set_parameters(node, {'effort_scale': 1.0})


# --- the robot description -----------------------------------------------------------------------

def test_a_description_on_its_topic_replaces_the_embedded_arm(client: RosClient) -> None:
    one = planar_arm_urdf([2.0], [1.0], [0.5], [0.1], name='one_link', joint_names=['hinge'])
    descriptions = client.publisher(String, '/described/robot_description', LATCHED, 0)
    descriptions.publish(String(data=one))
    with NodeProcess(
            DYNAMICS, {'hold_time': 0.0}, namespace='/described') as node:
        node.wait_for_log("Model 'one_link'")  # transient local: it was published before
        bench = make_bench(client, node, '/described')
        effort = bench.command(bench.state([np.pi / 2], [0.0], ['hinge']))
        assert list(effort.name) == ['hinge']
        assert effort.effort == pytest.approx([-2.0 * 9.81 * 0.5])
        descriptions.publish(String(data='<robot name="broken"'))
        node.wait_for_log('Kept the model in use: robot_description is not well-formed')
        effort = bench.command(bench.state([np.pi / 2], [0.0], ['hinge']))
        assert effort.effort == pytest.approx([-2.0 * 9.81 * 0.5])
        descriptions.publish(String(data=default_arm_urdf()))
        node.wait_for_log('Kept the model in use while commanding')
        loaded = node.log.count("Model 'planar_arm'")  # the embedded arm was loaded at first
        client.set_parameters('/described/dynamics', {'state_timeout': 0.3})
        wait_until(  # no joint states: the command ends
            lambda: node.log.count("Model 'planar_arm'") > loaded, 'the new model')
        client.set_parameters('/described/dynamics', {'state_timeout': 60.0})
        effort = client.ask(
            bench.states, bench.state(), bench.efforts, lambda m: list(m.name) == NAMES)
        assert effort.effort == pytest.approx(G, abs=5e-9)
    client.node.destroy_publisher(descriptions)


def test_a_parameter_takes_precedence_over_the_topic(client: RosClient) -> None:
    urdf = robot_urdf('kinova')
    arm = load_arm(urdf)
    with NodeProcess(
            DYNAMICS, {'robot_description': urdf, 'state_thread': False},
            namespace='/given') as node:
        bench = make_bench(client, node, '/given')
        assert client.node.count_subscribers('/given/robot_description') == 0
        q = np.clip(
            np.linspace(-1.0, 1.0, arm.joint_count), arm.limits.lower, arm.limits.upper)
        effort = bench.command(bench.state(q.tolist(), [], list(arm.joint_names)))
        assert effort.effort == pytest.approx(ArmDynamics(arm).rigid_body.gravity(q))


def test_it_works_in_the_executor_of_the_node_too(client: RosClient) -> None:
    with NodeProcess(DYNAMICS, {'state_thread': False}, namespace='/in_executor') as node:
        bench = make_bench(client, node, '/in_executor')
        assert bench.command(bench.state()).effort == pytest.approx(G, abs=5e-9)


def test_drops_may_be_counted_while_they_are_reported() -> None:
    counters = ControlCounters()
    report = StateReport(counters)

    def drop() -> None:
        for i in range(30_000):
            counters.dropped[f'reason {i}'] += 1

    thread = threading.Thread(target=drop)
    thread.start()
    while thread.is_alive():
        report.statuses(0.05)
    thread.join()
    assert report.statuses(0.05)[0].values['dropped: reason 29999'] == 1
