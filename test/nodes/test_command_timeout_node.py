# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Missing efforts: the running simulated arm stands on its brakes until efforts resume."""

from collections.abc import Iterator
import os
import signal
import threading

from closed_loop import NAMES, START
import numpy as np
import pytest
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from ros_harness import Collector, LONG, NodeProcess, RosClient, SIMULATED_ARM, wait_until
from sensor_msgs.msg import JointState

RATE = 100.0
PERIOD_NS = 10_000_000
VISCOUS = 10.0
EFFORT = [10.0, -5.0]
ARM = {'rate': RATE, 'initial_position': START, 'joints': NAMES, 'gravity': [0.0, 0.0, 0.0],
       'friction.viscous': [VISCOUS]}
"""Friction alone resists, so that a constant effort moves it on and on."""
TIMED_OUT = r'\[WARN\].*No valid effort for ([\d.]+) s'


class Driven:
    """A running arm, a collector of its states, and a controller with a constant effort."""

    def __init__(self, client: RosClient, node: NodeProcess, namespace: str) -> None:
        self.node, self.answered = node, 0
        """The process, and the stamp [ns] of the last state that got an effort."""
        self.states = client.collect(JointState, f'{namespace}/joint_states')
        self._client, self._effort = client, None
        self._publisher = client.publisher(JointState, f'{namespace}/effort_command', 1)
        self._subscription = client.node.create_subscription(
            JointState, f'{namespace}/joint_states', self._answer, 1)

    def _answer(self, state: JointState) -> None:
        effort = self._effort
        if effort is not None:
            self.answered = stamp_from_ros(state.header.stamp)
            self._publisher.publish(JointState(name=NAMES, effort=effort))

    def command(self, effort: list[float] | None) -> None:
        """Answer with this effort from now on; None for no answer."""
        self._effort = effort

    def move(self) -> JointState:
        """Command the effort until the arm moves."""
        self.states.clear()
        self.command(EFFORT)
        return self.states.wait_for(is_moving, LONG)

    def close(self) -> None:
        self.states.close()
        self._client.node.destroy_subscription(self._subscription)


@pytest.fixture(scope='module')
def arm(client: RosClient) -> Iterator[Driven]:
    with NodeProcess(SIMULATED_ARM, ARM, namespace='/silence') as node:
        driven = Driven(client, node, '/silence')
        yield driven
        driven.close()


def is_moving(state: JointState) -> bool:
    return bool(np.abs(state.velocity).max() > 0.1)


def wait_standing(states: Collector, count: int = 50) -> JointState:
    """Wait until `count` successive states are at rest at the same position; return the last."""
    states.clear()

    def stands() -> bool:
        last = states.messages[-count:]
        return len(last) == count and not any(any(m.velocity) for m in last) and (
            len({tuple(m.position) for m in last}) == 1)

    wait_until(stands, f'{count} states at rest', LONG)
    return states.messages[-1]


# --- efforts that end ----------------------------------------------------------------------------

def test_the_arm_stops_when_efforts_end_and_logs_the_timeout(arm):
    arm.move()
    arm.command(None)
    standing = wait_standing(arm.states)
    assert list(standing.position) != START
    assert list(standing.effort) == [0.0, 0.0]
    line = arm.node.wait_for_log(
        TIMED_OUT + r' \(command_timeout\), since the joint state of [\d.]+ s: the brakes hold '
        'the arm where it is, until the next effort arrives')
    silence, since = (float(word) for word in line.split() if word.replace('.', '').isdigit())
    assert silence >= 0.2
    assert 1e-9 * stamp_from_ros(standing.header.stamp) >= since + silence


# --- the duration of the timeout -----------------------------------------------------------------

def test_with_0_the_last_effort_acts_indefinitely(client, arm):
    node = '/silence/simulated_arm'
    client.set_parameters(node, {'command_timeout': 0.0})
    engaged = arm.node.log.count('No valid effort')
    arm.move()
    arm.command(None)
    arm.states.clear()
    for state in arm.states.wait_count(100):
        assert any(state.velocity)
        assert list(state.effort) == EFFORT
    assert arm.node.log.count('No valid effort') == engaged
    client.set_parameters(node, {'command_timeout': 0.1})
    wait_standing(arm.states)


def test_a_process_that_was_suspended_could_not_receive(client):
    """The suspension is longer than the timeout; the arm continues under its last effort."""
    timeout = 2.0
    parameters = {**ARM, 'command_timeout': timeout, 'publish_clock': True}
    with NodeProcess(SIMULATED_ARM, parameters, namespace='/suspended') as node:
        arm = Driven(client, node, '/suspended')

        def moves_on() -> bool:
            """Return whether states arrive between the suspension and the end of the timeout."""
            arm.move()
            arm.command(None)
            os.kill(node.pid, signal.SIGSTOP)
            try:
                threading.Event().wait(1.1 * timeout)  # this duration is what is tested
                arm.states.clear()
            finally:
                os.kill(node.pid, signal.SIGCONT)
            # by the clock of the process, which does not advance during the suspension
            end = arm.answered + round(1e9 * timeout) - PERIOD_NS
            arm.states.wait_for(lambda m: stamp_from_ros(m.header.stamp) >= end, LONG)
            seen = [m for m in arm.states.messages if stamp_from_ros(m.header.stamp) < end]
            assert all(any(m.velocity) and list(m.effort) == EFFORT for m in seen)
            return len(seen) > 1

        wait_until(moves_on, 'states after a suspension')
        wait_standing(arm.states)  # still without efforts, so that the timeout expires
        arm.close()
