# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A service with a separate thread, which responds while the executor is busy.

The executor of a node runs one callback at a time: a request would wait until a long callback
ends. A response that cannot be delivered yet delays no other request.
"""

from collections.abc import Callable
import threading
from typing import Any

from rclpy.node import Node
from robot_dynamics.ros.middleware.answer_delivery import AnswerDelivery
from robot_dynamics.ros.middleware.answer_delivery import TURN as DELIVERY_TURN
from robot_dynamics.ros.middleware.joint_state_loop import LOG_PERIOD, TURN
from robot_dynamics.ros.middleware.rclpy_internals import service_with_inbox


class UrgentService:
    """A service of a node whose callback runs in a thread; the callback must be thread-safe."""

    def __init__(
        self, node: Node, srv_type: Any, name: str, callback: Callable[[Any, Any], Any],
    ) -> None:
        """Take a `callback` that gets the request and a response to fill, and returns it."""
        self._node, self._type = node, srv_type
        self._requests = service_with_inbox(node, srv_type, name, callback)
        self._ends = False
        self._thread = threading.Thread(target=self._run, name=f'{name} service', daemon=True)
        if self._requests is not None:
            self._thread.start()

    def close(self) -> None:
        """End the thread, before the node is destroyed."""
        self._ends = True
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        requests, delivery = self._requests, AnswerDelivery(self._node)
        while requests is not None and self._is_needed():
            requests.wait(round(1e9 * DELIVERY_TURN) if delivery.has_waiting else TURN)
            try:
                request, header = requests.take()
                if header is not None and self._is_needed():
                    delivery.send(
                        requests.service, requests.answer(request, self._type.Response()), header)
                delivery.send_waiting()
            except Exception as error:  # a request that cannot be read must not end the thread
                if self._is_needed():
                    self._node.get_logger().error(
                        f'{requests.service.service_name}: {error!r}',
                        throttle_duration_sec=LOG_PERIOD)

    def _is_needed(self) -> bool:
        return not self._ends and self._node.context.ok()
