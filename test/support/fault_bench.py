# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A running `dynamics` node, a driver that streams joint states to it, and its subscribers.

The driver publishes from a thread, or from a separate process if a test stops or kills it. Tests
wait for faults on /diagnostics, where the node reports each fault immediately.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
import itertools
import math
import re
import threading
import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import numpy as np
import numpy.typing as npt
from robot_dynamics_interfaces.srv import InverseDynamics
from ros_harness import Collector, DYNAMICS, KEEP_MANY, NodeProcess, RosClient, TIMEOUT, wait_until
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NAMES = ['joint1', 'joint2']
Q, V = [np.pi / 4, np.pi / 6], [0.0, 0.0]
G = [-49.52282521, -11.37087883]
"""g(q) of the default arm at `Q` [N·m]."""

STEADY = {'state_timeout': 60.0, 'state_max_age': 9.0}
"""
Timeouts that a driver or node without processor time for seconds does not exceed.

A test of the fault `state_timeout` shortens the timeout after the last valid state, see
`FaultBench.wait_state_timeout`.
"""
STATE_TIMEOUT = 0.3
"""Shortened `state_timeout` [s]."""
QUICK = {**STEADY, 'hold_time': 0.3, 'ramp_time': 0.1}
"""A short fault action."""
NANOSECONDS = 1_000_000_000
LONGEST_STEP = 0.05
"""[s]: a command may differ from the last one by the rate limit times this time, at most."""
NOISE = 1e-14
"""[rad] of the measured positions: a joint whose sample repeats while it must move is a fault."""

Change = Callable[[JointState], JointState | None]


