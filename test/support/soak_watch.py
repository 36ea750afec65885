# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Two processes that monitor a long run: the published messages, and the delays of the computer.

`record` stores the time of publication and the state of each command of a `dynamics` node, and
counts the messages of all its topics with non-finite numbers. `wake` repeatedly sleeps for a
millisecond and stores the times at which it woke up late: no process is punctual then. Both write
their results to a file when they are interrupted.
"""

from array import array
from collections.abc import Callable, Iterable
import math
import signal
import sys
import threading
import time
from typing import Any

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from robot_dynamics_interfaces.msg import DynamicsTerms
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

NANOSECONDS = 1_000_000_000
EVERY_ONE = QoSProfile(depth=10000)
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
NAP, LATE = 0.001, 0.0005
"""Duration of a sleep, and the smallest delay that is recorded [s]."""
INTERRUPTED = threading.Event()


class EffortRecorder:
    """Subscribes to all topics of a `dynamics` node with the rate of the joint states."""

    def __init__(self, node: Any, namespace: str) -> None:
        self.efforts = array('q')
        """Per command: its number, its time of publication [ns], the stamp of its state [ns]."""
        self.received = self.not_finite = 0
        node.create_subscription(
            JointState, f'{namespace}/effort_command', self._on_effort, EVERY_ONE)
        for message_type, name, numbers in (
                (JointState, 'gravity_compensation', lambda message: message.effort),
                (JointState, 'computed_torque', lambda message: message.effort),
                (Float64MultiArray, 'commands', lambda message: message.data),
                (DynamicsTerms, 'terms', numbers_of)):
            node.create_subscription(
                message_type, f'{namespace}/dynamics/{name}', self._checker(numbers), NEWEST)

    def _on_effort(self, message: JointState, info: dict[str, int]) -> None:
        self._check(message.effort)
        stamp = message.header.stamp
        self.efforts.extend((
            info['publication_sequence_number'], info['source_timestamp'],
            stamp.sec * NANOSECONDS + stamp.nanosec))

    def _checker(self, numbers: Callable[[Any], Iterable[float]]) -> Callable[[Any], None]:
        def check(message: Any) -> None:
            self._check(numbers(message))

        return check

    def _check(self, numbers: Iterable[float]) -> None:
        self.received += 1
        self.not_finite += not all(map(math.isfinite, numbers))


def numbers_of(message: DynamicsTerms) -> list[float]:
    """Return all numbers of a message."""
    return [
        message.kinetic_energy, message.potential_energy, *message.inertial, *message.coriolis,
        *message.gravity, *message.friction, *message.external, *message.effort]


def record(file: str, namespace: str) -> None:
    """Record until interrupted."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('recorder')
    recorder = EffortRecorder(node, namespace)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not INTERRUPTED.is_set():
        executor.spin_once(timeout_sec=0.1)
    np.savez(
        file, efforts=np.array(recorder.efforts).reshape(-1, 3), received=recorder.received,
        not_finite=recorder.not_finite)


def wake(file: str) -> None:
    """Sleep repeatedly until interrupted."""
    late: list[tuple[float, float]] = []
    while not INTERRUPTED.is_set():
        due = time.time() + NAP
        time.sleep(NAP)
        passed = time.time() - due
        if passed > LATE:
            late.append((due, passed))
    np.savez(file, late=np.array(late).reshape(-1, 2))


if __name__ == '__main__':
    signal.signal(signal.SIGINT, lambda *_: INTERRUPTED.set())
    {'record': record, 'wake': wake}[sys.argv[1]](*sys.argv[2:])
