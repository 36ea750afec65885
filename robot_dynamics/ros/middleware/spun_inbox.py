# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Messages for a thread, by the documented interface of rclpy only.

A hidden node has the subscription, and a second thread spins it. `MessageInbox` needs no such
thread.
"""

from collections import deque
import threading
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

Taken = tuple[bytes, Any]
"""A serialized message, and the dictionary of its `received_timestamp` and further properties."""


class SpunInbox:
    """The messages of one topic, as bytes; the fallback of `MessageInbox`."""

    def __init__(self, node: Node, message_type: type, topic: str, qos: QoSProfile) -> None:
        """Subscribe to `topic`, resolved as a topic of `node`."""
        self._waiting: deque[Taken] = deque(maxlen=qos.depth)
        self._news = threading.Condition()
        self._ends = False
        self._helper = rclpy.create_node(
            f'_{node.get_name()}_inbox', namespace=node.get_namespace(), context=node.context,
            use_global_arguments=False, start_parameter_services=False, enable_rosout=False)
        self.subscription: Subscription = self._helper.create_subscription(
            message_type, node.resolve_topic_name(topic), self._keep, qos, raw=True)
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(self._helper)
        self._thread = threading.Thread(target=self._spin, name='inbox', daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        while not self._ends and self._helper.context.ok():
            try:
                self._executor.spin_once(timeout_sec=0.1)
            except ExternalShutdownException:
                return

    def _keep(self, data: bytes, info: Any) -> None:
        with self._news:
            self._waiting.append((data, info))
            self._news.notify()

    def take(self) -> Taken | None:
        """Return the next message and its properties, or None."""
        with self._news:
            return self._waiting.popleft() if self._waiting else None

    def wait(self, nanoseconds: int) -> None:
        """Wait at most so long for a message."""
        with self._news:
            self._news.wait_for(lambda: self._waiting, 1e-9 * nanoseconds)

    def close(self) -> None:
        """End the subscription and its thread."""
        self._ends = True
        self._thread.join()
        self._executor.shutdown()
        self._helper.destroy_node()
