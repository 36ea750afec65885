# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Hand each joint state to the control path with little delay.

rclpy's executors rebuild their wait set from every service, timer and subscription of the node
for each message or request, and run one callback at a time, so that a long service call delays
control. Here a separate thread waits on a wait set that has only the state subscription, as
rclpy.wait_for_message does.
"""

from collections.abc import Callable
from itertools import islice
import threading

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from robot_dynamics.ros.middleware.cdr_templates import JointStateDecoder, SensedState
from robot_dynamics.ros.middleware.message_bytes import UnreadableMessageError
from robot_dynamics.ros.middleware.rclpy_internals import message_inbox
from sensor_msgs.msg import JointState

TURN = 100_000_000
"""[ns] after which a wait checks whether the loop must end."""
MOST_WAITING = 16
"""Messages of one topic that are taken together; also the queue length of the middleware."""
LOG_PERIOD = 5.0
"""[s] between warnings of one kind."""


class JointStateLoop:
    """
    The subscription of joint_states, whose callback runs in a separate thread.

    If several messages wait after a delivery, only the newest one per source is delivered, where
    the messages of a source have the same joint names.
    """

    def __init__(
        self, node: Node, callback: Callable[[SensedState], None],
        refuse: Callable[[UnreadableMessageError], None],
    ) -> None:
        """
        Subscribe; `callback` receives the states, without the warnings of numpy.

        `refuse` receives the errors of messages that cannot be read. Neither of the two may raise.
        """
        self._node, self._context = node, node.context
        self._read, self._callback, self._refuse = JointStateDecoder().decode, callback, refuse
        self._stop = False
        self._inbox = inbox = message_inbox(node, JointState, 'joint_states', QoSProfile(
            depth=MOST_WAITING, reliability=ReliabilityPolicy.BEST_EFFORT))
        self.topic, self._take_next = str(inbox.subscription.topic_name), inbox.take
        self.publisher_count: Callable[[], int] = inbox.subscription.get_publisher_count
        """Returns how many publishers match this subscription."""
        self._thread = threading.Thread(
            target=self._run, args=(inbox.wait,), name='joint_states loop', daemon=True)
        self.start = self._thread.start
        """Starts the thread."""

    def stop(self) -> None:
        """End the thread, before the node is destroyed."""
        self._stop = True
        if self._thread.is_alive():
            self._thread.join()
        self._inbox.close()

    def _run(self, wait: Callable[[int], None]) -> None:
        with np.errstate(over='ignore', invalid='ignore'):  # once, not per message
            while not self._stop and self._context.ok():
                wait(TURN)
                data = None if self._stop else self._take()
                if data is not None:  # None if the wait has timed out
                    self._deliver(data)

    def _deliver(self, data: bytes) -> None:
        """Deliver this message at once, and the newest ones of those that wait after it."""
        try:
            message = self._read(data)
        except UnreadableMessageError as error:
            self._refuse(error)
        else:
            self._callback(message)
        following = self._take()
        if following is not None:
            self._deliver_newest([following, *islice(iter(self._take, None), MOST_WAITING - 1)])

    def _deliver_newest(self, waiting: list[bytes]) -> None:
        """Deliver the newest of the waiting messages per source; pass errors to `refuse`."""
        newest: dict[tuple[str, ...], SensedState] = {}
        for data in waiting:
            try:
                message = self._read(data)
            except UnreadableMessageError as error:
                self._refuse(error)
                continue
            source = tuple(message.name)
            newest.pop(source, None)
            newest[source] = message
        for message in newest.values():
            self._callback(message)

    def _take(self) -> bytes | None:
        """Return the next message as bytes, None without a message."""
        try:
            taken = self._take_next()
        except Exception as error:  # no message may end the thread
            self._node.get_logger().warning(
                f'Cannot take a message of {self.topic}: {error!r}',
                throttle_duration_sec=LOG_PERIOD)
            return None
        return None if taken is None else taken[0]
