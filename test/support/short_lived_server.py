# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A process whose node offers a service in each given namespace, one after the other.

Namespaces arrive as lines of JSON, from a `request_bench.ClientProcess`.
"""

import threading
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from request_bench import answer_lines
from robot_dynamics.ros.middleware.guarded_callbacks import GuardedCallbacks
from std_srvs.srv import Trigger


class ShortLivedServer:
    """A node with a separate participant that spins in a thread."""

    def __init__(self, namespace: str) -> None:
        self._context = Context()
        rclpy.init(args=[], context=self._context)
        self._node = GuardedCallbacks('server', namespace=namespace, context=self._context)
        self._node.create_service(Trigger, '~/trigger', _answer)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._ending = False
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def _spin(self) -> None:
        while not self._ending:
            self._executor.spin_once(timeout_sec=0.1)

    def close(self) -> None:
        """Stop the thread; destroy the node and its participant."""
        self._ending = True
        self._thread.join()
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)


def _answer(_: Any, response: Trigger.Response) -> Trigger.Response:
    response.success = True
    return response


def main() -> None:
    servers: list[ShortLivedServer] = []

    def serve(namespace: str) -> str:
        while servers:
            servers.pop().close()
        if namespace:
            servers.append(ShortLivedServer(namespace))
        return namespace

    answer_lines(serve)


if __name__ == '__main__':
    main()
