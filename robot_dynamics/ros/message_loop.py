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
Hand each joint state to the control path with little delay.

rclpy's executors rebuild their wait set from every service, timer and subscription of the node
each time that anything arrives, and run one callback at a time, so that a long service call holds
up control. Here a thread of its own waits on a wait set with just the state subscription, as
rclpy.wait_for_message does. Where that is unwanted, `in_thread=False` leaves the subscription to
the node's executor.
"""

from collections.abc import Callable, Hashable, Iterator, Sequence
import threading
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.ros.message_bytes import UnreadableMessageError
from robot_dynamics.ros.rclpy_internals import message_inbox, MessageInbox, raw_take
from robot_dynamics.ros.spun_inbox import SpunInbox

TURN = 100_000_000
"""[ns] after which a wait looks whether the loop is to end."""
MOST_WAITING = 16
"""Messages of one topic that are taken together; the queue of the middleware is no longer."""
LOG_PERIOD = 5.0
"""[s] between warnings of one kind."""


def _one_source(message: Any) -> Hashable:
    return None


class MessageLoop:
    """
    A subscription whose callback runs in a thread of its own.

    Of several messages that wait, the newest one of each source is delivered.
    """

    def __init__(
        self, node: Node, message_type: type, topic: str, qos: QoSProfile,
        read: Callable[[bytes], Any], callback: Callable[[Any], None],
        refuse: Callable[[UnreadableMessageError], None], in_thread: bool = True,
        source: Callable[[Any], Hashable] = _one_source,
    ) -> None:
        """
        Subscribe; `callback` gets what `read` makes of a message, without numpy's warnings.

        `refuse` gets the errors of `read`. Neither of the two may raise. `source` returns what
        messages of one source have in common.
        """
        self._node, self._context = node, node.context
        self._read, self._callback, self._refuse = read, callback, refuse
        self._source = source
        self._stop = False
        self._inbox: MessageInbox | SpunInbox | None = None
        self._thread: threading.Thread | None = None
        if in_thread:
            self._inbox = inbox = message_inbox(node, message_type, topic, qos)
            self._subscription, self._take_next = inbox.subscription, inbox.take
            self._thread = threading.Thread(
                target=self._run, args=(inbox.wait,), name=f'{topic} loop', daemon=True)
        else:
            self._subscription = node.create_subscription(
                message_type, topic, self._deliver_in_executor, qos, raw=True)
            self._take_next = raw_take(self._subscription, message_type)

    def start(self) -> None:
        """Begin to call back."""
        if self._thread is not None:
            self._thread.start()

    def stop(self) -> None:
        """End the thread, before the node is destroyed."""
        self._stop = True
        if self._thread is not None and self._thread.is_alive():
            self._thread.join()
        if self._inbox is not None:
            self._inbox.close()

    @property
    def topic(self) -> str:
        """The full name of the topic."""
        return str(self._subscription.topic_name)

    def publisher_count(self) -> int:
        """Return how many publishers match this subscription."""
        return int(self._subscription.get_publisher_count())

    def _run(self, wait: Callable[[int], None]) -> None:
        with np.errstate(over='ignore', invalid='ignore'):  # once, and not for every message
            self._wait_and_deliver(wait)

    def _wait_and_deliver(self, wait: Callable[[int], None]) -> None:
        while not self._stop and self._context.ok():
            wait(TURN)
            data = None if self._stop else self._take()
            if data is not None:  # the turn may be over
                self._deliver(data)

    def _deliver_in_executor(self, data: bytes) -> None:
        with np.errstate(over='ignore', invalid='ignore'):
            self._deliver(data)

    def _deliver(self, data: bytes) -> None:
        """Deliver this message and those that wait behind it, without the outdated ones."""
        waiting = [data]
        while len(waiting) < MOST_WAITING and (following := self._take()) is not None:
            waiting.append(following)
        newest: dict[Hashable, Any] = {}
        for message in self._readable(waiting):
            source = self._source(message)
            newest.pop(source, None)
            newest[source] = message
        for message in newest.values():
            self._callback(message)

    def _readable(self, waiting: Sequence[bytes]) -> Iterator[Any]:
        """Yield what `read` makes of messages; refuse those that it cannot read."""
        for data in waiting:
            try:
                yield self._read(data)
            except UnreadableMessageError as error:
                self._refuse(error)

    def _take(self) -> bytes | None:
        """Return the newest message as bytes, or None where it was taken back."""
        try:
            taken = self._take_next()
        except Exception as error:  # nothing that arrives may end the thread
            self._node.get_logger().warning(
                f'Cannot take a message of {self._subscription.topic_name}: {error!r}',
                throttle_duration_sec=LOG_PERIOD)
            return None
        return None if taken is None else taken[0]
