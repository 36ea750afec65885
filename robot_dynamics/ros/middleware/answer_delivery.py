# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Send the response of a service once its client can receive it.

DDS has no services: requests and responses are samples of two topics, and a node discovers the
request writer and the response reader of a client independently of each other. A request can
therefore arrive before its client can receive the response. rmw_fastrtps then waits up to 100 ms
for the reader and discards the response (ros2/rmw_fastrtps issue 842). It waits with Python's
interpreter lock held, so that the control thread waits, too.
"""

from functools import partial
import time
from typing import Any, NamedTuple
import warnings

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy
from rclpy.service import Service
from robot_dynamics.ros.middleware.pausing_timer import PausingTimer
from robot_dynamics.ros.middleware.rclpy_internals import (
    replace_send_response,
    request_number,
    send_response,
)

LONGEST_WAIT = 10.0
"""[s] in which a response reader must be discovered; lost discovery data are repeated each 1 s."""
PAUSE = 2.0
"""
[s] without an attempt after one of the same service that has failed.

A reader can be discovered but not yet connected, or the discovered reader is that of an earlier
client. Each such attempt delays the control thread by 100 ms, so there are few, whatever clients
send.
"""
TURN = 0.02
"""[s] between two queries of the graph while a response waits."""
_DISCARDED = 'failed to send response'
"""Warning of rclpy about a discarded response; it raises no error."""


class _Response(NamedTuple):
    service: Any
    message: Any
    header: Any
    until: float


class AnswerDelivery:
    """Sends the responses of services of a node; for use in one thread."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._expected: dict[str, set[int]] = {}
        self._waiting: list[_Response] = []
        self._not_before: dict[str, float] = {}

    @property
    def has_waiting(self) -> bool:
        """Whether `send_waiting` must be called, every TURN."""
        return bool(self._waiting)

    def send(self, service: Any, message: Any, header: Any) -> None:
        """Send a response now, or let it wait for its reader."""
        response = _Response(service, message, header, time.monotonic() + LONGEST_WAIT)
        # The next request of a client that has received a response: rclpy names no client, and a
        # query of the graph takes longer than most responses, but a client numbers its requests.
        is_known = request_number(header) in self._expected.get(service.service_name, ())
        if is_known and self._attempt(response):
            return
        self._waiting.append(response)
        self.send_waiting()

    def _attempt(self, response: _Response) -> bool:
        """Send; return whether the response was not discarded."""
        service, number = response.service.service_name, request_number(response.header)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter('always')
            send_response(response.service, response.message, response.header)
        if any(_DISCARDED in str(warning.message) for warning in caught):
            self._not_before[service] = time.monotonic() + PAUSE
            return False
        if number is not None:
            expected = self._expected.setdefault(service, set())
            expected.discard(number)
            expected.add(number + 1)
        return True

    def send_waiting(self) -> None:
        """
        Send the responses whose readers are discovered, the newest first.

        After LONGEST_WAIT a response gets an attempt in any case: the missing reader may be that
        of another client.
        """
        waiting, self._waiting = self._waiting, []
        discovered: dict[str, bool] = {}
        for response in reversed(waiting):
            name, late = response.service.service_name, time.monotonic() - response.until
            if name not in discovered:
                discovered[name] = is_discovered(self._node, response.service)
            may_send = time.monotonic() >= self._not_before.get(name, 0.0) and (
                late >= 0.0 or discovered[name])
            if may_send and self._attempt(response):
                continue
            if late >= (0.0 if may_send else LONGEST_WAIT):
                self._node.get_logger().warning(
                    f'Discarded a response of {name}: its client cannot receive it (not '
                    'discovered, ended, or incompatible QoS)', throttle_duration_sec=PAUSE)
            else:
                self._waiting.insert(0, response)


class ExecutorDelivery(AnswerDelivery):
    """Sends the responses of services that the executor of the node calls back."""

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._timer = PausingTimer(node, TURN, self.send_waiting)

    def take_over(self, service: Service) -> None:
        """Send the responses of a service of the node from now on."""
        replace_send_response(service, partial(self.send, service))

    def send_waiting(self) -> None:
        """Send what can be sent; a timer calls again while responses wait."""
        super().send_waiting()
        self._timer.run(self.has_waiting)


def is_discovered(node: Node, service: Service) -> bool:
    """Return whether as many response readers as request writers are discovered."""
    name = service.service_name
    return response_readers(node, name) >= request_writers(node, name)


def request_writers(node: Node, service: str) -> int:
    """Return the number of discovered request writers of a service."""
    return len(node.get_publishers_info_by_topic(f'rq{service}Request', no_mangle=True))


def response_readers(node: Node, service: str) -> int:
    """Return the number of discovered response readers of a service that can be connected."""
    readers = node.get_subscriptions_info_by_topic(f'rr{service}Reply', no_mangle=True)
    return sum(  # others do not match the writer of the node, whose responses are volatile
        reader.qos_profile.durability == DurabilityPolicy.VOLATILE for reader in readers)
