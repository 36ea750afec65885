# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Time from the start of the process `dynamics_node` to its first effort, and its shares."""

import statistics
import subprocess
import sys
import threading
import time

from benchmarks.processes import arm_file, bench_node, DYNAMICS, node_command
from rclpy.node import Node
from sensor_msgs.msg import JointState

JOINTS = 7
ROUNDS = 7
TIMEOUT = 30.0
IMPORTS = ('numpy', 'pinocchio', 'rclpy', DYNAMICS)


class Driver:
    """Publishes joint states at 500 Hz and waits for the first effort."""

    def __init__(self, node: Node) -> None:
        names = [f'joint{i + 1}' for i in range(JOINTS)]
        self._node = node
        self._message = JointState(name=names, position=[0.1] * JOINTS, velocity=[0.0] * JOINTS)
        self._publisher = node.create_publisher(JointState, 'joint_states', 1)
        node.create_subscription(JointState, 'effort_command', self._on_effort, 1)
        self.answered = threading.Event()
        node.create_timer(0.002, self._send)

    def _send(self) -> None:
        self._message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(self._message)

    def _on_effort(self, _: JointState) -> None:
        self.answered.set()


def main() -> None:
    """Print the median time, and the median time of the imports only."""
    with arm_file(JOINTS) as urdf, bench_node() as node:
        driver = Driver(node)
        command = node_command(DYNAMICS, {'robot_description_file': urdf})
        times = [_first_effort(driver, command) for _ in range(ROUNDS)]
    print(f'process start to first effort: median {statistics.median(times):.2f} s, '
          f'{min(times):.2f} to {max(times):.2f} s')
    for name in IMPORTS:
        runs = [_import(name) for _ in range(ROUNDS)]
        print(f'  Python and `import {name}`: {statistics.median(runs):.2f} s')


def _first_effort(driver: Driver, command: list[str]) -> float:
    driver.answered.clear()
    start = time.perf_counter()
    process = subprocess.Popen(command)
    try:
        if not driver.answered.wait(TIMEOUT):
            raise TimeoutError(f'no effort in {TIMEOUT:g} s')
        return time.perf_counter() - start
    finally:
        process.terminate()
        process.wait()


def _import(name: str) -> float:
    start = time.perf_counter()
    subprocess.run([sys.executable, '-c', f'import {name}'], check=True)
    return time.perf_counter() - start