def stamp_of(nanoseconds: int) -> Time:
    """Return a time [ns] as a ROS message."""
    return Time(sec=nanoseconds // NANOSECONDS, nanosec=nanoseconds % NANOSECONDS)


def nanoseconds_of(stamp: Time) -> int:
    """Return the time of a ROS message [ns]."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def figure_of(status: DiagnosticStatus | None, key: str) -> int:
    """Return a figure of a status, 0 if the status does not contain it."""
    values = () if status is None else status.values
    return next((int(value.value) for value in values if value.key == key), 0)


class Driver:
    """Streams joint states of an arm at rest with current stamps, like the driver of a robot."""

    def __init__(
        self, client: RosClient, topic: str, names: Sequence[str] = NAMES,
        q: Sequence[float] = Q, v: Sequence[float] = V, rate: float = 200.0, qos: Any = 1,
    ) -> None:
        self._node = client.node
        self.publisher = client.publisher(JointState, topic, qos)
        self.names, self.q, self.v, self.period = list(names), list(q), list(v), 1.0 / rate
        self.change: Change = lambda message: message
        """Applied to each message before it is published; None suppresses the message."""
        self.sent = 0
        self._quiet, self._ends = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def message(self) -> JointState:
        """Return the current state; the sample of a joint in use does not repeat bit by bit."""
        noise = NOISE * (self.sent % 2)
        message = JointState(
            name=self.names, position=[q + noise for q in self.q], velocity=self.v)
        message.header.stamp = stamp_of(time.time_ns())
        return message

    def start(self) -> 'Driver':
        """Start streaming."""
        self._thread.start()
        return self

    def be_quiet(self) -> None:
        """Pause the stream."""
        self._quiet.set()

    def go_on(self) -> None:
        """Publish valid states."""
        self.change = lambda message: message
        self._quiet.clear()

    def stream_changed(self, change: Change) -> None:
        """Publish states with this change."""
        self.change = change
        self._quiet.clear()

    def close(self) -> None:
        """Stop the thread and destroy the publisher."""
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

    The time of arrival is of a steady clock. The time of publication is of the computer clock, as
    the middleware records it, so that a slow test does not make a node look slow. A topic with
    depth 1 loses messages if the test is slower than the node; `in_a_row` leaves out the pairs
    between which a message was lost.
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
        """Discard the messages received so far."""
        with self._news:
            self._messages.clear()
            self.times.clear()
            self._published.clear()
            self._numbers.clear()

    def published(self) -> list[tuple[float, Any]]:
        """Return the messages, each with its time of publication [s]."""
        with self._news:
            return [(1e-9 * t, m) for t, m in zip(self._published, self._messages)]

    def in_a_row(self) -> list[tuple[Any, Any]]:
        """Return the pairs of messages that were published consecutively."""
        with self._news:
            numbered = list(zip(self._numbers, self._messages))
        pairs = [(one, other) for (i, one), (j, other) in itertools.pairwise(numbered)
                 if j == i + 1]
        assert pairs, f'no two of {len(numbered)} messages in a row'
        return pairs

    def steps(self) -> npt.NDArray[np.float64]:
        """Return the change of the effort of each joint between consecutive messages."""
        return np.abs([np.subtract(other.effort, one.effort) for one, other in self.in_a_row()])

    def check_steps(self, rate: float | npt.NDArray[np.float64]) -> None:
        """Check that no command differs from the previous one by more than a limiter permits."""
        assert (self.steps() <= rate * LONGEST_STEP + 1e-6).all()

    def since(self, moment: float) -> list[tuple[float, Any]]:
        """Return the messages that arrived after a time [s], with their times."""
        with self._news:
            return [(t, m) for t, m in zip(self.times, self._messages) if t > moment]


class FaultBench:
    """A `dynamics` node with real safety options, and the tools of a fault test."""

    def __init__(
        self, client: RosClient, node: NodeProcess, namespace: str,
        driver_type: type = Driver, diagnostics: str = '/diagnostics', **driver: Any,
    ) -> None:
        """`diagnostics` is the topic of the reports; by default that of all nodes of this name."""
        self.client, self.node, self.namespace = client, node, namespace
        self.hold: Sequence[float] = G
        """g(q) at the position that the driver publishes."""
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

    def ask(self, service: str, kind: Any, **fields: Any) -> Any:
        """Return the response of a service below `~`."""
        return self.client.call(kind, self.name(service), kind.Request(**fields))

    def change(self, transition: int = 0, label: str = '') -> bool:
        """Request a transition of the lifecycle; return whether it succeeded."""
        return bool(self.ask('change_state', ChangeState, transition=Transition(
            id=transition, label=label)).success)

    def peak_memory(self) -> int:
        """Return the peak memory of the node so far [bytes]."""
        with open(f'/proc/{self.node.pid}/status', encoding='ascii') as status:
            return 1024 * next(int(line.split()[1]) for line in status if line.startswith('VmHWM'))

    # ------------------------------------------------------------------ diagnostics

    def status(self, check: str) -> DiagnosticStatus | None:
        """Return the newest status of a check, None before the first one."""
        for message in reversed(self._diagnostics.messages):
            for status in self._statuses(message, check):
                return status
        return None

    def _statuses(self, message: DiagnosticArray, check: str) -> list[DiagnosticStatus]:
        """Return the statuses of a check; other nodes may report on the same topic."""
        return [status for status in message.status
                if status.name == f'{self.namespace}/dynamics: {check}']

    def wait_status(
        self, check: str, predicate: Callable[[DiagnosticStatus], bool],
    ) -> DiagnosticStatus:
        """Return the first status of a check, starting with the newest, that fulfils this."""
        newest = self.status(check)
        if newest is not None and predicate(newest):
            return newest
        self._diagnostics.clear()
        found: list[DiagnosticStatus] = []

        def look(message: Any) -> bool:
            found[:] = filter(predicate, self._statuses(message, check))
            return bool(found)

        self._diagnostics.wait_for(look)
        return found[0]

    def figure(self, check: str, key: str) -> int:
        """Return a figure of a check in the next report; 0 if the report does not contain it."""
        return figure_of(self.next_status(check), key)

    def known(self, check: str, key: str) -> int:
        """Return a figure of a check in the newest report."""
        return figure_of(self.status(check), key)

    def wait_message(self, check: str, pattern: str) -> DiagnosticStatus:
        """Wait until the whole message of a check matches a pattern; return the status."""
        return self.wait_status(
            check, lambda status: re.fullmatch(pattern, status.message) is not None)

    def wait_figure(self, check: str, key: str, least: int) -> DiagnosticStatus:
        """Wait until a figure of a check is at least this number; return the status."""
        return self.wait_status(check, lambda status: figure_of(status, key) >= least)

    def next_status(self, check: str) -> DiagnosticStatus:
        """Return the status of a check in the next report."""
        self._diagnostics.clear()
        return self.wait_status(check, lambda _: True)

    def wait_fault(self, name: str) -> DiagnosticStatus:
        """Wait until the node reports this fault."""
        return self.wait_status(
            'command', lambda status: status.level == DiagnosticStatus.ERROR
            and status.message.startswith(f'fault {name}'))

    def set_parameters(self, **values: Any) -> None:
        """Set parameters of the node."""
        node = f'{self.namespace}/dynamics'
        for result in self.client.set_parameters(node, values):
            assert result.successful, result.reason

    @contextmanager
    def temporarily(self, before: Mapping[str, Any], **values: Any) -> Iterator[None]:
        """Set parameters to `values`, and to `before` at the end."""
        self.set_parameters(**values)
        try:
            yield
        finally:
            self.set_parameters(**before)

    def short_timeout(self) -> AbstractContextManager[None]:
        """Set `state_timeout` to `STATE_TIMEOUT`."""
        return self.temporarily(
            {'state_timeout': STEADY['state_timeout']}, state_timeout=STATE_TIMEOUT)

    def wait_state_timeout(self) -> DiagnosticStatus:
        """Wait for the fault `state_timeout`, after the last valid state of the driver."""
        with self.short_timeout():
            return self.wait_fault('state_timeout')

    def wait_running(self) -> None:
        """Wait until commands answer states that are published from now on."""
        moment = time.monotonic()
        self.wait_status('command', lambda status: status.level != DiagnosticStatus.ERROR)
        wait_until(lambda: bool(self.efforts.since(moment)), 'an effort')

    def first_answer(self, act: Callable[[], object]) -> Any:
        """Act; return the first command that answers a state of a later time."""
        moment = time.time_ns()
        act()
        return self.efforts.wait_for(lambda m: nanoseconds_of(m.header.stamp) >= moment)

    def wait_dropped(self, reason: str, more_than: int = 0) -> DiagnosticStatus:
        """Wait until more than this number of states were dropped for a reason."""
        return self.wait_figure('joint states', f'dropped: {reason}', more_than + 1)

    def wait_silent(self) -> None:
        """Wait until the command has ended: zeros, then no message."""
        self.efforts.wait_for(lambda message: not any(message.effort))

    # ------------------------------------------------------------------ checks

    def check_efforts(self) -> None:
        """Check that every command is finite and contains all joints."""
        for message in self.efforts.messages:
            assert list(message.name) == self.driver.names
            assert len(message.effort) == len(self.driver.names)
            assert all(map(math.isfinite, message.effort)), message

    def check_hold(self, count: int = 0) -> None:
        """Check that the commands since the last `clear`, at least this number, are g(q)."""
        for message in self.efforts.wait_count(count):
            np.testing.assert_allclose(message.effort, self.hold, rtol=0.0, atol=1e-6)

    def check_answers(self) -> None:
        """Check that a service answers with g(q)."""
        response = self.ask('inverse_dynamics', InverseDynamics, position=Q)
        np.testing.assert_allclose(response.effort, self.hold, rtol=0.0, atol=5e-9)

    def check_alive(self) -> None:
        """Check that the node runs, commands g(q), and logged no exception."""
        self.check_commanding()
        assert 'Traceback' not in self.node.log, self.node.log
        assert 'internal error' not in self.node.log, self.node.log

    def check_commanding(self) -> None:
        """Check that the node resumes automatically and commands g(q)."""
        self.driver.go_on()
        self.wait_running()
        self.wait_steady(self.hold)
        self.check_efforts()

    def wait_steady(self, effort: Sequence[float], count: int = 5) -> None:
        """Wait for consecutive commands with this value; a single one may be on a ramp."""
        self.efforts.clear()
        in_a_row = 0

        def is_steady(message: Any) -> bool:
            nonlocal in_a_row
            in_a_row = in_a_row + 1 if np.allclose(message.effort, effort, atol=1e-5) else 0
            return in_a_row == count

        self.efforts.wait_for(is_steady)

    # ------------------------------------------------------------------ messages

    def set_point(self, q: Sequence[float], **more: Any) -> None:
        """Publish one set-point."""
        self.trajectories.publish(JointTrajectory(
            joint_names=self.driver.names,
            points=[JointTrajectoryPoint(positions=list(q), **more)]))

    def stop_listening(self) -> None:
        """Stop recording commands."""
        self.efforts.close()
        self._listens = False

    def close(self) -> None:
        """Stop the driver and destroy the subscriptions."""
        self.driver.close()
        if self._listens:
            self.efforts.close()
        self._diagnostics.close()
        self.client.node.destroy_publisher(self.trajectories)


@contextmanager
def fault_bench(
    client: RosClient, namespace: str, parameters: Mapping[str, Any] | None = None,
    stream: bool = True, started: Mapping[str, Any] | None = None, **driver: Any,
) -> Iterator[FaultBench]:
    """
    Run a `dynamics` node with real safety options, and a driver that streams if `stream`.

    `started` are further arguments of `NodeProcess`.
    """
    with NodeProcess(
            DYNAMICS, {**QUICK, **(parameters or {})}, namespace=namespace,
            **(started or {})) as node:
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
