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
import struct
import sys
import time
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import rclpy
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.unchecked_rigid_body import HAS_PARALLEL_RNEA, UncheckedRigidBody
from robot_dynamics.monitoring.external_effort import ExternalEffort
from robot_dynamics.monitoring.live_residual import LiveResidual
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics.ros.dynamics.node import DynamicsNode
from robot_dynamics.ros.dynamics.state_log import MOST_ARRIVALS
from robot_dynamics.ros.middleware.conversions import trajectory_from_ros
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics.trajectories.efforts import efforts_along
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

JOINTS = 7
NAMES = [f'joint{i + 1}' for i in range(JOINTS)]
ALGORITHMS = (
    'rnea', 'computeGeneralizedGravity', 'nonLinearEffects', 'computeAllTerms', 'crba', 'aba',
    'computeCoriolisMatrix', 'computeKineticEnergy', 'computePotentialEnergy', 'rneaInParallel')
CHECKS = {'check_vector', 'check_samples', 'check_states'}


def chain(n: int) -> str:
    ones = [1.0] * n
    return planar_arm_urdf(ones, ones, [0.5] * n, [0.1] * n)


def calls_of(work: Callable[[], object]) -> Counter[str]:
    """Return how often each function was called, without the calls of the counting itself."""
    counts: Counter[str] = Counter()

    def count(frame: Any, event: str, argument: Any) -> None:
        if event == 'call':
            counts[frame.f_code.co_name] += 1
        elif event == 'c_call':
            counts[argument.__name__] += 1

    sys.setprofile(count)
    try:
        work()
    finally:
        sys.setprofile(None)
    del counts['setprofile']
    return counts


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

class Node:
    """A node whose control path is called in this thread instead of in a separate one."""

    def __init__(self, urdf: str) -> None:
        rclpy.init(args=['--ros-args', '-r', '__ns:=/counted', '-p', 'state_timeout:=60.0',
                         '-p', 'state_max_age:=60.0',
                         '-p', f'robot_description_file:={urdf}', '-p', 'effort_check:=false'])
        self.node = DynamicsNode()
        self._data = bytearray(serialize_message(
            JointState(name=NAMES, position=[0.1] * JOINTS, velocity=[0.0] * JOINTS)))
        self._stamp = time.time_ns()

    def take_state(self) -> None:
        """Answer a state 2 ms after the last one by its stamp, on a loaded machine too."""
        self._stamp += 2_000_000
        self._data[4:12] = struct.pack('<iI', *divmod(self._stamp, 1_000_000_000))
        self.node._loop._deliver(bytes(self._data))

    def follow(self) -> None:
        """Follow a long trajectory from now on."""
        message = JointTrajectory(joint_names=NAMES)
        point = JointTrajectoryPoint(positions=[0.2] * JOINTS)
        point.time_from_start.sec = 1000
        message.points.append(point)
        self.node._trajectories.take(message)

    @property
    def answered(self) -> int:
        loop = self.node._path.loop
        return 0 if loop is None else loop.states


@pytest.fixture
def node(tmp_path: Any) -> Iterator[Node]:
    urdf = tmp_path / 'arm.urdf'
    urdf.write_text(chain(JOINTS), encoding='utf-8')
    one = Node(str(urdf))
    try:
        for _ in range(20):  # then the rate and the noise of the states are known
            one.take_state()
        yield one
    finally:
        one.node.destroy_node()
        rclpy.try_shutdown()


@pytest.mark.parametrize(('command', 'algorithm', 'most'), [
    ('gravity_compensation', 'computeGeneralizedGravity', 95), ('computed_torque', 'rnea', 120)])
def test_the_calls_of_a_message(
    node: Node, pinocchio_calls: Counter[str], command: str, algorithm: str, most: int,
) -> None:
    node.node.set_parameters([Parameter('command', value=command)])
    if command == 'computed_torque':
        node.follow()
    for _ in range(2):
        node.take_state()
    pinocchio_calls.clear()
    calls = calls_of(node.take_state)
    assert pinocchio_calls == {algorithm: 1}
    assert calls['filled'] == 0  # there are no subscribers
    assert calls['deserialize_message'] == calls['serialize_message'] == 0
    assert not CHECKS & calls.keys()  # numbers are checked once, when they are read
    assert calls.total() <= most, calls.most_common()


