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

"""
Joint state in, effort out: `dynamics_node` beside a bare rclpy node that echoes the message.

Both are processes of their own; this one asks each in turn and measures the round trip.
"""

import os
from pathlib import Path
import statistics
import subprocess
import sys
import tempfile
import threading
import time

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from robot_dynamics.planar_urdf import planar_arm_urdf
from sensor_msgs.msg import JointState

JOINTS = 7
RATE = 500.0
ROUNDS = 6
MESSAGES = 500
TIMEOUT = 10.0


class Echo(Node):
    """The least that an rclpy node with an executor can do."""

    def __init__(self) -> None:
        super().__init__('echo')
        qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._out = self.create_publisher(JointState, 'echo/out', 1)
        self.create_subscription(JointState, 'echo/in', self._out.publish, qos)


class Asker:
    """Publishes a state and waits for the answer with its stamp, in a thread of its own."""

    def __init__(self, node: Node, request: str, answer: str) -> None:
        self._publisher = node.create_publisher(JointState, request, 1)
        node.create_subscription(JointState, answer, self._on_answer, 1)
        self._answered = threading.Event()
        self._stamp = 0
        names = [f'joint{i + 1}' for i in range(JOINTS)]
        self._message = JointState(
            name=names, position=[0.1] * JOINTS, velocity=[0.0] * JOINTS)

    def _on_answer(self, message: JointState) -> None:
        if message.header.stamp.nanosec == self._stamp:
            self._answered.set()

    def ask(self) -> float | None:
        """Return the round trip [s], None where no answer came."""
        self._stamp += 1
        self._message.header.stamp.nanosec = self._stamp
        self._answered.clear()
        start = time.perf_counter()
        self._publisher.publish(self._message)
        if not self._answered.wait(0.2):
            return None
        return time.perf_counter() - start

    def connect(self) -> None:
        """Ask until an answer comes; raise TimeoutError where none does."""
        deadline = time.monotonic() + TIMEOUT
        while self.ask() is None:
            if time.monotonic() > deadline:
                raise TimeoutError(f'no answer in {TIMEOUT:g} s')

    def series(self) -> list[float]:
        """Return the round trips of one series at RATE; what got no answer is left out."""
        found = []
        next_time = time.perf_counter()
        for _ in range(MESSAGES):
            next_time += 1.0 / RATE
            trip = self.ask()
            if trip is not None:
                found.append(trip)
            time.sleep(max(0.0, next_time - time.perf_counter()))
        return found


def processor_seconds(pid: int) -> float:
    """Return the processor time [s] that a process has used."""
    fields = Path(f'/proc/{pid}/stat').read_text(encoding='ascii').rsplit(')', 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def main() -> None:
    """Print the medians and the ratios."""
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', str(os.getpid() % 100 + 1))
    ones = [1.0] * JOINTS
    with tempfile.TemporaryDirectory() as directory:
        urdf = Path(directory, 'arm.urdf')
        urdf.write_text(
            planar_arm_urdf(ones, ones, [0.5] * JOINTS, [0.1] * JOINTS), encoding='utf-8')
        commands = {
            'bare echo': [sys.executable, '-m', 'benchmarks.control_path'],
            'dynamics_node': [
                sys.executable, '-m', 'robot_dynamics.ros.dynamics_node', '--ros-args',
                '-p', f'robot_description_file:={urdf}'],
        }
        processes = {name: subprocess.Popen(command) for name, command in commands.items()}
        try:
            _measure(processes)
        finally:
            for process in processes.values():
                process.terminate()
            for process in processes.values():
                process.wait()


def _measure(processes: dict[str, 'subprocess.Popen[bytes]']) -> None:
    rclpy.init()
    node = rclpy.create_node('bench')
    askers = {
        'bare echo': Asker(node, 'echo/in', 'echo/out'),
        'dynamics_node': Asker(node, 'joint_states', 'effort_command'),
    }
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    spinning.start()
    for asker in askers.values():
        asker.connect()
    trips: dict[str, list[float]] = {name: [] for name in askers}
    used = dict.fromkeys(askers, 0.0)
    for _ in range(ROUNDS):
        for name, asker in askers.items():
            before = processor_seconds(processes[name].pid)
            trips[name] += asker.series()
            used[name] += processor_seconds(processes[name].pid) - before
    medians = {name: statistics.median(values) for name, values in trips.items()}
    per_message = {name: used[name] / len(trips[name]) for name in trips}
    for name, values in trips.items():
        p99 = float(np.percentile(values, 99))
        print(f'{name:16} round trip p50 {1e6 * medians[name]:6.0f} µs, p99 {1e6 * p99:6.0f} µs; '
              f'processor {1e6 * per_message[name]:5.0f} µs a message; '
              f'{ROUNDS * MESSAGES - len(values)} lost')
    print(f'ratio of the medians {medians["dynamics_node"] / medians["bare echo"]:.2f}, '
          f'of processor time {per_message["dynamics_node"] / per_message["bare echo"]:.2f}')
    executor.shutdown()
    spinning.join()
    rclpy.try_shutdown()


def run_echo() -> None:
    """Be the bare echo node."""
    rclpy.init()
    try:
        rclpy.spin(Echo())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    run_echo()
