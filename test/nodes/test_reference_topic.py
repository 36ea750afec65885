# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`~/reference` of a real node: the reference at each state, and no message without one."""

from collections.abc import Iterator, Sequence
import time
from typing import Any

from fault_bench import fault_bench, FaultBench, G, NAMES, nanoseconds_of, Q, stamp_of
from fault_stimuli import SetPoints
import numpy as np
import pytest
from robot_dynamics.ros.middleware.conversions import trajectory_to_ros
from robot_dynamics.trajectories.follower import ActiveTrajectory
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.quintics import quintic_via_points
from ros_harness import Collector, DYNAMICS, NodeProcess, RosClient, wait_until
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

GOAL = [Q[0] + 0.01, Q[1]]
NEVER = {'reference_timeout': 60.0}
"""During a stream: no pause of it on a loaded machine ends it."""
START = 12_000_000_789
"""When the trajectory begins [ns], by the stamps of the joint states."""


# --- a trajectory --------------------------------------------------------------------------------

def state(nanoseconds: int, **fields: Any) -> JointState:
    """Return a joint state; the arm stays at its position, but its sample does not repeat."""
    q = [Q[0] + 1e-12 * (nanoseconds // 1000 % 997), Q[1] - 1e-12 * (nanoseconds // 1000 % 991)]
    message = JointState(**{'name': NAMES, 'position': q, 'velocity': [0.0, 0.0], **fields})
    message.header.stamp = stamp_of(nanoseconds)
    return message


def test_it_is_the_trajectory_at_the_stamp_of_the_state(client: RosClient) -> None:
    """In the joint order of the node, independent of the order of the trajectory."""
    trajectory = quintic_via_points(
        NAMES, [0.0, 1.0, 2.5], [Q, [Q[0] + 0.7, Q[1] - 0.4], [Q[0] - 0.3, Q[1] + 0.2]])
    rest = Reference(np.array(Q), np.zeros(2), np.zeros(2))
    expected = ActiveTrajectory(trajectory, START, START, rest)
    parameters = {'joints': NAMES[::-1], 'require_measured_velocities': True}
    with NodeProcess(DYNAMICS, parameters, namespace='/reference'), \
            client.collect(JointState, '/reference/dynamics/reference') as references:
        references.wait_matched()
        states = client.publisher(JointState, '/reference/joint_states', 1)
        trajectories = client.publisher(
            JointTrajectory, '/reference/dynamics/joint_trajectory')
        with client.collect(
                JointState, '/reference/dynamics/gravity_compensation') as gravity:
            gravity.wait_matched()
            found = client.answer_to(states, state(START - 1_000_000_000), references)
            check_held(found)  # from the first state on
            message = trajectory_to_ros(trajectory)
            message.header.stamp = stamp_of(START)
            trajectories.publish(message)
            trajectories.wait_for_all_acked()
            client.get_parameter('/reference/dynamics', 'command')  # answered after that message
            check_held(client.answer_to(states, state(START - 500_000_000), references))
            for ns in range(START, START + 3_000_000_000, 70_000_123):
                found = client.answer_to(states, state(ns), references)
                position, velocity, _ = expected.sample(ns)
                assert list(found.name) == NAMES[::-1]
                assert found.position == pytest.approx(position[::-1], abs=1e-8)
                assert found.velocity == pytest.approx(velocity[::-1], abs=1e-8)
                assert list(found.effort) == []
            assert found.velocity == pytest.approx([0.0, 0.0], abs=1e-8)  # the end is held
            # a state without velocity ends the trajectory, and then the measured position is held
            client.answer_to(states, state(ns + 1_000_000, velocity=[]), gravity)
            check_held(client.answer_to(states, state(ns + 2_000_000), references))
    stamps = [nanoseconds_of(message.header.stamp) for message in references.messages]
    assert ns + 1_000_000 not in stamps


def check_held(message: JointState) -> None:
    """Check that a reference is a rest at `Q`."""
    assert message.position == pytest.approx(Q[::-1], abs=1e-8)
    assert message.velocity == pytest.approx([0.0, 0.0], abs=1e-7)


# --- the hold, and no reference ------------------------------------------------------------------

@pytest.fixture(scope='module')
def bench(client: RosClient) -> Iterator[FaultBench]:
    """Return a node with default safety parameters, as left by the last test."""
    with fault_bench(client, '/referred', NEVER) as one:
        yield one


@pytest.fixture
def references(bench: FaultBench) -> Iterator[Collector]:
    with bench.client.collect(JointState, bench.name('reference')) as collector:
        collector.wait_matched()
        yield collector


def is_gravity(message: JointState) -> bool:
    """Return whether an effort is the gravity torque only."""
    return bool(np.allclose(message.effort, G, atol=1e-6))


def after(references: Collector, moment: int) -> list[JointState]:
    """Return the references for states of this time [ns] and later."""
    return [message for message in references.messages
            if nanoseconds_of(message.header.stamp) >= moment]


def check_silent(bench: FaultBench, references: Collector) -> None:
    """Check that there is no reference from the next effort on that is the gravity torque only."""
    asked = time.time_ns()
    moment = nanoseconds_of(bench.efforts.wait_for(
        lambda m: is_gravity(m) and nanoseconds_of(m.header.stamp) > asked).header.stamp)
    bench.efforts.clear()
    bench.efforts.wait_for(lambda m: nanoseconds_of(m.header.stamp) > moment)
    assert all(map(is_gravity, bench.efforts.wait_count(100)))
    assert after(references, moment) == []


def check_followed(references: Collector, moment: int) -> None:
    """Check that references from this time [ns] on lead from `Q` to `GOAL`, and stay there."""
    def is_there(message: JointState) -> bool:
        return list(message.velocity) == [0.0, 0.0] and (
            message.position == pytest.approx(GOAL, abs=1e-9))

    wait_until(lambda: any(map(is_there, after(references, moment))), 'a reference at its goal')
    messages = after(references, moment)
    there = next(i for i, message in enumerate(messages) if is_there(message))
    assert all(map(is_there, messages[there:]))
    for message in messages:
        assert list(message.name) == NAMES
        assert Q[0] - 1e-9 <= message.position[0] <= GOAL[0] + 1e-9
        assert message.position[1] == pytest.approx(Q[1], abs=1e-9)


def wait_at(bench: FaultBench, references: Collector, q: Sequence[float]) -> None:
    """Wait until 100 references since now rest at q."""
    moment = time.time_ns()

    def rests() -> bool:
        last = after(references, moment)[-100:]
        return len(last) == 100 and all(
            list(m.velocity) == [0.0, 0.0] and m.position == pytest.approx(q, abs=1e-9)
            for m in last)

    wait_until(rests, f'references at {q}')


def test_gravity_compensation_has_none(bench: FaultBench, references: Collector) -> None:
    wait_at(bench, references, Q)  # computed torque holds the arm
    bench.set_parameters(command='gravity_compensation')
    check_silent(bench, references)
    bench.set_parameters(command='computed_torque')
    wait_at(bench, references, Q)


def test_a_stream_of_set_points_is_followed_and_its_end_is_held(
    bench: FaultBench, references: Collector,
) -> None:
    moment = time.time_ns()
    with SetPoints(bench, lambda: GOAL) as stream:
        check_followed(references, moment)
        wait_until(lambda: stream.sent >= 10, 'ten set-points')
    bench.set_parameters(reference_timeout=0.5)
    bench.wait_status('reference', lambda status: 'the stream of set-points' in status.message)
    wait_at(bench, references, GOAL)
    bench.set_parameters(**NEVER)


def test_after_a_fault_the_measured_position_is_held(
    bench: FaultBench, references: Collector,
) -> None:
    moment = time.time_ns()
    bench.set_point(GOAL)  # a single set-point is held until another event ends the reference
    check_followed(references, moment)
    bench.driver.be_quiet()
    bench.wait_state_timeout()
    bench.driver.go_on()
    bench.wait_running()
    wait_at(bench, references, Q)
    assert is_gravity(bench.efforts.messages[-1])
