# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Both nodes together: the closed loop without hardware.

How far an arm with brakes moves at the end of the command, and the first trial: both are described
in docs/safety.md.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
import os
import re
import signal
import time
from typing import Any

from children import TIMEOUT
from closed_loop import closed_loop, collecting, NAMES, publish, send, START
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.conversions import (
    stamp_from_ros,
    stamp_to_ros,
    trajectory_to_ros,
)
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory
from robot_dynamics.trajectories.quintics import quintic_point_to_point
from ros_harness import (
    Collector,
    DYNAMICS,
    LONG,
    NO_SHARED_MEMORY,
    NodeProcess,
    RosClient,
    SIMULATED_ARM,
    UNHURRIED,
    wait_until,
)
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

BUSY = 0.5
"""[s] that a busy machine delays a state in lock-step: ten times the default state_timeout."""


def until(states: Collector, seconds: float) -> list[Any]:
    """
    Return the states up to the first one received at this simulated time [s] or later, each once.

    In lock-step the nodes wait for each other but not for an observer: a slow observer misses
    states, depending on the load of the machine. The last state is always among those returned.
    """
    end = stamp_from_ros(states.wait_for(
        lambda m: stamp_from_ros(m.header.stamp) >= 1e9 * seconds, LONG).header.stamp)
    by_stamp = {stamp_from_ros(m.header.stamp): m for m in states.messages}
    return [by_stamp[stamp] for stamp in sorted(by_stamp) if stamp <= end]


class Gate:
    """
    Relays the states of an arm in lock-step to `dynamics`, and holds them at a simulated time.

    `dynamics` follows no trajectory before the first state, and the nodes do not wait for a
    sender. The arm waits at the gate until the trajectory has arrived, at the same simulated time
    in each run.
    """

    TOPIC = 'gated_states'
    HELD_AT = 100_000_000
    """[ns], simulated time of the state at which the arm waits."""

    def __init__(self, client: RosClient, namespace: str, busy_at: int = 0) -> None:
        """Wait for BUSY [s] with the state of the stamp `busy_at` [ns]."""
        self._client, self._namespace = client, namespace
        self._busy_at = busy_at
        self._is_open = self._is_waiting = False
        self._publisher = client.publisher(JointState, f'{namespace}/{self.TOPIC}')
        self.states = client.node.create_subscription(
            JointState, f'{namespace}/joint_states', self._relay, 10)

    def _relay(self, state: JointState) -> None:
        if self._is_open or stamp_from_ros(state.header.stamp) <= self.HELD_AT:
            if stamp_from_ros(state.header.stamp) == self._busy_at:
                time.sleep(BUSY)
            self._publisher.publish(state)
        else:  # the state before it has been answered
            self._is_waiting = True

    def follow(self, trajectory: JointTrajectory, stamp: float) -> None:
        """Send a trajectory that starts at a simulated time [s]; open once it is followed."""
        wait_until(lambda: self._is_waiting, 'the arm to wait', LONG)
        message = trajectory_to_ros(trajectory)
        message.header.stamp = stamp_to_ros(round(1e9 * stamp))
        publish(self._client, f'{self._namespace}/dynamics/joint_trajectory', message)
        # The node answers a request after the messages that it has received before.
        self._client.get_parameter(f'{self._namespace}/dynamics', 'command')
        self._is_open = True


@contextmanager
def gated(
    client: RosClient, namespace: str, trajectory: JointTrajectory, stamp: float,
    arm: Mapping[str, Any], busy_at: int = 0,
) -> Iterator[None]:
    """Run both nodes along a trajectory that starts at a simulated time [s]; see `Gate`."""
    with NodeProcess(
            DYNAMICS, {'lock_step': True}, namespace=namespace,
            remaps={'joint_states': Gate.TOPIC}):
        gate = Gate(client, namespace, busy_at)
        try:
            with NodeProcess(
                    SIMULATED_ARM, {'lock_step': True, 'initial_position': START, **arm},
                    namespace=namespace):
                gate.follow(trajectory, stamp)
                yield
        finally:
            client.node.destroy_subscription(gate.states)


def reference_at(path: JointTrajectory, t: float) -> np.ndarray:
    """Return the position of a quintic motion from rest to rest at the time t after its start."""
    s = min(max(t / path.duration, 0.0), 1.0)
    q0, q1 = path.points[0].position, path.points[-1].position
    return np.asarray(q0 + (10 * s**3 - 15 * s**4 + 6 * s**5) * (q1 - q0))


def largest_error(path: JointTrajectory, states: list[Any]) -> float:
    """Return the largest distance of these states from the motion, which begins at 0.5 s."""
    return max(np.abs(
        reference_at(path, 1e-9 * stamp_from_ros(m.header.stamp) - 0.5) - m.position).max()
        for m in states)


def content(state: Any) -> bytes:
    """Return the stamp and the numbers of a joint state as bytes."""
    return stamp_from_ros(state.header.stamp).to_bytes(8, 'big') + b''.join(
        values.tobytes() for values in (state.position, state.velocity, state.effort))