def test_messages_leave_nothing_behind(node: Node) -> None:
    node.follow()
    for _ in range(MOST_ARRIVALS + 100):  # no report of the diagnostics takes the arrivals
        node.take_state()
    answered, growth = node.answered, []
    for _ in range(4):  # other threads of the process may allocate during one of them
        before = sys.getallocatedblocks()
        for _ in range(500):
            node.take_state()
        growth.append(sys.getallocatedblocks() - before)
    assert node.answered == answered + 2000
    assert min(growth) < 25, growth


# ------------------------------------------------------------------------------ the library

def state(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    q, v, a = np.random.default_rng(0).uniform(-1.0, 1.0, (3, n))
    return q, v, a


@pytest.mark.parametrize('n', [2, 7, 60])
def test_one_call_of_pinocchio_for_one_question(pinocchio_calls: Counter[str], n: int) -> None:
    """For any number of joints, and with few additional calls."""
    body = UncheckedRigidBody(load_arm(chain(n)))
    q, v, a = state(n)
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


def test_a_frictionless_arm_has_no_calls_for_friction(pinocchio_calls: Counter[str]) -> None:
    dynamics = ArmDynamics(load_arm(chain(JOINTS))).unchecked
    q, v, a = state(JOINTS)
    assert calls_of(lambda: dynamics.inverse_dynamics(q, v, a)).total() <= 10
    assert calls_of(lambda: dynamics.forward_dynamics(q, v, a)).total() <= 14
    assert pinocchio_calls == {'rnea': 1, 'aba': 1}


def test_estimators_and_simulation_check_no_state() -> None:
    arm = load_arm(chain(JOINTS))
    q, v, tau = state(JOINTS)
    dynamics, simulation = ArmDynamics(arm), ArmSimulation(arm)
    external, residual = ExternalEffort(dynamics, 10.0), LiveResidual(dynamics, 10.0)
    simulation.release()

    def work() -> tuple[object, ...]:
        return (external.update(0.1, q, v, tau), residual.update(0.1, q, v, tau),
                simulation.step(tau, 0.01))

    for _ in range(20):  # then the filters have settled
        work()
    calls = calls_of(work)
    assert calls['_rnea_in_parallel' if HAS_PARALLEL_RNEA else '_rnea_one_by_one'] == 4
    assert not CHECKS & calls.keys()
    assert calls_of(lambda: dynamics.gravity(q))['check_vector'] == 1


@pytest.mark.skipif(not HAS_PARALLEL_RNEA, reason='this Pinocchio was built without OpenMP')
def test_a_batch_costs_no_calls_for_a_sample() -> None:
    dynamics = ArmDynamics(load_arm(chain(JOINTS)))
    rows = np.zeros((3, 5000, JOINTS))
    few = calls_of(lambda: dynamics.inverse_dynamics_batch(*rows[:, :500])).total()
    many = calls_of(lambda: dynamics.inverse_dynamics_batch(*rows)).total()
    assert many <= 10 * few


@pytest.mark.parametrize('fields', [1, 2, 3])
@pytest.mark.parametrize('points', [1000, 10_000])
def test_a_point_of_a_plan_costs_few_calls(points: int, fields: int) -> None:
    """The calls grow linearly with the points; segments are sampled together."""
    arm = load_arm(chain(JOINTS))
    dynamics, message = ArmDynamics(arm), JointTrajectory(joint_names=NAMES)
    for i in range(points):
        point = JointTrajectoryPoint(positions=[0.001 * i] * JOINTS)
        if fields > 1:
            point.velocities = [0.1 * (i < points - 1)] * JOINTS
        if fields > 2:
            point.accelerations = [0.0] * JOINTS
        point.time_from_start.sec = i
        message.points.append(point)
    calls = calls_of(
        lambda: efforts_along(dynamics, trajectory_from_ros(message, arm.joint_names)))
    assert calls['sample'] <= 30 + points / 100
    assert calls.total() <= 36 * points
    evaluations = 100 * calls['_rnea_in_parallel'] if HAS_PARALLEL_RNEA else calls['rnea']
    assert points < evaluations <= 6 * points + 12_000
