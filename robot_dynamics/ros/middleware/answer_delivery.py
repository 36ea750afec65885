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

from dataclasses import dataclass, replace
from functools import partial
import time
from typing import Any
import warnings

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.service import Service
from rclpy.timer import Timer
from robot_dynamics.ros.middleware.rclpy_internals import (
    replace_send_response,
    request_number,
    send_response,
)

LONGEST_WAIT = 10.0
"""[s] in which a response reader must be discovered; lost discovery data are repeated each 1 s."""
PAUSES = (0.5, 4.0)
"""
[s] before the second and the third attempt.

A reader can be discovered but not yet connected, or the discovered reader is that of an earlier
client. Each attempt may delay the control thread by 100 ms, so there are few.
"""
_TURN = 0.02
"""[s] between two queries of the graph while a response waits."""
_DISCARDED = 'failed to send response'
"""Warning of rclpy about a discarded response; it raises no error."""


@dataclass(frozen=True)
class _Response:
    service: Any
    message: Any
    header: Any
    until: float
    attempts: int = 0


class AnswerDelivery:
    """Sends the responses of a node's services; for use in the thread of the node's executor."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._expected: dict[str, set[int]] = {}
        self._waiting: list[_Response] = []
        self._timer: Timer | None = None

    def take_over(self, service: Service) -> None:
        """Send the responses of a service of the node from now on."""
        replace_send_response(service, partial(self._send, service))

    def _send(self, service: Any, message: Any, header: Any) -> None:
        if self._is_of_known_client(service, header):
            send_response(service, message, header)
            return
        response = _Response(service, message, header, time.monotonic() + LONGEST_WAIT)
        if is_discovered(self._node, service):
            self._attempt(response)
        else:
            self._waiting.append(response)
        self._set_timer()

    def _is_of_known_client(self, service: Any, header: Any) -> bool:
        """
        Return whether the request is the next one of a client whose reader was discovered.

        rclpy does not expose the client of a request, and a query of the graph takes longer
        than most responses. The requests of a client are numbered consecutively.
        """
        number = request_number(header)
        if number is None:
            return False
        expected = self._expected.setdefault(service.service_name, set())
        is_known = number in expected and not self._waiting
        expected.discard(number)
        expected.add(number + 1)
        return is_known

    def _attempt(self, response: _Response) -> None:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter('always')
            send_response(response.service, response.message, response.header)
        if not any(_DISCARDED in str(warning.message) for warning in caught):
            return
        if response.attempts == len(PAUSES):
            self._node.get_logger().warning(
                f'Discarded a response of {response.service.service_name}: its client cannot '
                'receive it (not discovered, ended, or incompatible QoS)')
        else:
            until = time.monotonic() + PAUSES[response.attempts]
            self._waiting.append(
                replace(response, until=until, attempts=response.attempts + 1))

    def _send_waiting(self) -> None:
        waiting, self._waiting = self._waiting, []
        for response in waiting:
            if time.monotonic() >= response.until or (
                    response.attempts == 0 and is_discovered(self._node, response.service)):
                self._attempt(response)
            else:
                self._waiting.append(response)
        self._set_timer()

    def _set_timer(self) -> None:
        if self._waiting and self._timer is None:
            self._timer = self._node.create_timer(  # simulated time may be paused
                _TURN, self._send_waiting, clock=Clock(clock_type=ClockType.STEADY_TIME))
        elif self._waiting and self._timer is not None and self._timer.is_canceled():
            self._timer.reset()
        elif not self._waiting and self._timer is not None:
            self._timer.cancel()


def is_discovered(node: Node, service: Service) -> bool:
    """Return whether as many response readers as request writers are discovered."""
    name = service.service_name
    return response_readers(node, name) >= request_writers(node, name)


def request_writers(node: Node, service: str) -> int:
    """Return the number of discovered request writers of a service."""
    return len(node.get_publishers_info_by_topic(f'rq{service}Request', no_mangle=True))


def response_readers(node: Node, service: str) -> int:
    """Return the number of discovered response readers of a service."""
    return len(node.get_subscriptions_info_by_topic(f'rr{service}Reply', no_mangle=True))
