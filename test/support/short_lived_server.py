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
A process whose node offers a service in each given namespace, one after the other.

Namespaces arrive as lines of JSON, from a `request_bench.ClientProcess`.
"""

import threading
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from request_bench import answer_lines
from robot_dynamics.ros.guarded_callbacks import GuardedCallbacks
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
