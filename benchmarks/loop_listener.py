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
What a closed loop of `simulated_arm` and `dynamics` did, heard from outside with little cost.

When a message was published stands in its source timestamp, written by its publisher. So the
listener need not wake up for a message: it leaves all in the queue of the middleware, takes them
ten times a second as bytes, and reads them when the run is over. It asks for no acknowledgements
(best effort).

A joint state carries the effort that acted since the state before, bit by bit as it was
commanded. That tells whether the effort for a state came to the arm within its period.
"""

import time
from typing import Any, NamedTuple

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.ros.cdr_templates import JointStateDecoder
from robot_dynamics.ros.rclpy_internals import LEFT_TO_A_THREAD
from sensor_msgs.msg import JointState

DEEP = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.BEST_EFFORT)
TAKE_PERIOD, NAP = 0.1, 0.005
"""[s]; a nap that ends late tells that the computer let nobody wake up in time just then."""


class Received(NamedTuple):
    """Stamps and times of publication [ns], (m,), and efforts (m, n), of m messages."""

    stamp: IntArray
    sent: IntArray
    effort: FloatArray


class Topic:
    """Keeps the bytes of each `sensor_msgs/JointState`, and when it was published."""

    def __init__(self, node: Node, name: str) -> None:
        self._node = node
        self._subscription = node.create_subscription(
            JointState, name, lambda _: None, DEEP, callback_group=LEFT_TO_A_THREAD, raw=True)
        self._messages: list[bytes] = []
        self._sent: list[int] = []

    def take(self) -> int:
        """Take what has arrived; return how many messages were heard so far."""
        while (taken := self._subscription.handle.take_message(JointState, True)) is not None:
            self._messages.append(taken[0])
            self._sent.append(taken[1]['source_timestamp'])
        return len(self._sent)

    def close(self) -> None:
        """Hear no more."""
        self._node.destroy_subscription(self._subscription)

    def newest_stamp(self) -> int:
        """Return the stamp [ns] of the newest message."""
        return JointStateDecoder().decode(self._messages[-1]).stamp_ns

    def newest_sent(self) -> int:
        """Return when [ns] the newest message was published."""
        return self._sent[-1]

    def received(self) -> Received:
        """Return what was heard so far."""
        decoder = JointStateDecoder()
        states = [decoder.decode(data) for data in self._messages]
        return Received(
            np.array([state.stamp_ns for state in states], dtype=np.int64),
            np.array(self._sent, dtype=np.int64), np.array([state.effort for state in states]))


class LoopListener:
    """Hears the joint states and the efforts of a closed loop."""

    def __init__(self, node: Node) -> None:
        self._states = Topic(node, 'joint_states')
        self._efforts = Topic(node, 'effort_command')
        self._clocks: list[tuple[int, int]] = []

    def listen(self, seconds: float) -> FloatArray:
        """Take what arrives for so long; return by how much [s] each of its naps ended late."""
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
        """Hear no more."""
        self._states.close()
        self._efforts.close()

    def connect(self, timeout: float) -> None:
        """Return once both topics are heard; raise TimeoutError."""
        deadline = time.monotonic() + timeout
        while not (self._states.take() and self._efforts.take()):
            if time.monotonic() > deadline:
                raise TimeoutError(f'no joint states and efforts in {timeout:g} s')
            self.listen(TAKE_PERIOD)

    def lag(self) -> float:
        """Return how much later [s] than it was due the newest joint state was published."""
        return 1e-9 * (self._states.newest_sent() - self._states.newest_stamp())

    def newest_stamp(self) -> int:
        """Return the stamp [ns] of the newest joint state."""
        return self._states.newest_stamp()

    def cycles(self, after: int, period: int, count: int) -> 'Cycles':
        """Return what became of the `count` cycles of `period` [ns] after a stamp [ns]."""
        clocks = np.array(self._clocks, dtype=np.int64)
        gained = np.diff(clocks - clocks[0], axis=1)[:, 0]  # steady clock, less that of the stamps

        def table(received: Received) -> tuple[FloatArray, FloatArray]:
            number = (received.stamp - after) // period - 1
            wanted = (number >= 0) & (number <= count)
            # The first of those with one stamp counts: later ones are repetitions.
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
    What became of the cycles of a time [s], each `period` [s] long by the wall clock.

    A cycle is missed where no joint state was published in it, or where the effort for its state
    was not published before the next state. An arm that was held up for ten periods misses ten;
    the states that it publishes quicker than usual to catch up are late, but miss nothing.

    An effort is behind where the next state tells that another effort acted until then: it was
    published before the next state, but came to the arm when the period was over already, and
    acts a period later.
    """

    def __init__(
        self, period: float, state_sent: FloatArray, acted: FloatArray, effort_sent: FloatArray,
        effort: FloatArray,
    ) -> None:
        """
        Take times [s] and efforts of one state more than there are cycles, NaN for none.

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
        """Return the share of cycles that were missed."""
        return self.missed / self.count


def _cycles_with(times: FloatArray, period: float, count: int) -> int:
    """Return in how many of the periods there is a time; usual ones are in their middle."""
    found = times[np.isfinite(times)]
    if not len(found):
        return 0
    usual = float(np.median(found % period))
    number = np.floor((found - usual) / period + 0.5)
    return len(np.unique(number[(number >= 1) & (number <= count)]))


def in_microseconds(times: FloatArray) -> str:
    """Return percentiles of times [s] in words, those that are NaN left out."""
    found: Any = 1e6 * times[np.isfinite(times)]
    if not len(found):
        return 'none'
    p50, p99 = np.percentile(found, [50, 99])
    return f'p50 {p50:6.0f} µs, p99 {p99:6.0f} µs, max {found.max():6.0f} µs'
