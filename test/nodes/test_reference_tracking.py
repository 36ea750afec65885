# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""References sent to `dynamics`: computed torque, rejections, and parameters of the command."""

from collections.abc import Iterator
import time
from typing import Any

import numpy as np
import pytest
from robot_dynamics_interfaces.msg import DynamicsTerms
from ros_harness import DYNAMICS, NodeProcess, RosClient, TIMEOUT
from simulated_arms import default_dynamics
from std_msgs.msg import Float64MultiArray
from topic_bench import Bench, make_bench, Q, TAU, V
from trajectory_msgs.msg import JointTrajectoryPoint


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
    tau = default_dynamics().inverse_dynamics(q, v, a)
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


def test_a_set_point_is_followed(tracking):
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


def test_the_error_is_fed_back_with_the_gains_of_each_joint(tracking):
    tracking.follow(JointTrajectoryPoint(positions=[Q[0] + 0.02, Q[1] - 0.03]))
    settle(tracking, ([Q[0] + 0.02, Q[1] - 0.03],))
