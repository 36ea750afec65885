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
A running `dynamics` node, a driver that streams joint states to it, and ears for what it says.

The driver publishes from a thread, or from a process of its own where that is to be stopped or
killed. Faults are waited for on /diagnostics, where each is told at once.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import itertools
import math
import threading
import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import numpy as np
import numpy.typing as npt
from ros_harness import (
    Collector,
    DYNAMICS,
    KEEP_MANY,
    NodeProcess,
    RosClient,
    TIMEOUT,
    wait_until,
)
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NAMES = ['joint1', 'joint2']
Q, V = [np.pi / 4, np.pi / 6], [0.0, 0.0]
G = [-49.52282521, -11.37087883]
"""g(q) at `Q` [N m]: what holds the default arm."""

STEADY = {'state_timeout': 60.0, 'state_max_age': 9.0}
"""
With these, a driver or a node that gets no processor for seconds causes no fault.

A test that needs the fault `state_timeout` makes the timeout short once valid states have ended:
`FaultBench.wait_state_timeout`.
"""
STATE_TIMEOUT = 0.3
"""[s], the short one."""
QUICK = {**STEADY, 'hold_time': 0.3, 'ramp_time': 0.1}
"""A fault action that is soon over."""
NANOSECONDS = 1_000_000_000

Change = Callable[[JointState], JointState | None]


