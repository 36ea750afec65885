# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Play recorded joint states to a node, each after the response to the state before."""

from collections.abc import Callable
import time
from typing import NamedTuple

from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.recordings.reader import JointSeries
from robot_dynamics.ros.middleware.conversions import floats_to_ros, stamp_to_ros
from robot_dynamics.ros.middleware.recorder import Recorder
from sensor_msgs.msg import JointState

RESEND_PERIOD = 0.5
"""[s] after which a state is retransmitted: subscriptions to joint states are best effort."""
TIMEOUT = 10.0
"""Longest wait [s] for a response."""


class PlaybackResult(NamedTuple):
    """Number of played states, number of retransmissions, and duration [s]."""

    played: int
    resent: int
    seconds: float


class Playback:
    """Publishes the samples of a series as a robot does, with their recorded stamps."""

    def __init__(
        self, node: Node, recorder: Recorder, topic: str, answer_topic: str,
        series: JointSeries,
    ) -> None:
        """Take a recorder of `answer_topic`, whose stamps are those of the answered states."""
        self._recorder, self._answers = recorder, answer_topic
        self._series = series
        self._publisher = node.create_publisher(JointState, topic, QoSProfile(depth=1))

    @property
    def found(self) -> bool:
        """Whether there is a subscriber in addition to the recorder."""
        return bool(self._publisher.get_subscription_count() >= 2)

    def play(
        self, rate: float | None, on_progress: Callable[[int], None],
        check: Callable[[], None],
    ) -> PlaybackResult:
        """
        Play all samples, at most at `rate` [Hz] (None: as fast as the node responds).

        `on_progress` receives the number of played samples; `check` is called during the wait for
        a response, and may raise. Raises RecordingError if a state gets no response.
        """
        start, resent = time.monotonic(), 0
        for i in range(len(self._series.stamps_ns)):
            if rate is not None:
                self._record_until(start + i / rate)
            resent += self._ask(i, check)
            on_progress(i + 1)
        return PlaybackResult(len(self._series.stamps_ns), resent, time.monotonic() - start)

    def _record_until(self, deadline: float) -> None:
        while (remaining := deadline - time.monotonic()) > 0.0:
            self._recorder.wait(self._answers, remaining)
            self._recorder.drain()

    def _ask(self, i: int, check: Callable[[], None]) -> int:
        """Publish a state until it is answered; return the number of retransmissions."""
        stamp = int(self._series.stamps_ns[i])
        state, count = self._message(i), self._recorder.counts[self._answers]
        give_up = time.monotonic() + TIMEOUT
        said = 0
        while time.monotonic() < give_up:
            self._publisher.publish(state)
            said += 1
            again = time.monotonic() + RESEND_PERIOD
            while (remaining := again - time.monotonic()) > 0.0:
                self._recorder.wait(self._answers, remaining)
                self._recorder.drain()
                if count.stamp_ns == stamp:
                    return said - 1
            check()
        raise RecordingError(
            f'the state of stamp {stamp} ns got no answer on {self._answers} in {TIMEOUT:g} s')

    def _message(self, i: int) -> JointState:
        series = self._series
        message = JointState(name=list(series.joint_names))
        message.header.stamp = stamp_to_ros(int(series.stamps_ns[i]))
        for field in ('position', 'velocity', 'effort'):
            values = getattr(series, field)
            if values is not None:
                setattr(message, field, floats_to_ros(values[i]))
        return message
