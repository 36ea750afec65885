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

"""`~/reference` of a real node: the reference at each state, and no message without one."""

from collections.abc import Iterator
import time
from typing import Any

from fault_bench import fault_bench, FaultBench, G, NAMES, nanoseconds_of, Q, stamp_of
from fault_stimuli import SetPoints
import numpy as np
import pytest
from robot_dynamics.ros.conversions import trajectory_to_ros
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
    """Return a joint state; the arm stays at its position, independent of commands."""
    message = JointState(**{'name': NAMES, 'position': Q, 'velocity': [0.0, 0.0], **fields})
    message.header.stamp = stamp_of(nanoseconds)
    return message


@pytest.mark.parametrize('reaction', ['hold', 'gravity_compensation'])
def test_it_is_the_trajectory_at_the_stamp_of_the_state(
    client: RosClient, reaction: str,
) -> None:
    """In the joint order of the node, independent of the order of the trajectory."""
    trajectory = quintic_via_points(
        NAMES, [0.0, 1.0, 2.5], [Q, [Q[0] + 0.7, Q[1] - 0.4], [Q[0] - 0.3, Q[1] + 0.2]])
    rest = Reference(np.array(Q), np.zeros(2), np.zeros(2))
    expected = ActiveTrajectory(trajectory, START, START, rest)
    namespace = f'/reference_{reaction}'
    parameters = {'joints': NAMES[::-1], 'reference_loss': reaction}
    with NodeProcess(DYNAMICS, parameters, namespace=namespace), \
            client.collect(JointState, f'{namespace}/dynamics/reference') as references:
        references.wait_matched()
        states = client.publisher(JointState, f'{namespace}/joint_states', 1)
        trajectories = client.publisher(
            JointTrajectory, f'{namespace}/dynamics/joint_trajectory')
        with client.collect(
                JointState, f'{namespace}/dynamics/gravity_compensation') as gravity:
            gravity.wait_matched()
            client.answer_to(states, state(START - 1_000_000_000), gravity)
            message = trajectory_to_ros(trajectory)
            message.header.stamp = stamp_of(START)
            trajectories.publish(message)
            # repeated until the trajectory is followed, from its arrival on
            client.answer_to(states, state(START - 500_000_000), references)
            for ns in range(START, START + 3_000_000_000, 70_000_123):
                found = client.answer_to(states, state(ns), references)
                position, velocity, _ = expected.sample(ns)
                assert list(found.name) == NAMES[::-1]
                assert found.position == pytest.approx(position[::-1], abs=1e-12)
                assert found.velocity == pytest.approx(velocity[::-1], abs=1e-12)
                assert list(found.effort) == []
            assert list(found.velocity) == [0.0, 0.0]  # the end is held
            # a state without velocity ends the trajectory, and nothing is followed
            client.answer_to(states, state(ns + 1_000_000, velocity=[]), gravity)
            if reaction == 'hold':  # then the measured position is held
                found = client.answer_to(states, state(ns + 2_000_000), references)
                assert list(found.position) == Q[::-1]
                assert list(found.velocity) == [0.0, 0.0]
            else:
                client.answer_to(states, state(ns + 2_000_000), gravity)
                client.answer_to(states, state(ns + 3_000_000), gravity)
    stamps = [nanoseconds_of(message.header.stamp) for message in references.messages]
    assert START - 1_000_000_000 not in stamps
    assert ns + 1_000_000 not in stamps
    assert (max(stamps) > ns) == (reaction == 'hold')


# --- no reference --------------------------------------------------------------------------------

@pytest.fixture(scope='module')
def bench(client: RosClient) -> Iterator[FaultBench]:
    """
    Return a node with default safety parameters, as left by the last test, without a reference.

    The node holds no position after the end of a reference; a test that sets `hold` gets one.
    """
    with fault_bench(
            client, '/referred', {**NEVER, 'reference_loss': 'gravity_compensation'}) as one:
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


def check_stream(bench: FaultBench, references: Collector) -> None:
    """Check that a stream is followed, and is no longer followed after its timeout."""
    moment = time.time_ns()
    with SetPoints(bench, lambda: GOAL) as stream:
        check_followed(references, moment)
        wait_until(lambda: stream.sent >= 10, 'ten set-points')
    bench.set_parameters(reference_timeout=0.5)
    check_silent(bench, references)
    bench.set_parameters(**NEVER)
    check_followed(references, moment)


def test_without_a_stream_of_set_points_there_is_none(
    bench: FaultBench, references: Collector,
) -> None:
    check_silent(bench, references)
    assert references.messages == []
    check_stream(bench, references)


def test_a_fault_discards_the_reference(bench: FaultBench, references: Collector) -> None:
    moment = time.time_ns()
    bench.set_point(GOAL)  # a single set-point is held until another event ends the reference
    check_followed(references, moment)
    bench.driver.be_quiet()
    bench.wait_state_timeout()
    bench.driver.go_on()
    bench.wait_running()
    check_silent(bench, references)
    check_stream(bench, references)
