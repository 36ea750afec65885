# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Changes of the messages that fault tests publish, and checks of those that they receive."""

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
    LONGEST_STEP,
    NANOSECONDS,
    nanoseconds_of,
    Q,
    stamp_of,
    TimedCollector,
)
import numpy as np
from ros_harness import TIMEOUT, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

RATE = np.array([1500.0, 600.0])
"""`effort_rate_limit` of the default arm by default [N·m/s]: its effort limits in 0.1 s."""
UNFOLLOWED = {'following_error_limit': [0.0]}
"""With it the reference may leave an arm at rest until the command exceeds its limits."""
FOLLOWING = "following|'.*' rests .*"
"""Message of the status `reference` with a reference, of any arm."""
NO_STREAM = {'reference_timeout': 0.001}
"""For tests of other faults: set-points at this distance do not form a stream that times out."""


def altered(**fields: Any) -> Change:
    """Return a change that replaces fields of each state."""
    def change(message: JointState) -> JointState:
        for name, value in fields.items():
            setattr(message, name, value)
        return message

    return change


def shifted(seconds: float) -> Change:
    """Return a change that shifts the stamp of each state."""
    def change(message: JointState) -> JointState:
        message.header.stamp = stamp_of(
            nanoseconds_of(message.header.stamp) + round(NANOSECONDS * seconds))
        return message

    return change


def stamped(nanoseconds: int) -> Change:
    """Return a change that gives all states the same stamp."""
    return altered(header=Header(stamp=stamp_of(nanoseconds)))


class Swing:
    """Change the state of an arm to an oscillation; its velocities agree with its positions."""

    def __init__(
        self, center: Sequence[float], amplitude: Sequence[float], frequency: float,
    ) -> None:
        """`frequency` is in [rad/s]; the velocities are up to amplitude × frequency."""
        self._center = np.array(center)
        self._amplitude = np.where(np.equal(amplitude, 0.0), 1e-9, amplitude)  # no sample repeats
        self._frequency, self._begin = frequency, time.time_ns()

    def at(self, nanoseconds: int) -> tuple[np.ndarray, np.ndarray]:
        """Return position and velocity (n,) at a time [ns]."""
        phase = self._frequency * (nanoseconds - self._begin) / NANOSECONDS
        return (self._center + self._amplitude * np.sin(phase),
                self._frequency * self._amplitude * np.cos(phase))

    def __call__(self, message: JointState) -> JointState:
        q, v = self.at(nanoseconds_of(message.header.stamp))
        message.position, message.velocity = q.tolist(), v.tolist()
        return message


def follow(bench: FaultBench, q: Sequence[float]) -> None:
    """Make the node follow a set-point; the driver may report an arm that does not follow it."""
    bench.set_point(q)
    bench.wait_message('reference', FOLLOWING)


def move_by_hand(bench: FaultBench, q: Sequence[float]) -> None:
    """Make the driver report a smooth motion to q at up to 1.5 rad/s on average, and a rest."""
    begin, way = np.array(bench.driver.q), np.subtract(q, bench.driver.q)
    start, duration = time.time_ns(), max(float(np.abs(way).max()) / 1.5, 0.02)

    def moved(message: JointState) -> JointState:
        t = min(max(1e-9 * (nanoseconds_of(message.header.stamp) - start) / duration, 0.0), 1.0)
        message.position = (begin + (10.0 - 15.0 * t + 6.0 * t**2) * t**3 * way).tolist()
        message.velocity = (30.0 * t**2 * (1.0 - t)**2 / duration * way).tolist()
        return message

    bench.driver.change = moved
    wait_until(lambda: time.time_ns() - start > 1e9 * duration, 'the motion')
    wait_states(bench, 2)
    bench.driver.q = list(q)
    bench.driver.change = lambda message: message
    wait_states(bench, 2)


def wait_effort(bench: FaultBench, effort: Any) -> None:
    """Wait until this command has been published."""
    bench.efforts.wait_for(lambda message: np.allclose(message.effort, effort, atol=1e-6))


class RunAway:
    """
    Change the state of an arm to one of which the first joint becomes faster, up to a speed.

    After a PERIOD it stops and begins again: a busy computer may miss the states of one rise.
    """

    ACCELERATION, FASTEST, PERIOD = 60.0, 18.0, 5.0
    """[rad/s²], [rad/s], where the limit is 10 rad/s, and [s]."""

    def __init__(self) -> None:
        self._begin_ns = self._last_ns = 0
        self._q = Q[0]
        self.v = 0.0
        """The present speed of the joint [rad/s]."""

    def __call__(self, message: JointState) -> JointState:
        stamp = nanoseconds_of(message.header.stamp)
        self._begin_ns = self._begin_ns or stamp
        t = 1e-9 * (stamp - self._begin_ns) % self.PERIOD
        v = min(self.ACCELERATION * min(t, self.PERIOD - t), self.FASTEST)
        self._q += 0.5 * (v + self.v) * 1e-9 * (stamp - (self._last_ns or stamp))
        self.v, self._last_ns = v, stamp
        message.position, message.velocity = [self._q, Q[1]], [v, 0.0]
        return message


def run_away(bench: FaultBench) -> None:
    """Cause the latched fault `wrong_drive`; the driver pauses while the joint is too fast."""
    away = RunAway()
    bench.driver.stream_changed(away)
    bench.wait_fault('wrong_drive')
    wait_until(lambda: away.v == away.FASTEST, 'a joint that is too fast')
    bench.driver.be_quiet()
    bench.driver.change = lambda message: message


def from_now(bench: FaultBench) -> int:
    """Return a time [ns]; later stamps are of states with the driver's current change."""
    wait_states(bench, 2)
    return time.time_ns()


def wait_states(bench: FaultBench, count: int) -> None:
    """Wait until the driver has published this number of further states."""
    goal = bench.driver.sent + count
    wait_until(lambda: bench.driver.sent >= goal, f'{count} states sent')


@contextmanager
def another_publisher(bench: FaultBench, change: Change, **driver: Any) -> Iterator[None]:
    """
    Run a second publisher with changed states, which alternates with the driver at random.

    Even a slow node that receives only some states receives those of both publishers.
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
    """A stream of set-points from a thread; its `with` statement ends it."""

    def __init__(self, bench: FaultBench, next_pose: Callable[[], Sequence[float]]) -> None:
        self._bench, self._next_pose = bench, next_pose
        self.sent, self.last = 0, 0.0
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _run(self) -> None:
        while not self._ends.wait(0.02):
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
    Check that consecutive commands respect the rate limit between their stamps.

    `rate` [N·m/s] is a number for all joints, or one per joint.

    Commands with the same stamp, such as those of a fault action, and commands after a stamp that
    went back may differ by the largest permitted step.
    """
    for one, next_one in efforts.in_a_row():
        seconds = 1e-9 * (nanoseconds_of(next_one.header.stamp) - nanoseconds_of(one.header.stamp))
        step = np.abs(np.subtract(next_one.effort, one.effort))
        allowed = rate * (seconds if seconds > 0.0 else LONGEST_STEP)
        assert (step <= allowed + 1e-6).all(), (one, next_one)
