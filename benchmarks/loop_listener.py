# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Observation of a closed loop of `simulated_arm` and `dynamics` from outside, at little cost.

The publisher writes the time of publication into the source timestamp of a message. Therefore the
listener need not wake up for each message: it leaves messages in the queue of the middleware,
takes them ten times per second as bytes, and decodes them after the run. Its subscriptions request
no acknowledgements (best effort).

A joint state contains the effort that acted since the previous state, bit for bit as it was
commanded. By this effort the listener decides whether the effort for a state arrived at the arm
within its period.
"""

import time
from typing import Any, NamedTuple

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.ros.middleware.cdr_templates import JointStateDecoder
from robot_dynamics.ros.middleware.rclpy_internals import LEFT_TO_A_THREAD
from sensor_msgs.msg import JointState

DEEP = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.BEST_EFFORT)
TAKE_PERIOD, NAP = 0.1, 0.005
"""[s]; a nap that ends late shows that the computer could not wake up processes in time."""


class Received(NamedTuple):
    """Stamps and times of publication [ns], (m,), and efforts (m, n), of m messages."""

    stamp: IntArray
    sent: IntArray
    effort: FloatArray


class Topic:
    """Stores the bytes and the time of publication of each `sensor_msgs/JointState`."""

    def __init__(self, node: Node, name: str) -> None:
        self._node = node
        self._subscription = node.create_subscription(
            JointState, name, lambda _: None, DEEP, callback_group=LEFT_TO_A_THREAD, raw=True)
        self._messages: list[bytes] = []
        self._sent: list[int] = []

    def take(self) -> int:
        """Take the messages that have arrived; return how many were received so far."""
        while (taken := self._subscription.handle.take_message(JointState, True)) is not None:
            self._messages.append(taken[0])
            self._sent.append(taken[1]['source_timestamp'])
        return len(self._sent)

    def close(self) -> None:
        """Destroy the subscription."""
        self._node.destroy_subscription(self._subscription)

    def newest_stamp(self) -> int:
        """Return the stamp [ns] of the newest message."""
        return JointStateDecoder().decode(self._messages[-1]).stamp_ns

    def newest_sent(self) -> int:
        """Return when [ns] the newest message was published."""
        return self._sent[-1]

    def received(self) -> Received:
        """Return the messages received so far."""
        decoder = JointStateDecoder()
        states = [decoder.decode(data) for data in self._messages]
        return Received(
            np.array([state.stamp_ns for state in states], dtype=np.int64),
            np.array(self._sent, dtype=np.int64), np.array([state.effort for state in states]))


class LoopListener:
    """Receives the joint states and the efforts of a closed loop."""

    def __init__(self, node: Node) -> None:
        self._states = Topic(node, 'joint_states')
        self._efforts = Topic(node, 'effort_command')
        self._clocks: list[tuple[int, int]] = []

    def listen(self, seconds: float) -> FloatArray:
        """Take messages for `seconds`; return by how much [s] each nap ended late."""
        late = []
        now = time.monotonic()
        end, take_at = now + seconds, now + TAKE_PERIOD
        while now < end:
            due = min(now + NAP, end)
            time.sleep(due - now)
            now = time.monotonic()
            late.append(now - due)
            if now >= min(take_at, end):
                self._clocks.append((time.time_ns(), time.monotonic_ns()))
                self._states.take()
                self._efforts.take()
                now, take_at = time.monotonic(), now + TAKE_PERIOD
        return np.array(late)

    def close(self) -> None:
        """Destroy both subscriptions."""
        self._states.close()
        self._efforts.close()

    def connect(self, timeout: float) -> None:
        """Return once messages of both topics arrive; raise TimeoutError if they do not."""
        deadline = time.monotonic() + timeout
        while not (self._states.take() and self._efforts.take()):
            if time.monotonic() > deadline:
                raise TimeoutError(f'no joint states and efforts in {timeout:g} s')
            self.listen(TAKE_PERIOD)

    def lag(self) -> float:
        """Return by how much [s] the newest joint state was published after its due time."""
        return 1e-9 * (self._states.newest_sent() - self._states.newest_stamp())

    def newest_stamp(self) -> int:
        """Return the stamp [ns] of the newest joint state."""
        return self._states.newest_stamp()

    def cycles(self, after: int, period: int, count: int) -> 'Cycles':
        """Return the outcomes of the `count` cycles of `period` [ns] after a stamp [ns]."""
        clocks = np.array(self._clocks, dtype=np.int64)
        gained = np.diff(clocks - clocks[0], axis=1)[:, 0]  # steady clock, less that of the stamps

        def table(received: Received) -> tuple[FloatArray, FloatArray]:
            number = (received.stamp - after) // period - 1
            wanted = (number >= 0) & (number <= count)
            # Of several messages with one stamp the first counts: later ones are repetitions.
            number, order = np.unique(number[wanted], return_index=True)
            sent = np.full(count + 1, np.nan)
            effort = np.full((count + 1, received.effort.shape[1]), np.nan)
            times = received.sent[wanted][order]
            drift = np.interp(times - clocks[0, 0], clocks[:, 0] - clocks[0, 0], gained)
            sent[number] = 1e-9 * (times - after + drift)
            effort[number] = received.effort[wanted][order]
            return sent, effort

        return Cycles(
            1e-9 * period, *table(self._states.received()), *table(self._efforts.received()))


class Cycles:
    """
    Outcomes of the cycles of a run, each `period` [s] long by the wall clock.

    A cycle is missed if no joint state was published in it, or if the effort for its state was
    not published before the next state. An arm that was delayed by ten periods misses ten cycles;
    the states that it then publishes faster than usual to catch up are late, but not missed.

    An effort is behind if the next state contains another effort: the effort was published before
    the next state, but arrived at the arm after the end of the period, and acts a period later.
    """

    def __init__(
        self, period: float, state_sent: FloatArray, acted: FloatArray, effort_sent: FloatArray,
        effort: FloatArray,
    ) -> None:
        """
        Store times [s] and efforts of one state more than there are cycles; NaN if missing.

        State k is due k + 1 periods after time 0.
        """
        due = period * np.arange(1, len(state_sent) + 1)
        sent, answered = np.isfinite(state_sent[:-1]), np.isfinite(effort_sent[:-1])
        in_time = answered & ~(effort_sent[:-1] >= state_sent[1:])
        self.count = len(due) - 1
        self.states, self.answered = int(sent.sum()), int(answered.sum())
        self.paused = self.count - _cycles_with(state_sent, period, self.count)
        self.unanswered = int(np.sum(sent & ~in_time))
        self.missed = min(self.paused + self.unanswered, self.count)
        self.state_delay, self.latency = state_sent - due, effort_sent - due
        self.answer_time = effort_sent - state_sent
        self.jitter: FloatArray = np.abs(np.diff(effort_sent) - period)
        self.late_states = int(np.sum(self.state_delay > period))
        self.behind = int(np.sum(sent & in_time & np.any(acted[1:] != effort[:-1], axis=1)))

    @property
    def missed_fraction(self) -> float:
        """Return the fraction of missed cycles."""
        return self.missed / self.count


def _cycles_with(times: FloatArray, period: float, count: int) -> int:
    """Return how many periods contain a time; a regular time is in the middle of its period."""
    found = times[np.isfinite(times)]
    if not len(found):
        return 0
    usual = float(np.median(found % period))
    number = np.floor((found - usual) / period + 0.5)
    return len(np.unique(number[(number >= 1) & (number <= count)]))


def in_microseconds(times: FloatArray) -> str:
    """Return the percentiles of times [s] as text; times that are NaN are ignored."""
    found: Any = 1e6 * times[np.isfinite(times)]
    if not len(found):
        return 'none'
    p50, p99 = np.percentile(found, [50, 99])
    return f'p50 {p50:6.0f} µs, p99 {p99:6.0f} µs, max {found.max():6.0f} µs'
