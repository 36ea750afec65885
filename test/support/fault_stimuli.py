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

"""What tests of faults do to the messages that they send, and check of those that they get."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import random
import threading
import time
from typing import Any

from fault_bench import (
    Change,
    Driver,
    FaultBench,
    NANOSECONDS,
    nanoseconds_of,
    stamp_of,
    TimedCollector,
)
import numpy as np
from robot_dynamics.control.effort_limiter import LONGEST_STEP
from ros_harness import TIMEOUT, wait_until
from sensor_msgs.msg import JointState

RATE = np.array([1500.0, 600.0])
"""`effort_rate_limit` of the default arm by default [N m/s]: its effort limits in 0.1 s."""
DIRECT = {
    'condition_references': False, 'soften_gains': False, 'following_error_limit': [0.0]}
"""
With these a set-point far away asks for more than the limits of the command allow, at once.

For tests of these limits, of the guard and of fault actions, which the conditioned reference of an
arm at rest would never reach.
"""
NO_STREAM = {'reference_timeout': 0.001}
"""For tests of other faults: set-points so far apart are no stream, whose end they would be."""


def altered(**fields: Any) -> Change:
    """Return what replaces fields of each state."""
    def change(message: JointState) -> JointState:
        for name, value in fields.items():
            setattr(message, name, value)
        return message

    return change


def shifted(seconds: float) -> Change:
    """Return what moves the stamp of each state."""
    def change(message: JointState) -> JointState:
        message.header.stamp = stamp_of(
            nanoseconds_of(message.header.stamp) + round(NANOSECONDS * seconds))
        return message

    return change


def stamped(nanoseconds: int) -> Change:
    """Return what gives all states the same stamp."""
    return lambda message: altered_stamp(message, nanoseconds)


def altered_stamp(message: JointState, nanoseconds: int) -> JointState:
    """Return a state with another stamp."""
    message.header.stamp = stamp_of(nanoseconds)
    return message


def from_now(bench: FaultBench) -> int:
    """Return a time [ns]: stamps from it on are of states that the driver changes as now set."""
    wait_states(bench, 2)
    return time.time_ns()


def wait_states(bench: FaultBench, count: int) -> None:
    """Wait until the driver has sent so many more states."""
    goal = bench.driver.sent + count
    wait_until(lambda: bench.driver.sent >= goal, f'{count} states sent')


@contextmanager
def another_publisher(bench: FaultBench, change: Change, **driver: Any) -> Iterator[None]:
    """
    Let a second publisher, whose states are changed, take turns with the driver at random.

    Whatever part of the states a slow node gets to see: they are not of one publisher for long.
    """
    other = Driver(bench.client, f'{bench.namespace}/joint_states', **driver)
    source = random.Random(1)

    def take_turns(message: JointState) -> JointState | None:
        if source.random() < 0.5:
            return message
        other.publisher.publish(change(other.message()))
        return None

    bench.driver.change = take_turns
    try:
        yield
    finally:
        bench.driver.go_on()
        bench.client.node.destroy_publisher(other.publisher)


class SetPoints:
    """A stream of set-points from a thread, for a `with` statement; it ends with it."""

    def __init__(
        self, bench: FaultBench, next_pose: Callable[[], Sequence[float]], rate: float = 50.0,
    ) -> None:
        self._bench, self._next_pose, self._period = bench, next_pose, 1.0 / rate
        self.sent, self.last = 0, 0.0
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _run(self) -> None:
        while not self._ends.wait(self._period):
            self.last = time.monotonic()
            self._bench.set_point(self._next_pose())
            self.sent += 1

    def __enter__(self) -> 'SetPoints':
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        self._thread.join(TIMEOUT)


def check_rate(efforts: TimedCollector, rate: Any = RATE) -> None:
    """
    Check that no two efforts in a row differ by more than the rate allows between their stamps.

    `rate` [N m/s] is one for all joints, or one per joint.

    Efforts under one stamp, as of a fault action, and after a stamp that went back, may differ by
    what is ever allowed at once.
    """
    for one, next_one in efforts.in_a_row():
        seconds = 1e-9 * (
            nanoseconds_of(next_one.header.stamp) - nanoseconds_of(one.header.stamp))
        step = np.abs(np.subtract(next_one.effort, one.effort))
        allowed = rate * (seconds if seconds > 0.0 else LONGEST_STEP)
        assert (step <= allowed + 1e-6).all(), (one, next_one)
