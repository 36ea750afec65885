# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Joint state in, effort out: `dynamics_node` compared with a bare rclpy node that echoes messages.

Each node is a separate process. This process sends each of them a joint state every 2 ms in turn
and waits for the answer on a separate wait set. It takes messages as bytes, so that it contributes
little to the round trip. The floor is an echo node that also works without an executor and without
message objects. The difference between a node and the floor is the work of the node.
"""

from collections import defaultdict
from collections.abc import Callable, Mapping
import statistics
import struct
import sys
import time

from benchmarks.processes import (
    arm_file,
    DYNAMICS,
    module,
    node_command,
    processor_seconds,
    running,
    thread_seconds,
)
import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from robot_dynamics_interfaces.msg import DynamicsTerms
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

JOINTS = 7
RATE = 500.0
ROUNDS = 8
MESSAGES = 500
TIMEOUT = 10.0
TOPICS = (
    'gravity_compensation', 'computed_torque', 'terms', 'reference', 'feed_forward',
    'position_offset')
NAMES = [f'joint{i + 1}' for i in range(JOINTS)]
STAMP = slice(4, 12)
"""Where a serialized message has its stamp."""
STATES = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
TURN = 200_000_000
"""[ns] after which a wait looks whether the process is to end."""


class RawSubscription:
    """A subscription with a separate wait set, which returns messages as bytes."""

    def __init__(self, node: Node, topic: str, qos: QoSProfile | int) -> None:
        self._subscription = node.create_subscription(JointState, topic, lambda _: None, qos)
        self._wait_set = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, node.context.handle)

    def take(self, timeout_ns: int = TURN) -> bytes | None:
        """Wait, and return a message as bytes, or None if none arrived."""
        self._wait_set.clear_entities()
        self._wait_set.add_subscription(self._subscription.handle)
        self._wait_set.wait(timeout_ns)
        taken = self._subscription.handle.take_message(JointState, True)
        return None if taken is None else taken[0]


class Asker:
    """Publishes a state and waits for the answer with its stamp."""

    def __init__(self, node: Node, request: str, answer: str) -> None:
        self._publisher = node.create_publisher(JointState, request, 1)
        self._answers = RawSubscription(node, answer, 1)
        self._data = bytearray(serialize_message(
            JointState(name=NAMES, position=[0.1] * JOINTS, velocity=[0.0] * JOINTS)))

    def ask(self) -> float | None:
        """Return the round trip [s], or None if no answer arrived."""
        stamp = struct.pack('<iI', *divmod(time.time_ns(), 1_000_000_000))
        self._data[STAMP] = stamp
        data = bytes(self._data)
        start = time.perf_counter()
        self._publisher.publish(data)
        while time.perf_counter() - start < 0.2:
            answer = self._answers.take()
            if answer is not None and answer[STAMP] == stamp:
                return time.perf_counter() - start
        return None

    def connect(self) -> None:
        """Ask until an answer arrives; raise TimeoutError if none does."""
        deadline = time.monotonic() + TIMEOUT
        while self.ask() is None:
            if time.monotonic() > deadline:
                raise TimeoutError(f'no answer in {TIMEOUT:g} s')

    def series(self) -> list[float]:
        """Return the round trips [s] of one series at RATE, without states that got no answer."""
        found = []
        next_time = time.perf_counter()
        for _ in range(MESSAGES):
            next_time += 1.0 / RATE
            trip = self.ask()
            if trip is not None:
                found.append(trip)
            time.sleep(max(0.0, next_time - time.perf_counter()))
        return found


def set_command(node: Node, command: str) -> None:
    """Set the parameter `command` of `dynamics`."""
    client = AsyncParameterClient(node, 'dynamics')
    future = client.set_parameters([Parameter('command', value=command)])
    rclpy.spin_until_future_complete(node, future, timeout_sec=TIMEOUT)
    if not future.done() or not future.result().results[0].successful:
        raise RuntimeError(f'dynamics does not take command: {command}')


def follow_on(node: Node) -> None:
    """Send `dynamics` a trajectory that does not end, so that it computes torques."""
    publisher = node.create_publisher(JointTrajectory, 'dynamics/joint_trajectory', 1)
    trajectory = JointTrajectory(joint_names=NAMES)
    for seconds, place in ((1, 0.1), (100_000, 0.2)):
        point = JointTrajectoryPoint(
            positions=[place] * JOINTS, velocities=[0.0] * JOINTS, accelerations=[0.0] * JOINTS)
        point.time_from_start.sec = seconds
        trajectory.points.append(point)
    deadline = time.monotonic() + TIMEOUT
    while not publisher.get_subscription_count():
        if time.monotonic() > deadline:
            raise TimeoutError(f'no node subscribes to trajectories after {TIMEOUT:g} s')
        time.sleep(0.01)
    publisher.publish(trajectory)


def main() -> None:
    """Print the medians and the ratios."""
    with arm_file(JOINTS) as urdf, running({
            'bare echo': module('benchmarks.control_path', 'echo'),
            'floor': module('benchmarks.control_path', 'floor'),
            'dynamics_node': node_command(DYNAMICS, {
                'robot_description_file': urdf, 'state_timeout': 10.0,
                'command': 'gravity_compensation'})}) as ids:
        rclpy.init()
        node = rclpy.create_node('bench')
        try:
            _measure(node, ids)
        finally:
            rclpy.try_shutdown()


def _measure(node: Node, ids: dict[str, int]) -> None:
    askers = {
        'bare echo': Asker(node, 'echo/in', 'echo/out'),
        'floor': Asker(node, 'floor/in', 'floor/out'),
        'dynamics_node': Asker(node, 'joint_states', 'effort_command'),
    }
    for asker in askers.values():
        asker.connect()
    print('gravity compensation:')
    _side_by_side(askers, ids)
    set_command(node, 'computed_torque')
    print('holding:')
    _side_by_side(askers, ids)
    follow_on(node)
    print('along a trajectory:')
    _side_by_side(askers, ids)
    with running({'watcher': module('benchmarks.control_path', 'watcher')}):
        deadline = time.monotonic() + TIMEOUT
        while not all(node.count_subscribers(f'dynamics/{topic}') for topic in TOPICS):
            if time.monotonic() > deadline:
                raise TimeoutError(f'the watcher does not subscribe within {TIMEOUT:g} s')
            time.sleep(0.01)
        print(f'along a trajectory, with subscribers of {", ".join(TOPICS)}:')
        _side_by_side(askers, ids)


def _side_by_side(askers: Mapping[str, Asker], ids: Mapping[str, int]) -> None:
    trips: dict[str, list[float]] = {name: [] for name in askers}
    used = dict.fromkeys(askers, 0.0)
    threads: dict[str, float] = defaultdict(float)
    for _ in range(ROUNDS):
        for name, asker in askers.items():
            before, of_threads = processor_seconds(ids[name]), thread_seconds(ids[name])
            trips[name] += asker.series()
            used[name] += processor_seconds(ids[name]) - before
            for thread, seconds in thread_seconds(ids[name]).items():
                threads[f'{name} {thread}'] += seconds - of_threads.get(thread, 0.0)
    medians = {name: statistics.median(values) for name, values in trips.items()}
    per_message = {name: used[name] / len(trips[name]) for name in trips}
    for name, values in trips.items():
        p99 = float(np.percentile(values, 99))
        each = ', '.join(
            f'{1e6 * seconds / len(values):.0f}' for thread, seconds in sorted(
                threads.items(), key=lambda one: -one[1])
            if thread.startswith(f'{name} ') and 1e6 * seconds >= len(values))
        print(f'  {name:14} round trip p50 {1e6 * medians[name]:5.0f} µs, '
              f'p99 {1e6 * p99:5.0f} µs; processor {1e6 * per_message[name]:4.0f} µs per message, '
              f'by thread {each}; '
              f'{ROUNDS * MESSAGES - len(values)} lost; of the echo: '
              f'{medians[name] / medians["bare echo"]:.2f}, '
              f'{per_message[name] / per_message["bare echo"]:.2f}')


# ---------------------------------------------------------------------------- the other nodes

def echo(node: Node) -> None:
    """Echo with the least work that an rclpy node with an executor needs."""
    out = node.create_publisher(JointState, 'echo/out', 1)
    node.create_subscription(JointState, 'echo/in', out.publish, STATES)
    rclpy.spin(node)


def floor(node: Node) -> None:
    """Echo with the least work that Python needs."""
    out = node.create_publisher(JointState, 'floor/out', 1)
    states = RawSubscription(node, 'floor/in', STATES)
    while node.context.ok():
        data = states.take()
        if data is not None:
            out.publish(data)


def watcher(node: Node) -> None:
    """Subscribe to all topics that `dynamics` publishes for each state, as a recorder does."""
    for topic in TOPICS:
        node.create_subscription(
            DynamicsTerms if topic == 'terms' else JointState, f'dynamics/{topic}',
            lambda data: None, STATES, raw=True)
    rclpy.spin(node)


NODES: dict[str, Callable[[Node], None]] = {'echo': echo, 'floor': floor, 'watcher': watcher}


def run(name: str) -> None:
    """Run one of the nodes with which `dynamics_node` is compared."""
    rclpy.init()
    try:
        NODES[name](rclpy.create_node(name))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    run(sys.argv[1])
