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

"""Both nodes together: the loop that closes without hardware."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from builtin_interfaces.msg import Time
import numpy as np
import pytest
from rclpy.serialization import serialize_message
from robot_dynamics.arm_dynamics import ArmDynamics
from robot_dynamics.arm_model import load_arm
from robot_dynamics.payload import make_payload
from robot_dynamics.planar_urdf import default_arm_urdf
from robot_dynamics.ros.conversions import payload_to_ros, stamp_from_ros, trajectory_to_ros
from robot_dynamics.trajectory import JointTrajectory, quintic_point_to_point, quintic_via_points
from robot_dynamics_interfaces.srv import SetPayload
from ros_harness import (
    Collector,
    DYNAMICS,
    KEEP_MANY,
    NodeProcess,
    RosClient,
    SIMULATED_ARM,
)
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg

ARM = load_arm(default_arm_urdf())
NAMES = ARM.joint_names
START = [0.8, 0.5]
RATE = 200.0
LONG = 60.0
"""[s] for things that take many messages on a busy machine."""


@contextmanager
def loop(
    namespace: str, arm: Mapping[str, Any], controller: Mapping[str, Any] | None = None,
    arm_first: bool = False, name: str = '',
) -> Iterator[None]:
    """Run both nodes; they stop in the opposite order."""
    parameters = {'rate': RATE, 'lock_step': True, 'initial_position': START, **arm}
    simulated = NodeProcess(SIMULATED_ARM, parameters, namespace=namespace)
    dynamics = NodeProcess(DYNAMICS, controller, namespace=namespace)
    first, second = (simulated, dynamics) if arm_first else (dynamics, simulated)
    with first, second:
        yield


def until(states: Collector, seconds: float) -> list[Any]:
    """Return the states up to this simulated time, each once."""
    states.wait_for(lambda m: stamp_from_ros(m.header.stamp) >= 1e9 * seconds, LONG)
    by_stamp = {stamp_from_ros(m.header.stamp): m for m in states.messages}
    return [by_stamp[stamp] for stamp in sorted(by_stamp) if stamp <= 1e9 * seconds]


def at(seconds: float) -> Time:
    return Time(sec=int(seconds), nanosec=round(1e9 * (seconds % 1.0)))


def send(client: RosClient, namespace: str, trajectory: JointTrajectory, stamp: float) -> None:
    """Publish a trajectory that starts at a simulated time, 0 for now."""
    publisher = client.publisher(
        JointTrajectoryMsg, f'{namespace}/dynamics/joint_trajectory')
    message = trajectory_to_ros(trajectory)
    message.header.stamp = at(stamp)
    publisher.publish(message)
    # until it has arrived: a publisher that goes takes what it has not sent with it
    publisher.wait_for_all_acked()
    client.node.destroy_publisher(publisher)


# --- standing still ------------------------------------------------------------------------------

@pytest.mark.parametrize(('pose', 'arm_first'), [
    ([0.8, 0.5], False), ([2.2, -1.3], True), ([-1.5707963, 0.1], False)])
def test_gravity_compensation_holds_the_arm(
    client: RosClient, pose: list[float], arm_first: bool,
) -> None:
    """Less than 1 mrad of drift in 10 s, whichever node starts first."""
    namespace = f'/hold{abs(hash(tuple(pose))) % 10**6}'
    with client.collect(JointState, f'{namespace}/joint_states', KEEP_MANY) as states, \
            loop(namespace, {'initial_position': pose}, arm_first=arm_first):
        seen = until(states, 10.0)
    assert len(seen) > 0.5 * RATE * 10.0  # an observer may miss some, the loop does not
    drift = np.abs(np.array([m.position for m in seen]) - pose).max()
    assert drift < 1e-3


def test_in_wall_time_the_arm_is_held_from_its_brakes_on(client: RosClient) -> None:
    with client.collect(JointState, '/wall/joint_states', KEEP_MANY) as states, \
            loop('/wall', {'lock_step': False}, arm_first=True):
        states.wait_for(lambda m: any(m.effort))  # the first effort has opened the brakes
        before = len(states.messages)
        seen = states.wait_count(before + 400)
    assert np.abs(np.array([m.position for m in seen]) - START).max() < 1e-3
    stamps = np.array([stamp_from_ros(m.header.stamp) for m in seen])
    assert np.median(np.diff(stamps)) == 1e9 / RATE
    assert np.abs(np.array([m.effort for m in seen[before + 1:]])).min() > 1.0


# --- following -----------------------------------------------------------------------------------

def reference_at(path: JointTrajectory, t: float) -> np.ndarray:
    """Return where a quintic motion from rest to rest is at the time t from its start."""
    s = min(max(t / path.duration, 0.0), 1.0)
    q0, q1 = path.points[0].position, path.points[-1].position
    return np.asarray(q0 + (10 * s**3 - 15 * s**4 + 6 * s**5) * (q1 - q0))


def test_computed_torque_follows_a_quintic(client: RosClient) -> None:
    path = quintic_point_to_point(NAMES, START, [-0.4, 1.4], 2.0)
    with client.collect(JointState, '/follow/joint_states', KEEP_MANY) as states:
        with NodeProcess(DYNAMICS, namespace='/follow'):
            send(client, '/follow', path, 0.5)
            parameters = {'rate': 500.0, 'lock_step': True, 'initial_position': START}
            with NodeProcess(SIMULATED_ARM, parameters, namespace='/follow'):
                seen = until(states, 3.5)
    errors = [
        np.abs(reference_at(path, 1e-9 * stamp_from_ros(m.header.stamp) - 0.5) - m.position).max()
        for m in seen]
    # an effort that is held for 2 ms acts 1 ms late
    assert max(errors) < 2e-3
    assert seen[-1].position == pytest.approx([-0.4, 1.4], abs=1e-4)
    assert seen[-1].velocity == pytest.approx([0.0, 0.0], abs=1e-3)


def test_a_replacement_in_flight_keeps_the_command_continuous(client: RosClient) -> None:
    there = quintic_point_to_point(NAMES, START, [-0.4, 1.4], 2.0)
    back = quintic_via_points(NAMES, (0.0, 2.0), [[0.5, 0.5], START])
    late = JointTrajectory(  # no point at its start: it leads on from where the reference is
        tuple(NAMES), (back.points[-1],))
    with client.collect(JointState, '/replace/effort_command', KEEP_MANY) as efforts:
        with NodeProcess(DYNAMICS, namespace='/replace'):
            send(client, '/replace', there, 0.0)
            parameters = {'rate': RATE, 'lock_step': True, 'initial_position': START}
            with NodeProcess(SIMULATED_ARM, parameters, namespace='/replace'):
                efforts.wait_for(lambda m: stamp_from_ros(m.header.stamp) > 0.6e9, LONG)
                send(client, '/replace', late, 0.0)
                efforts.wait_for(
                    lambda m: abs(m.effort[0] + 56.0) < 100 and (
                        stamp_from_ros(m.header.stamp) >= 8e9), LONG)
    by_stamp = {stamp_from_ros(m.header.stamp): m.effort for m in efforts.messages}
    stamps = sorted(stamp for stamp in by_stamp if stamp <= 8e9)
    jumps = [
        np.abs(np.array(by_stamp[b]) - by_stamp[a]).max()
        for a, b in zip(stamps, stamps[1:]) if b - a == round(1e9 / RATE)]
    assert len(jumps) > 0.5 * 8.0 * RATE
    # a step of the reference alone by 0.1 rad would make one of M K_p 0.1 = 280 N·m
    assert max(jumps) < 5.0
    final = ArmDynamics(ARM).rigid_body.gravity(np.array(START))
    assert by_stamp[stamps[-1]] == pytest.approx(final, abs=0.05)


# --- the same again ------------------------------------------------------------------------------

def recorded_run(client: RosClient, namespace: str, seed: int) -> list[bytes]:
    """Return the first 2 s of a noisy loop that follows a trajectory, byte by byte."""
    path = quintic_point_to_point(NAMES, START, [0.2, 1.0], 1.0)
    noise = {'position_noise': 1e-4, 'velocity_noise': 1e-3, 'seed': seed}
    with client.collect(JointState, f'{namespace}/joint_states', KEEP_MANY) as states:
        with NodeProcess(DYNAMICS, namespace=namespace):
            send(client, namespace, path, 0.5)
            parameters = {
                'rate': RATE, 'lock_step': True, 'initial_position': START, **noise}
            with NodeProcess(SIMULATED_ARM, parameters, namespace=namespace):
                return [serialize_message(m) for m in until(states, 2.0)]


def test_lock_step_is_repeatable_to_the_last_bit(client: RosClient) -> None:
    first, again, other = (
        recorded_run(client, f'/repeat{i}', seed) for i, seed in enumerate((7, 7, 8)))
    # an observer of a topic may miss a message; what both saw has to be the same
    common = set(first) & set(again)
    assert len(common) == min(len(first), len(again)) > 0.5 * 2.0 * RATE
    assert not set(first) & set(other)


# --- loads ---------------------------------------------------------------------------------------

def load_of(client: RosClient, namespace: str, node: str) -> None:
    response = client.call(
        SetPayload, f'{namespace}/{node}/set_payload',
        SetPayload.Request(payload=payload_to_ros(make_payload('tool0', 2.0))))
    assert response.success, response.message


def test_a_load_that_the_controller_knows_of_is_held(client: RosClient) -> None:
    with client.collect(JointState, '/loaded/joint_states', KEEP_MANY) as states:
        with NodeProcess(SIMULATED_ARM, {
                'rate': RATE, 'lock_step': True, 'initial_position': START},
                namespace='/loaded'):
            load_of(client, '/loaded', 'simulated_arm')  # it waits with its brakes on
            with NodeProcess(DYNAMICS, {'command': 'none'}, namespace='/loaded'):
                load_of(client, '/loaded', 'dynamics')
                client.set_parameters('/loaded/dynamics', {'command': 'computed_torque'})
                seen = until(states, 5.0)
    assert np.abs(np.array([m.position for m in seen]) - START).max() < 1e-3


def test_a_load_that_the_controller_does_not_know_of_pulls_the_arm_down(
    client: RosClient,
) -> None:
    with client.collect(JointState, '/unknown/joint_states', KEEP_MANY) as states:
        with NodeProcess(SIMULATED_ARM, {
                'rate': RATE, 'lock_step': True, 'initial_position': START},
                namespace='/unknown'):
            load_of(client, '/unknown', 'simulated_arm')
            with NodeProcess(DYNAMICS, namespace='/unknown'):
                seen = until(states, 0.5)
    assert seen[-1].position[0] > START[0] + 0.1