def test_lock_step_is_repeatable_to_the_last_bit_and_follows_the_trajectory(client):
    """
    Equal seeds give the same noisy motion along a trajectory.

    The second run is delayed in the middle of the motion.
    """
    path = quintic_point_to_point(NAMES, START, [0.2, 1.0], 1.0)
    recorded = []
    for namespace in ('/repeat1', '/repeat2'):
        with client.collect(JointState, f'{namespace}/joint_states') as states, gated(
                client, namespace, path, 0.5, {
                    'rate': 200.0, 'position_noise': 1e-5, 'velocity_noise': 1e-4, 'seed': 7},
                busy_at=800_000_000 if namespace == '/repeat2' else 0):
            seen = until(states, 1.7)
        # an effort that is held for 5 ms acts with a mean delay of 2.5 ms
        assert largest_error(path, seen) < 5e-3
        assert seen[-1].position == pytest.approx([0.2, 1.0], abs=5e-4)
        assert seen[-1].velocity == pytest.approx([0.0, 0.0], abs=5e-3)
        recorded.append([content(state) for state in seen])
    first, again = recorded
    # an observer may miss a message; the states that both received have to be the same
    seen_twice = {s[:8] for s in first} & {s[:8] for s in again}
    assert seen_twice
    assert len(set(first) & set(again)) == len(seen_twice)


DEACTIVATE = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_DEACTIVATE))
ENDS = {
    'deactivation': lambda client, _: client.call(
        ChangeState, '/ends/dynamics/change_state', DEACTIVATE),
    'command: none': lambda client, _: client.set_parameters(
        '/ends/dynamics', {'command': 'none'}),
    **{one.name: lambda _, pid, one=one: os.kill(pid, one) for one in (
        signal.SIGTERM, signal.SIGKILL)}}


@pytest.mark.parametrize(('end', 'action'), [
    *((end, 'hold_then_silence') for end in ENDS), ('SIGTERM', 'ramp_to_zero')])
def test_brakes_hold_the_arm_unless_the_command_ramps_to_zero(client, end, action):
    node = NodeProcess(
        DYNAMICS, {**UNHURRIED, 'joints': NAMES, 'end_action': action}, namespace='/ends',
        environment=NO_SHARED_MEMORY)
    with client.collect(JointState, '/ends/joint_states') as states, NodeProcess(
            SIMULATED_ARM, {'initial_position': START}, namespace='/ends') as arm:
        node.start()
        try:
            states.wait_for(lambda state: any(state.effort))
            states.clear()
            before = np.array(states.wait_count(100)[-1].position)
            ENDS[end](client, node.pid)
            line = arm.wait_for_log(
                r'\[WARN\].*No valid effort for [\d.]+ s \(command_timeout\), since the joint '
                r'state of [\d.]+ s: the brakes hold the arm where it is, until the next effort')
            assert float(re.search(r'for ([\d.]+) s', line)[1]) >= 0.2
            states.clear()
            moved = np.abs(states.wait_count(10)[-1].position - before).max()
        finally:
            node.kill()
            client.forget('/ends')
    if action == 'ramp_to_zero':
        assert moved > 0.3
    else:
        assert moved < 1e-3


ARRIVED = 0.005
"""[rad] from the goal, and [rad/s]."""


def test_the_first_trial_of_the_safety_page(client):
    """docs/safety.md, section "The first command, and every change", step by step."""
    start, goal = np.array(START), np.array([0.85, 0.5])
    namespace, node = '/first_trial', '/first_trial/dynamics'
    gravity = ArmDynamics(load_arm(default_arm_urdf())).rigid_body.gravity(start)

    def set_parameter(name: str, value: Any) -> None:
        client.set_parameters(node, {name: value})

    def hold_for(states: Collector, seconds: float) -> None:
        begin = states.wait_count(1, LONG)[-1].header.stamp
        end = begin.sec + 1e-9 * begin.nanosec + seconds
        states.wait_for(lambda m: m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec > end, LONG)

    with collecting(client, namespace, 'joint_states', 'effort_command') as (states, efforts), \
            closed_loop(namespace, {'joints': NAMES, 'command': 'none'}, real_time_factor=4.0):
        computed = client.wait_for(JointState, f'{node}/gravity_compensation', timeout=LONG)
        assert computed.effort == pytest.approx(gravity)
        assert not efforts.messages
        set_parameter('command', 'gravity_compensation')
        assert efforts.wait_count(1, LONG)[0].effort == pytest.approx(gravity)
        for scale in (0.5, 0.05):
            set_parameter('effort_limit_fraction', scale)
            hold_for(states, 1.0)
            assert states.messages[-1].position == pytest.approx(start, abs=1e-6)
        set_parameter('effort_limit_fraction', 0.5)
        set_parameter('command', 'computed_torque')
        send(client, namespace, (0.0, goal))
        states.wait_for(lambda m: np.abs(np.array(m.position) - goal).max() < ARRIVED
                        and np.abs(m.velocity).max() < ARRIVED, LONG)
        hold_for(states, 2.0)
        assert states.messages[-1].position == pytest.approx(goal, abs=1e-3)
        send(client, namespace, (0.0, goal + 2.0))
        states.wait_for(lambda m: m.position[0] > goal[0] + 0.2, LONG)
        assert client.call(Trigger, f'{node}/stop', Trigger.Request()).success
        wait_until(lambda: np.abs(states.messages[-1].velocity).max() < 1e-4, 'the stop', TIMEOUT)
        limits = load_arm(default_arm_urdf()).limits
        assert all((np.abs(m.velocity) <= limits.velocity).all() for m in states.messages)