def stamp_of(nanoseconds: int) -> Time:
    """Return a time as ROS has it."""
    return Time(sec=nanoseconds // NANOSECONDS, nanosec=nanoseconds % NANOSECONDS)


def nanoseconds_of(stamp: Time) -> int:
    """Return a time of ROS in [ns]."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def figure_of(status: DiagnosticStatus | None, key: str) -> int:
    """Return a figure of a status, 0 where it is not named."""
    values = () if status is None else status.values
    return next((int(value.value) for value in values if value.key == key), 0)


class Driver:
    """Streams joint states of an arm at rest with stamps of now, as a robot's driver does."""

    def __init__(
        self, client: RosClient, topic: str, names: Sequence[str] = NAMES,
        q: Sequence[float] = Q, v: Sequence[float] = V, rate: float = 200.0, qos: Any = 1,
    ) -> None:
        self._node = client.node
        self.publisher = client.publisher(JointState, topic, qos)
        self.names, self.q, self.v, self.period = list(names), list(q), list(v), 1.0 / rate
        self.change: Change = lambda message: message
        """Applied to each message before it goes out; None sends nothing."""
        self.sent = 0
        self._quiet, self._ends = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def message(self) -> JointState:
        """Return the state as it is now."""
        message = JointState(name=self.names, position=self.q, velocity=self.v)
        message.header.stamp = stamp_of(time.time_ns())
        return message

    def start(self) -> 'Driver':
        """Begin to stream."""
        self._thread.start()
        return self

    def be_quiet(self) -> None:
        """Send nothing for now."""
        self._quiet.set()

    def go_on(self) -> None:
        """Send states as they should be."""
        self.change = lambda message: message
        self._quiet.clear()

    def stream_changed(self, change: Change) -> None:
        """Send states with this change."""
        self.change = change
        self._quiet.clear()

    def close(self) -> None:
        """End the thread and the topic."""
        self._ends.set()
        self._thread.join(TIMEOUT)
        self._node.destroy_publisher(self.publisher)

    def _run(self) -> None:
        while not self._ends.wait(self.period):
            message = None if self._quiet.is_set() else self.change(self.message())
            if message is not None:
                self.publisher.publish(message)
                self.sent += 1


class TimedCollector(Collector):
    """
    Keeps the messages of a topic together with times.

    These are of a steady clock at their arrival, and of the clock of this computer when they were
    published, as the middleware notes it: so a slow test does not make a node look slow. A topic
    that keeps the newest message only loses others where the test is slower than the node;
    `in_a_row` leaves out the pairs between which a message was lost.
    """

    def __init__(self, *args: Any) -> None:
        self.times: list[float] = []
        self._published: list[int] = []
        self._numbers: list[int] = []
        super().__init__(*args)

    def _keep(self, message: Any, info: Mapping[str, int]) -> None:
        with self._news:
            self.times.append(time.monotonic())
            self._published.append(info['source_timestamp'])
            self._numbers.append(info['publication_sequence_number'])
            self._messages.append(message)
            self._news.notify_all()

    def clear(self) -> None:
        """Forget what has arrived."""
        with self._news:
            self._messages.clear()
            self.times.clear()
            self._published.clear()
            self._numbers.clear()

    def published(self) -> list[tuple[float, Any]]:
        """Return what has arrived, each with the time [s] when it was published."""
        with self._news:
            return [(1e-9 * t, m) for t, m in zip(self._published, self._messages)]

    def in_a_row(self) -> list[tuple[Any, Any]]:
        """Return the pairs of messages that were published one directly after the other."""
        with self._news:
            numbered = list(zip(self._numbers, self._messages))
        pairs = [(one, other) for (i, one), (j, other) in itertools.pairwise(numbered)
                 if j == i + 1]
        assert pairs, f'no two of {len(numbered)} messages in a row'
        return pairs

    def steps(self) -> npt.NDArray[np.float64]:
        """Return by how much the effort of each joint changed between messages in a row."""
        return np.abs([np.subtract(other.effort, one.effort) for one, other in self.in_a_row()])

    def since(self, moment: float) -> list[tuple[float, Any]]:
        """Return what arrived after a moment, with the times."""
        with self._news:
            return [(t, m) for t, m in zip(self.times, self._messages) if t > moment]


class FaultBench:
    """A `dynamics` node with real safety, and all that a test of faults needs beside it."""

    def __init__(
        self, client: RosClient, node: NodeProcess, namespace: str,
        driver_type: type = Driver, diagnostics: str = '/diagnostics', **driver: Any,
    ) -> None:
        """`diagnostics` is where the node tells of itself; all nodes of this name, by default."""
        self.client, self.node, self.namespace = client, node, namespace
        self.hold: Sequence[float] = G
        """The command that holds the arm where the driver says it is."""
        self.driver = driver_type(client, f'{namespace}/joint_states', **driver)
        self.efforts = TimedCollector(
            client.node, JointState, f'{namespace}/effort_command', KEEP_MANY)
        self.efforts.wait_matched()
        self._listens = True
        self._diagnostics = client.collect(DiagnosticArray, diagnostics)
        self._diagnostics.wait_matched()
        self.trajectories = client.publisher(
            JointTrajectory, f'{namespace}/dynamics/joint_trajectory')

    def name(self, name: str) -> str:
        """Return the full name of a topic or service of the node."""
        return f'{self.namespace}/dynamics/{name}'

    # ------------------------------------------------------------------ what it says

    def status(self, check: str) -> DiagnosticStatus | None:
        """Return the newest status of a check, None where there is none yet."""
        for message in reversed(self._diagnostics.messages):
            for status in self._statuses(message, check):
                return status
        return None

    def _statuses(self, message: DiagnosticArray, check: str) -> list[DiagnosticStatus]:
        """Return the statuses of a check; other nodes may report on the same topic."""
        return [status for status in message.status
                if status.name == f'{self.namespace}/dynamics: {check}']

    def wait_status(
        self, check: str, predicate: Callable[[DiagnosticStatus], bool], timeout: float = TIMEOUT,
    ) -> DiagnosticStatus:
        """Return the first status of a check, from the newest one on, that fulfils this."""
        newest = self.status(check)
        if newest is not None and predicate(newest):
            return newest
        self._diagnostics.clear()
        found: list[DiagnosticStatus] = []

        def look(message: Any) -> bool:
            found[:] = filter(predicate, self._statuses(message, check))
            return bool(found)

        self._diagnostics.wait_for(look, timeout)
        return found[0]

    def figure(self, check: str, key: str) -> int:
        """Return a figure of a check in the next report; 0 where it is not named."""
        return figure_of(self.next_status(check), key)

    def known(self, check: str, key: str) -> int:
        """Return a figure of a check in the newest report that has arrived."""
        return figure_of(self.status(check), key)

    def next_status(self, check: str) -> DiagnosticStatus:
        """Return the status of a check in the next report."""
        self._diagnostics.clear()
        return self.wait_status(check, lambda _: True)

    def wait_fault(self, name: str) -> DiagnosticStatus:
        """Wait until the command is in this fault."""
        return self.wait_status(
            'command', lambda status: status.level == DiagnosticStatus.ERROR
            and status.message.startswith(f'fault {name}'))

    def set_parameters(self, **values: Any) -> None:
        """Set parameters of the node."""
        node = f'{self.namespace}/dynamics'
        for result in self.client.set_parameters(node, values):
            assert result.successful, result.reason

    @contextmanager
    def short_timeout(self) -> Iterator[None]:
        """Let the node wait for joint states no longer than `STATE_TIMEOUT`."""
        self.set_parameters(state_timeout=STATE_TIMEOUT)
        try:
            yield
        finally:
            self.set_parameters(state_timeout=STEADY['state_timeout'])

    def wait_state_timeout(self) -> DiagnosticStatus:
        """Wait for the fault `state_timeout`; the driver sends no valid state any more."""
        with self.short_timeout():
            return self.wait_fault('state_timeout')

    def wait_running(self) -> None:
        """Wait until efforts answer states, not before what is published now."""
        moment = time.monotonic()
        self.wait_status('command', lambda status: status.level != DiagnosticStatus.ERROR)
        wait_until(lambda: bool(self.efforts.since(moment)), 'an effort')

    def wait_dropped(self, reason: str, more_than: int = 0) -> DiagnosticStatus:
        """Wait until more states than so many were dropped for a reason."""
        return self.wait_status(
            'joint states', lambda status: figure_of(status, f'dropped: {reason}') > more_than)

    def wait_silent(self) -> None:
        """Wait until the command has ended: zero efforts, then none."""
        self.efforts.wait_for(lambda message: not any(message.effort))

    # ------------------------------------------------------------------ what must hold always

    def check_efforts(self) -> None:
        """Check that every effort is finite, and for all joints."""
        for message in self.efforts.messages:
            assert list(message.name) == self.driver.names
            assert len(message.effort) == len(self.driver.names)
            assert all(map(math.isfinite, message.effort)), message

    def check_alive(self) -> None:
        """Check that the node runs, commands what holds the arm, and has raised nothing."""
        self.check_commanding()
        assert 'Traceback' not in self.node.log, self.node.log
        assert 'internal error' not in self.node.log, self.node.log

    def check_commanding(self) -> None:
        """Check that the node commands what holds the arm, of itself."""
        self.driver.go_on()
        self.wait_running()
        self.wait_steady(self.hold)
        self.check_efforts()

    def wait_steady(self, effort: Sequence[float], count: int = 5) -> None:
        """Wait until so many efforts in a row are this one: one alone may be on the way past."""
        self.efforts.clear()
        in_a_row = 0

        def is_steady(message: Any) -> bool:
            nonlocal in_a_row
            in_a_row = in_a_row + 1 if np.allclose(message.effort, effort, atol=1e-5) else 0
            return in_a_row == count

        self.efforts.wait_for(is_steady)

    # ------------------------------------------------------------------ what to send

    def set_point(self, q: Sequence[float], **more: Any) -> None:
        """Send one set-point."""
        self.trajectories.publish(JointTrajectory(
            joint_names=self.driver.names,
            points=[JointTrajectoryPoint(positions=list(q), **more)]))

    def stop_listening(self) -> None:
        """Keep no efforts any more."""
        self.efforts.close()
        self._listens = False

    def close(self) -> None:
        """Stop the driver and forget the topics."""
        self.driver.close()
        if self._listens:
            self.efforts.close()
        self._diagnostics.close()
        self.client.node.destroy_publisher(self.trajectories)


@contextmanager
def fault_bench(
    client: RosClient, namespace: str, parameters: Mapping[str, Any] | None = None,
    stream: bool = True, **driver: Any,
) -> Iterator[FaultBench]:
    """Run a `dynamics` node with real safety, and a driver that streams where `stream`."""
    with NodeProcess(
            DYNAMICS, {**QUICK, **(parameters or {})}, namespace=namespace,
            patient=False) as node:
        bench = FaultBench(client, node, namespace, **driver)
        try:
            if not stream:
                bench.driver.be_quiet()
            bench.driver.start()
            if stream:
                bench.wait_running()
            yield bench
        finally:
            bench.close()
