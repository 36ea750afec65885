# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Record topics as serialized bytes, without deserialization.

Only the bytes of the stamp at the beginning of a message are decoded, because decoding a whole
message costs many times as much, and the recorder shares the processor with the nodes.

The recorder has no thread and no executor: its owner drains it often enough, or waits for one
topic. A drain takes all waiting messages, which costs far less than one wake-up per message.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from robot_dynamics.arrays import NANOSECONDS_PER_SECOND
from robot_dynamics.ros.middleware.rclpy_internals import message_inbox
from robot_dynamics_tools.recordings.interrupts import uninterrupted
from robot_dynamics_tools.recordings.topics import common_types, TopicQos
from robot_dynamics_tools.recordings.writer import RecordingWriter
from std_msgs.msg import String

RECEIVE_DEPTH = 2000
"""Queue length of one topic until a drain: seconds at the rate of a control loop."""
_STAMP_END = 12
"""Size [bytes] of the encapsulation and of the stamp at the beginning of a header."""


@dataclass(frozen=True)
class TopicSpec:
    """
    A topic to record, with the QoS that its publisher offers.

    `stamped`: its header has the stamp of the joint state to which the message belongs.
    """

    name: str
    message_type: type
    stamped: bool = False
    qos: TopicQos = TopicQos()  # noqa: RUF009 (a NamedTuple does not change)

    @property
    def type_name(self) -> str:
        """The type as 'sensor_msgs/msg/JointState'."""
        package, kind, *_ = self.message_type.__module__.split('.')
        return f'{package}/{kind}/{self.message_type.__name__}'


@dataclass
class TopicCount:
    """
    Counters of a topic.

    Numbers of received, recorded and lost messages, the newest stamp [ns], or -1, and the last
    sequence number of the only publisher.
    """

    received: int = 0
    recorded: int = 0
    lost: int = 0
    stamp_ns: int = -1
    sequence: int | None = None


class Recorder:
    """Writes the messages of some topics to a recording; not thread-safe."""

    def __init__(
        self, node: Node, writer: RecordingWriter, topics: Sequence[TopicSpec],
        time_ns: Callable[[], int] | None = None,
    ) -> None:
        """
        Subscribe to `topics`; the caller closes the writer.

        Messages are recorded with their time of arrival. With `time_ns`, which returns the time
        of a playback, they are recorded with this time, and stamped messages with their stamp.
        Raises RecordingError if the writer has no definition of a type.
        """
        self._writer, self._time_ns = writer, time_ns
        self.span_ns: tuple[float, float] = (-math.inf, math.inf)
        """First and last stamp [ns] of the stamped messages to record; others are discarded."""
        self._inboxes = {spec.name: (spec.stamped, _inbox(node, spec)) for spec in topics}
        self.counts = {spec.name: TopicCount() for spec in topics}
        for spec in topics:
            writer.add_topic(spec.name, spec.type_name, spec.qos)

    def drain(self) -> None:
        """Record all waiting messages, without an interrupt in between."""
        with uninterrupted():
            for name, (stamped, inbox) in self._inboxes.items():
                self._drain(name, stamped, inbox)

    def wait(self, topic: str, seconds: float) -> None:
        """Wait at most so long until a message of this topic can be drained."""
        self._inboxes[topic][1].wait(max(0, round(seconds * NANOSECONDS_PER_SECOND)))

    def close(self) -> None:
        """Record the waiting messages, and end the subscriptions."""
        self.drain()
        for _, inbox in self._inboxes.values():
            inbox.close()
        self._inboxes.clear()

    def _drain(self, name: str, stamped: bool, inbox: Any) -> None:
        count, (first, last) = self.counts[name], self.span_ns
        while (taken := inbox.take()) is not None:
            data, info = taken
            stamp = _first_stamp_ns(data) if stamped else 0
            count.received += 1
            lost = _lost_before(count, info)
            if stamped:  # the first stamp of a simulation is 0
                if first <= count.stamp_ns <= last < stamp:
                    count.lost += lost  # at the end of the span
                count.stamp_ns = stamp
                if not first <= stamp <= last:
                    continue
            count.recorded += 1
            count.lost += lost
            self._writer.write(name, stamp or self._time_ns() if self._time_ns else int(
                info['received_timestamp']), data)


def _inbox(node: Node, spec: TopicSpec) -> Any:
    """Return the inbox of a subscription with the QoS of the publisher."""
    return message_inbox(node, spec.message_type, spec.name, QoSProfile(
        depth=RECEIVE_DEPTH,
        reliability=(ReliabilityPolicy.RELIABLE if spec.qos.reliable
                     else ReliabilityPolicy.BEST_EFFORT),
        durability=(DurabilityPolicy.TRANSIENT_LOCAL if spec.qos.transient_local
                    else DurabilityPolicy.VOLATILE)))


def write_description(writer: RecordingWriter, topic: str, urdf: str, time_ns: int) -> None:
    """Write a URDF to a recording as a latched message of `topic`, under this time [ns]."""
    writer.add_topic(topic, 'std_msgs/msg/String', TopicQos(transient_local=True))
    writer.write(topic, time_ns, bytes(serialize_message(String(data=urdf))))


def _first_stamp_ns(data: bytes) -> int:
    """Return the stamp [ns] of a serialized message that begins with a header."""
    stamp = common_types().deserialize_cdr(data[:_STAMP_END], 'builtin_interfaces/msg/Time')
    return int(stamp.sec) * NANOSECONDS_PER_SECOND + int(stamp.nanosec)


def _lost_before(count: TopicCount, info: Any) -> int:
    """Return the number of lost messages of the only publisher before this message."""
    sequence = info['publication_sequence_number']
    if sequence is None:  # sequence numbers are optional in a middleware
        return 0
    last, count.sequence = count.sequence, sequence
    return 0 if last is None or sequence <= last else sequence - last - 1
