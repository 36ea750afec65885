# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Planned stops on a real node: `~/stop`, and the timeout of a stream of set-points.

The reference comes to rest along its path without a jump, and the node then holds the position.
"""

from collections.abc import Sequence
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from fault_bench import FaultBench, nanoseconds_of, Q
from fault_stimuli import follow, move_by_hand, wait_effort
from fault_table import fault
from interruption_bench import check_held, ELSEWHERE, gravity, GROUP, trajectory_to
from lifecycle_bench import ACTIVATE, CONFIGURE, DEACTIVATE, lifecycle_bench
import numpy as np
import pytest
from robot_dynamics_interfaces.srv import InverseDynamicsBatch
from ros_harness import Collector, LONG, RosClient, TIMEOUT, wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger


class IdealArm:
    """Makes the driver report that the arm continues from its newest reference."""

    def __init__(self, bench: FaultBench) -> None:
        self._bench = bench
        self._newest: list[JointState] = []
        self.references: Collector = bench.client.collect(JointState, bench.name('reference'))
        self.references.wait_matched()

    def __enter__(self) -> 'IdealArm':
        self._bench.driver.change = self._track
        return self

    def __exit__(self, *_: object) -> None:
        self._bench.driver.q = list(self._track(self._bench.driver.message()).position)
        self._bench.driver.go_on()
        self.references.close()

    def _track(self, message: JointState) -> JointState:
        # kept, because a test clears the messages, and the arm must not jump then
        self._newest = self.references.messages[-1:] or self._newest
        for reference in self._newest:
            late = 1e-9 * (
                nanoseconds_of(message.header.stamp) - nanoseconds_of(reference.header.stamp))
            message.velocity = reference.velocity
            message.position = (
                np.array(reference.position) + late * np.array(reference.velocity)).tolist()
        return message

    def wait_moving(self) -> JointState:
        """Return the next reference with a velocity, from now on."""
        self.references.clear()
        moving: JointState = self.references.wait_for(
            lambda m: np.abs(m.velocity).max() > 0.05, LONG)
        self.references.clear()
        return moving

    def check_stopped(self) -> list[float]:
        """Check that the reference comes to rest without a jump and stays; return its position."""
        rest = self.references.wait_for(lambda m: not any(m.velocity), LONG)
        count = len(self.references.messages) + 100
        messages = self.references.wait_count(count, LONG)
        there = next(i for i, m in enumerate(messages) if m is rest)
        for message in messages[there:]:
            assert not any(message.velocity)
            assert message.position == pytest.approx(rest.position, abs=1e-12)
        for one, other in zip(messages, messages[1:]):
            dt = 1e-9 * (nanoseconds_of(other.header.stamp) - nanoseconds_of(one.header.stamp))
            step = np.abs(np.subtract(other.position, one.position))
            assert (step <= 5.0 * dt + 1e-6).all()  # half the velocity limit
        return list(rest.position)


def stop(bench: FaultBench) -> Any:
    """Call `~/stop`; return the response."""
    response = bench.ask('stop', Trigger)
    assert response.success
    return response


def is_between(q: Sequence[float], one: Sequence[float], other: Sequence[float]) -> bool:
    """Return whether each joint is between two positions, not at their ends."""
    fraction = np.subtract(q, one) / np.subtract(other, one)
    return bool((fraction > 0.0).all() and (fraction < 0.99).all())


SLOW_GOAL = [Q[0] + 0.8, Q[1] + 0.8]
"""Reached in 10 s, longer than any test should take."""


@fault(GROUP, '`~/stop` while a trajectory is followed',
       'each joint stops alone; the position is held; reported until the next reference')
def test_stop_on_a_trajectory(arm):
    with IdealArm(arm) as ideal:
        arm.trajectories.publish(trajectory_to(SLOW_GOAL, 10))
        ideal.wait_moving()
        response = stop(arm)
        assert response.message == 'stopping along the reference, then holding the position'
        where = ideal.check_stopped()
        assert is_between(where, Q, SLOW_GOAL)
        arm.efforts.clear()
        check_held(arm, where)
        status = arm.next_status('reference')
        assert status.level == DiagnosticStatus.WARN
        assert status.message == 'ended early: ~/stop was called'
        follow(arm, where)  # the next reference


@fault(GROUP, '`~/stop` without a reference',
       'a planned stop from the measured state; the position is held')
def test_stop_without_a_reference(arm):
    arm.set_parameters(command='gravity_compensation')
    move_by_hand(arm, ELSEWHERE)
    response = stop(arm)
    assert response.message == (
        'stopping from the measured state, then holding the position')
    arm.efforts.clear()
    wait_effort(arm, gravity(ELSEWHERE))
    with arm.client.collect(JointState, arm.name('reference')) as references:
        reference = references.wait_for()
    assert reference.position == pytest.approx(ELSEWHERE, abs=1e-9)


BATCHES, SAMPLES = 20, 100_000


@fault(GROUP, '`~/stop` while 20 batches of 100,000 samples are computed',
       'answered, and effective, before the batches are answered')
def test_stop_while_batches_are_computed(arm, seen):
    node = arm.client.node
    service = node.create_client(InverseDynamicsBatch, arm.name('inverse_dynamics_batch'))
    answered: list[float] = []
    try:
        with RosClient('operator') as operator, IdealArm(arm) as ideal:
            assert service.wait_for_service(TIMEOUT)
            # in another thread, so that no answer to a batch delays the answer of ~/stop
            operator.call(Trigger, arm.name('stop'))
            arm.trajectories.publish(trajectory_to(SLOW_GOAL, 10))
            ideal.wait_moving()
            request = InverseDynamicsBatch.Request(position=np.zeros(2 * SAMPLES))
            for _ in range(BATCHES):
                service.call_async(request).add_done_callback(
                    lambda _: answered.append(time.monotonic()))
            begun = time.monotonic()
            response = operator.call(Trigger, arm.name('stop'))
            seconds, before = time.monotonic() - begun, len(answered)
            assert response.success
            assert response.message.startswith('stopping along the reference')
            wait_until(lambda: len(answered) > before, 'the answer of a later batch', LONG)
            ideal.check_stopped()
            seen(f'answered in {1e3 * seconds:.0f} ms, after {before} of {BATCHES} batches')
    finally:
        node.destroy_client(service)


@fault(GROUP, '`~/stop` while the node is unconfigured or inactive',
       '`success` true; the message explains that there is nothing to stop')
def test_stop_of_a_node_that_is_not_active(client):
    with lifecycle_bench(client, '/interrupted_idle', {'autostart': False}) as one:
        words = 'nothing to stop: the node is not active'
        assert one.state() == 'unconfigured'
        assert stop(one).message == 'nothing to stop: no model yet'
        assert one.change(CONFIGURE)
        assert stop(one).message == words
        assert one.change(ACTIVATE)
        one.check_alive()
        assert one.change(DEACTIVATE)
        assert stop(one).message == words
        one.check_silent()
