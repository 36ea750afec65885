# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Faults of /clock, which a simulator or a recording publishes: it stops or jumps.

No protection of the arm uses /clock.
"""

from collections.abc import Iterator
from contextlib import contextmanager
import threading
import time
from typing import Any

from fault_bench import fault_bench, FaultBench, G, stamp_of
from fault_table import fault
from lifecycle_msgs.msg import Transition
import numpy as np
import pytest
from ros_harness import RosClient, TIMEOUT
from rosgraph_msgs.msg import Clock

GROUP = 'Clocks'
RATE = 200.0
"""`effort_rate_limit` of the node [N·m/s]: a step of the command would far exceed it."""
PARAMETERS = {
    'use_sim_time': True, 'gains.natural_frequency': [5.0], 'effort_rate_limit': RATE}
"""With gains that late states do not lower."""
JUMP = 50.0
"""Jump of /clock, forwards or backwards [s]."""


class SimulatedClock:
    """Publishes simulated time on /clock at 100 Hz; it runs as fast as real time."""

    def __init__(self, client: RosClient, origin: float) -> None:
        """Start at the time `origin` [s]."""
        self._node = client.node
        self._publisher = client.publisher(Clock, '/clock', subscribers=0)
        self._ahead = origin - time.monotonic()
        self._stopped: float | None = None
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def now(self) -> float:
        """Return the simulated time [s]."""
        return time.monotonic() + self._ahead if self._stopped is None else self._stopped

    def jump(self, seconds: float) -> None:
        """Shift the time forwards or backwards."""
        self._ahead += seconds

    @contextmanager
    def stopped(self) -> Iterator[None]:
        """Stop the time and the messages; continue from this time at the end."""
        self._stopped = self.now
        try:
            yield
        finally:
            self._ahead, self._stopped = self._stopped - time.monotonic(), None

    def close(self) -> None:
        """Stop the thread and destroy the publisher."""
        self._ends.set()
        self._thread.join(TIMEOUT)
        self._node.destroy_publisher(self._publisher)

    def _run(self) -> None:
        while not self._ends.wait(0.01):
            if self._stopped is None:
                self._publisher.publish(Clock(clock=stamp_of(round(1e9 * self.now))))


Bench = tuple[FaultBench, SimulatedClock]


@pytest.fixture(scope='module')
def bench(client: RosClient) -> Iterator[Bench]:
    """Return a node with `use_sim_time`, and /clock."""
    clock = SimulatedClock(client, origin=1000.0)
    try:
        with fault_bench(client, '/faults_clock', PARAMETERS) as one:
            yield one, clock
    finally:
        clock.close()


def follow(bench: FaultBench) -> np.ndarray:
    """Let the node follow a near pose; return the steady command for that pose."""
    bench.check_alive()
    bench.set_point([bench.driver.q[0] + 0.1, bench.driver.q[1]])
    bench.efforts.wait_for(lambda m: abs(m.effort[0] - G[0]) > 10.0)
    return steady_effort(bench)


def steady_effort(bench: FaultBench) -> np.ndarray:
    """Return the command after it has been constant for many states."""
    bench.efforts.clear()
    last: list[Any] = []

    def is_steady(message: Any) -> bool:
        last.append(np.array(message.effort))
        return len(last) > 20 and bool((np.ptp(last[-20:], axis=0) < 1e-6).all())

    return np.array(bench.efforts.wait_for(is_steady).effort)


@fault(GROUP, '/clock stops, or jumps forwards and back by 50 s; joint states keep stamps of the '
       'real time', 'commands, reference and diagnostics are not affected')
def test_stamps_that_do_not_follow(bench):
    one, clock = bench
    effort = follow(one)
    one.efforts.clear()

    def more_commands() -> None:
        one.next_status('command')
        one.efforts.wait_count(len(one.efforts.messages) + 100)

    with clock.stopped():
        more_commands()
    for seconds in (JUMP, -JUMP):
        clock.jump(seconds)
        more_commands()
    efforts = np.array([m.effort for m in one.efforts.messages])
    assert efforts == pytest.approx(np.tile(effort, (len(efforts), 1)), abs=1e-6)
    one.set_point(one.driver.q)
    one.check_alive()


@fault(GROUP, '/clock stops; then the driver stops publishing, and the node is deactivated',
       'fault action, ramps, diagnostics and recovery take their usual times')
def test_silence_and_deactivation_while_the_clock_stands(bench):
    one, clock = bench
    follow(one)
    with clock.stopped():
        one.efforts.clear()
        one.driver.be_quiet()
        one.wait_state_timeout()
        one.wait_silent()
        one.efforts.check_steps(RATE)
        one.next_status('command')
        one.check_alive()
        assert one.change(Transition.TRANSITION_DEACTIVATE)
        one.wait_message('command', 'inactive')
        one.efforts.check_steps(RATE)
        assert one.change(Transition.TRANSITION_ACTIVATE)
        one.check_alive()
