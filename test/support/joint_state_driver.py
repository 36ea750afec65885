# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A driver of an arm at rest in a separate process, which can be stopped, continued and killed.

It streams joint states with current stamps and does not make up for states that it missed while
stopped. `DriverProcess` runs it for a test.
"""

import os
from pathlib import Path
import re
import signal
import time

from fault_bench import NAMES, Q, V
import rclpy
from rclpy.executors import ExternalShutdownException
from ros_harness import NO_SHARED_MEMORY, NodeProcess, RosClient
from sensor_msgs.msg import JointState


class DriverProcess:
    """A driver process for a `FaultBench`; only one process runs at a time."""

    def __init__(self, _: RosClient, topic: str, rate: float = 200.0) -> None:
        """Prepare the process without starting it."""
        self.names, self.q, self._topic, self._rate = NAMES, Q, topic, rate
        self._process: NodeProcess | None = None
        self._stands = False

    def start(self) -> 'DriverProcess':
        """Start the process; do not wait for it."""
        self._process = NodeProcess(
            Path(__file__).stem, {'rate': self._rate}, remaps={'joint_states': self._topic},
            environment=NO_SHARED_MEMORY, ready=re.compile('Streaming')).launch()
        return self

    def be_quiet(self) -> None:
        """Stop the process with SIGSTOP."""
        self._send(signal.SIGSTOP)
        self._stands = True

    def go_on(self) -> None:
        """Continue the process, or start a new one if it was killed."""
        if self._process is None:
            self.start()
        elif self._stands:
            self._send(signal.SIGCONT)
            self._stands = False

    def kill(self) -> None:
        """Kill the process with SIGKILL."""
        if self._process is not None:
            self._process.kill()
            self._process, self._stands = None, False

    def close(self) -> None:
        """End the process."""
        self.kill()

    def _send(self, a_signal: signal.Signals) -> None:
        os.kill(self._process.pid, a_signal)


def main() -> None:
    """Publish joint states until a signal ends the process."""
    rclpy.init()
    node = rclpy.create_node('driver', automatically_declare_parameters_from_overrides=True)
    publisher = node.create_publisher(JointState, 'joint_states', 1)
    message = JointState(name=NAMES, position=Q, velocity=V)
    period = 1.0 / node.get_parameter('rate').value
    node.get_logger().info('Streaming')
    due = time.monotonic()
    try:
        while rclpy.ok():
            stamp = time.time_ns()
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
            publisher.publish(message)
            due = max(due + period, time.monotonic())
            time.sleep(max(due - time.monotonic(), 0.0))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == '__main__':
    main()
