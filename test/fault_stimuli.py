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
import threading
import time
from typing import Any

from fault_bench import Change, Driver, FaultBench, NANOSECONDS, nanoseconds_of, stamp_of
import numpy as np
from robot_dynamics.effort_guard import LONGEST_STEP
from ros_harness import TIMEOUT, wait_until
from sensor_msgs.msg import JointState

RATE = 1000.0
"""The default of `effort_rate_limit` [N m/s]."""
PATIENT = {'state_timeout': 2.0, 'reference_timeout': 0.001}
"""For tests of other faults: no pause of the driver is a fault, no set-points are a stream."""


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


def wait_states(bench: FaultBench, count: int) -> None:
    """Wait until the driver has sent so many more states."""
    goal = bench.driver.sent + count
    wait_until(lambda: bench.driver.sent >= goal, f'{count} states sent')


@contextmanager
def another_driver(bench: FaultBench, **driver: Any) -> Iterator[Driver]:
    """Let a second driver stream to the same node."""
    other = Driver(bench.client, f'{bench.namespace}/joint_states', **driver)
    try:
        yield other.start()
    finally:
        other.close()


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


def check_rate(messages: Sequence[JointState], rate: float = RATE) -> None:
    """
    Check that no two efforts in a row differ by more than the rate allows between their stamps.

    Efforts under one stamp, as of a fault action, and after a stamp that went back, may differ by
    what is ever allowed at once.
    """
    for one, next_one in zip(messages, messages[1:]):
        seconds = 1e-9 * (
            nanoseconds_of(next_one.header.stamp) - nanoseconds_of(one.header.stamp))
        step = np.abs(np.subtract(next_one.effort, one.effort)).max()
        allowed = rate * (seconds if seconds > 0.0 else LONGEST_STEP)
        assert step <= allowed + 1e-6, (one, next_one)
