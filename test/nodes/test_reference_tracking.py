# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""References sent to `dynamics`: computed torque, rejections, and parameters of the command."""

from collections.abc import Iterator
import time
from typing import Any

from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import numpy as np
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_interfaces.msg import DynamicsTerms
from ros_harness import DYNAMICS, NodeProcess, RosClient, TIMEOUT
from std_msgs.msg import Float64MultiArray
from topic_bench import Bench, G, make_bench, NAMES, NAN, Q, TAU, V
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint


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
    assert tracking.command(tracking.state()).effort == pytest.approx(torque.effort, abs=1e-9)
    client.set_parameters(node, {'command': 'gravity_compensation'})
    assert tracking.command(tracking.state()).effort == pytest.approx(G[::-1], abs=5e-9)
    client.set_parameters(node, {'command': 'none'})
    client.answer_to(tracking.states, tracking.state(), tracking.gravity)
    tracking.efforts.wait_for(lambda message: not any(message.effort))  # the end of the ramp
    client.set_parameters(node, {'command': 'computed_torque'})
    assert tracking.command(tracking.state()).effort == pytest.approx(G[::-1], abs=5e-9)
    tracking.follow(JointTrajectoryPoint(positions=[Q[0] + 0.02, Q[1]]))
    again = settle(tracking, ([Q[0] + 0.02, Q[1]],))
    assert again.effort == pytest.approx(torque.effort, abs=1e-9)


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
    assert free.effort == pytest.approx(torque.effort, abs=1e-9)
    assert (sign * np.array(torque.effort) > [6.0, 15.0]).all()
    client.set_parameters(node, {'effort_scale': 1.0})
