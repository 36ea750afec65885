# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The work per message and per call, counted instead of timed, so that every increase is detected.

The tests count calls of Python functions, and of functions in C that Python calls. Bounds leave
a margin of a fifth for versions of Python and of libraries; a change that needs more has to state
the reason.
"""

from collections import Counter
from collections.abc import Callable, Iterator
import sys
from typing import Any

from counted_calls import calls_of
import numpy as np
import pinocchio as pin
import pytest
from rclpy.parameter import Parameter
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.model.unchecked_rigid_body import HAS_PARALLEL_RNEA, UncheckedRigidBody
from robot_dynamics.monitoring import ExternalEffort
from robot_dynamics.ros.middleware.conversions import trajectory_from_ros
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics.trajectories.efforts import efforts_along
from stepped_node import chain, JOINTS, NAMES, stepped_node, SteppedNode
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

ALGORITHMS = (
    'rnea', 'computeGeneralizedGravity', 'nonLinearEffects', 'computeAllTerms', 'crba', 'aba',
    'computeCoriolisMatrix', 'computeKineticEnergy', 'computePotentialEnergy', 'rneaInParallel')
CHECKS = {'check_vector', 'check_samples', 'check_states'}


@pytest.fixture
def pinocchio_calls(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Return how often each algorithm of Pinocchio was called, from now on."""
    counts: Counter[str] = Counter()

    def counting(name: str) -> Callable[..., Any]:
        algorithm = getattr(pin, name)

        def call(*arguments: Any) -> Any:
            counts[name] += 1
            return algorithm(*arguments)

        return call

    for name in ALGORITHMS:
        if hasattr(pin, name):
            monkeypatch.setattr(pin, name, counting(name))
    return counts


# ------------------------------------------------------------------------------ the control path

@pytest.fixture
def node() -> Iterator[SteppedNode]:
    with stepped_node() as one:
        yield one


@pytest.mark.parametrize(('command', 'algorithm', 'most'), [
    ('gravity_compensation', 'computeGeneralizedGravity', 95), ('computed_torque', 'rnea', 125)])
def test_the_calls_of_a_message(node, pinocchio_calls, command, algorithm, most):
    node.node.set_parameters([Parameter('command', value=command)])
    if command == 'computed_torque':
        node.follow()
    node.take_states(2)
    pinocchio_calls.clear()
    state = node.next_state()
    calls = calls_of(lambda: node.deliver(state))
    assert pinocchio_calls == {algorithm: 1}
    assert calls['filled'] == 0  # there are no subscribers
    assert calls['deserialize_message'] == calls['serialize_message'] == 0
    assert not CHECKS & calls.keys()  # numbers are checked once, when they are read
    assert calls.total() <= most, calls.most_common()


def test_messages_leave_nothing_behind(node):
    node.follow()
    node.take_states(5100)  # no report of the diagnostics takes the arrivals, at most 5000
    loop, growth = node.node._path.loop, []
    answered = loop.states
    for _ in range(4):  # other threads of the process may allocate during one of them
        before = sys.getallocatedblocks()
        node.take_states(500)
        growth.append(sys.getallocatedblocks() - before)
    assert loop.states == answered + 2000
    assert min(growth) < 25, growth


# ------------------------------------------------------------------------------ the library

def state(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    q, v, a = np.random.default_rng(0).uniform(-1.0, 1.0, (3, n))
    return q, v, a


def test_one_call_of_pinocchio_for_one_question(pinocchio_calls):
    """With few additional calls."""
    body = UncheckedRigidBody(load_arm(chain(JOINTS)))
    q, v, a = state(JOINTS)
    for name, most, work in (
            ('rnea', 8, lambda: body.inverse_dynamics(q, v, a)),
            ('computeGeneralizedGravity', 6, lambda: body.gravity(q)),
            ('crba', 6, lambda: body.mass_matrix(q)),
            ('computeCoriolisMatrix', 8, lambda: body.coriolis_matrix(q, v)),
            ('aba', 12, lambda: body.forward_dynamics(q, v, a)),
            ('computeAllTerms', 20, lambda: body.terms(q, v, a))):
        pinocchio_calls.clear()
        assert calls_of(work).total() <= most, name
        assert pinocchio_calls == {name: 1}


def test_observer_and_simulation_check_no_state():
    arm = load_arm(chain(JOINTS))
    q, v, tau = state(JOINTS)
    dynamics, simulation = ArmDynamics(arm), ArmSimulation(arm)
    external = ExternalEffort(dynamics, 10.0)
    simulation.release()

    def work() -> tuple[object, ...]:
        return external.update(0.1, q, v, tau), simulation.step(tau, 0.01)

    for _ in range(20):  # then the filters have settled
        work()
    calls = calls_of(work)
    assert not CHECKS & calls.keys()
    assert calls_of(lambda: dynamics.gravity(q))['check_vector'] == 1


@pytest.mark.skipif(not HAS_PARALLEL_RNEA, reason='this Pinocchio was built without OpenMP')
def test_a_batch_costs_no_calls_for_a_sample():
    dynamics = ArmDynamics(load_arm(chain(JOINTS)))
    rows = np.zeros((3, 5000, JOINTS))
    few = calls_of(lambda: dynamics.inverse_dynamics_batch(*rows[:, :500])).total()
    many = calls_of(lambda: dynamics.inverse_dynamics_batch(*rows)).total()
    assert many <= 10 * few


def test_a_point_of_a_plan_costs_few_calls():
    """The calls grow linearly with the points; segments are sampled together."""
    arm, points = load_arm(chain(JOINTS)), 1000
    dynamics, message = ArmDynamics(arm), JointTrajectory(joint_names=NAMES)
    for i in range(points):
        point = JointTrajectoryPoint(
            positions=[0.001 * i] * JOINTS, velocities=[0.1 * (i < points - 1)] * JOINTS,
            accelerations=[0.0] * JOINTS)
        point.time_from_start.sec = i
        message.points.append(point)
    calls = calls_of(
        lambda: efforts_along(dynamics, trajectory_from_ros(message, arm.joint_names)))
    assert calls['sample'] <= 30 + points / 100
    assert calls.total() <= 36 * points
    evaluations = 100 * calls['_rnea_in_parallel'] if HAS_PARALLEL_RNEA else calls['rnea']
    assert points < evaluations <= 6 * points + 12_000
