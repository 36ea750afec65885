# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Stamps that jump, in real nodes: simulated time, a clock before NTP, /clock at run time."""

from collections.abc import Iterator
import itertools
import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from fault_table import fault
import numpy as np
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from ros_harness import DYNAMICS, NodeProcess, RosClient, TIMEOUT
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NAMES = ['joint1', 'joint2']
Q = [0.4, -0.3]
HOLD = ArmDynamics(load_arm(default_arm_urdf())).gravity(Q)
GROUP = 'Stamps of other clocks'
SECOND = 1_000_000_000
PERIOD = SECOND // 100
COUNTER = itertools.count()


class Robot:
    """A node, and joint states of an arm at rest with arbitrary stamps."""

    def __init__(self, client: RosClient, node: NodeProcess, namespace: str) -> None:
        self.client, self.node, self.namespace = client, node, namespace
        self.states = client.publisher(JointState, f'{namespace}/joint_states')
        self.efforts = client.collect(JointState, f'{namespace}/effort_command')
        self.efforts.wait_matched()
        self.diagnostics = client.collect(DiagnosticArray, '/diagnostics')

    def send(self, stamp_ns: int) -> None:
        """Publish a state with a stamp [ns]."""
        state = JointState(name=NAMES, position=Q, velocity=[0.0, 0.0])
        sec, nanosec = divmod(stamp_ns, SECOND)
        state.header.stamp = Time(sec=sec, nanosec=nanosec)
        self.states.publish(state)

    def stream(self, first_ns: int, count: int) -> int:
        """Publish `count` states at 100 Hz; return the next stamp [ns]."""
        for k in range(count):
            self.send(first_ns + k * PERIOD)
            time.sleep(0.01)
        return first_ns + count * PERIOD

    def stream_until_answered(self, first_ns: int) -> int:
        """Publish states at 100 Hz until one of them is answered; return the next stamp [ns]."""
        t = first_ns
        for _ in range(round(100 * TIMEOUT)):
            t = self.stream(t, 1)
            if any(first_ns <= stamp_from_ros(effort.header.stamp) < t
                   for effort in self.efforts.messages):
                return t
        raise AssertionError(self.node.log)

    def wait_status(self, check: str, words: str) -> None:
        """Wait for a status, published from now on, that contains these words."""
        self.diagnostics.clear()
        self.diagnostics.wait_for(lambda message: any(
            status.name == f'{self.namespace}/dynamics: {check}' and words in status.message
            for status in message.status))

    def send_until_dropped(self, age: int) -> set[int]:
        """Send states of this age [s] until a status reports it; return their stamps [ns]."""
        self.diagnostics.clear()
        sent = set()
        for _ in range(round(20 * TIMEOUT)):
            stamp = time.time_ns() - age * SECOND
            self.send(stamp)
            sent.add(stamp)
            if self.diagnostics.find(lambda message: any(
                    status.name == f'{self.namespace}/dynamics: joint states'
                    and 's old, expected at most 0.2 s (state_max_age)' in status.message
                    for status in message.status), 0.05) is not None:
                return sent
        raise AssertionError(self.node.log)

    def answered(self) -> set[int]:
        """Return the stamps [ns] of all efforts so far."""
        return {stamp_from_ros(effort.header.stamp) for effort in self.efforts.messages}

    def wait_answer(self, age: float = 0.0) -> Any:
        """Send states of this age [s] until one is answered; return the effort."""
        first = time.time_ns() - round(SECOND * age)
        for _ in range(1000):
            self.send(time.time_ns() - round(SECOND * age))
            found = self.efforts.find(
                lambda effort: effort.header.stamp.sec >= first // SECOND, 0.05)
            if found is not None:
                return found
        raise AssertionError(self.node.log)


@pytest.fixture
def robot(client: RosClient) -> Iterator[Robot]:
    """Return a node with the default rules for stamps."""
    namespace = f'/clocks{next(COUNTER)}'
    parameters = {'robot_description': default_arm_urdf(), 'state_timeout': 60.0,
                  'state_max_age': 0.2}
    with NodeProcess(DYNAMICS, parameters, namespace=namespace) as node:
        yield Robot(client, node, namespace)


@pytest.mark.parametrize('max_age', [
    pytest.param(max_age, marks=fault(
        GROUP, 'simulated time jumps forwards by 5 s during a trajectory, '
        f'`state_max_age` {max_age:g}',
        'time restarts: the reference ends in a stop and does not jump'))
    for max_age in (0.2, 0.0)])
def test_simulated_time_that_jumps_ahead_moves_no_reference(robot: Robot, max_age: float) -> None:
    robot.client.set_parameters(f'{robot.namespace}/dynamics', {'state_max_age': max_age})
    t = robot.stream_until_answered(10 * SECOND)
    trajectories = robot.client.publisher(
        JointTrajectory, f'{robot.namespace}/dynamics/joint_trajectory')
    point = JointTrajectoryPoint(positions=[Q[0] + 0.5, Q[1]])
    point.time_from_start.sec = 10
    trajectories.publish(JointTrajectory(joint_names=NAMES, points=[point]))
    with robot.client.collect(
            JointState, f'{robot.namespace}/dynamics/reference') as references:
        for _ in range(1000):
            t = robot.stream(t, 5)
            if any(any(m.velocity) for m in references.messages):
                break
    robot.stream(t + 5 * SECOND, 20)
    robot.wait_status('reference', 'joint states restarted: stamp jumped ahead')
    # 5 s further along the trajectory the reference would be 0.25 rad away: 75 N·m and more
    after = [effort.effort for effort in robot.efforts.messages
             if stamp_from_ros(effort.header.stamp) >= t + 5 * SECOND]
    assert after
    assert np.abs(np.array(after) - HOLD).max() < 5.0


@fault(GROUP, 'the first stamps are of 1970, later ones current, then 10 s old',
       'states with current stamps are answered, old ones dropped as too old')
def test_a_clock_that_is_set_by_ntp_gets_an_age(robot: Robot) -> None:
    robot.stream(20 * SECOND, 10)
    robot.wait_answer()
    assert not robot.send_until_dropped(age=10) & robot.answered()


@fault(GROUP, '`use_sim_time` is set to true and back at run time, with old stamps',
       'old stamps are answered while it is true, and dropped while it is false')
def test_use_sim_time_at_run_time_changes_the_rule(robot: Robot) -> None:
    node = f'{robot.namespace}/dynamics'
    robot.wait_answer()
    for is_simulated in (True, False):
        robot.client.set_parameters(node, {'use_sim_time': is_simulated})
        robot.efforts.clear()
        if is_simulated:  # an old recording is answered
            robot.wait_answer(age=100.0)
        else:
            assert not robot.send_until_dropped(age=50) & robot.answered()


@fault(GROUP, 'an idle second publisher, and simulated time goes back',
       'no fault: states are answered again after five')
def test_an_idle_publisher_is_no_conflict(robot: Robot) -> None:
    idle = robot.client.publisher(JointState, f'{robot.namespace}/joint_states')
    robot.stream_until_answered(1000 * SECOND)
    robot.stream_until_answered(100 * SECOND)  # the time of the simulator was reset
    assert robot.efforts.messages[-1].effort == pytest.approx(HOLD, abs=1e-6)
    assert 'several_publishers' not in robot.node.log
    robot.client.node.destroy_publisher(idle)
