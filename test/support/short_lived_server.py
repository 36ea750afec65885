# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A process whose node offers a service in each given namespace, one after the other.

Namespaces arrive as lines of JSON, from a `request_bench.ClientProcess`.
"""

from collections.abc import Iterator
from contextlib import contextmanager, ExitStack
from typing import Any

from own_process import own_process
from rclpy.executors import SingleThreadedExecutor
from request_bench import answer_lines
from robot_dynamics.ros.middleware.guarded_callbacks import GuardedCallbacks
from std_srvs.srv import Trigger


@contextmanager
def short_lived_server(namespace: str) -> Iterator[None]:
    """Run a node with a separate participant that spins in a thread."""
    with own_process() as process:
        node = process.add(
            GuardedCallbacks('server', namespace=namespace, context=process.context))
        node.create_service(Trigger, '~/trigger', _answer)
        with process.spun(SingleThreadedExecutor):
            yield


def _answer(_: Any, response: Trigger.Response) -> Trigger.Response:
    response.success = True
    return response


def main() -> None:
    with ExitStack() as server:
        def serve(namespace: str) -> str:
            server.close()
            server.enter_context(short_lived_server(namespace))
            return namespace

        answer_lines(serve)


if __name__ == '__main__':
    main()
