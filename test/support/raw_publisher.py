# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A process that publishes arbitrary bytes as messages."""

import importlib
import threading
from typing import Any

from rclpy.serialization import serialize_message
from request_bench import answer_lines, ClientProcess
from ros_harness import LATCHED, RosClient

PERIOD = 0.003
"""Time between two messages [s], so that a subscriber of depth 1 receives most messages."""


class RawPublisher(ClientProcess):
    """Runs the process, for use in a `with` statement."""

    def __init__(self) -> None:
        super().__init__('raw_publisher')

    def publish(self, topic: str, message_type: type, data: bytes) -> None:
        """Publish bytes as a message of this type, once there is a subscriber."""
        module = message_type.__module__.split('._')[0]
        self.ask((module, message_type.__name__, topic, data.hex()))


def bytes_of(message: Any) -> bytes:
    """Return a serialized message."""
    return bytes(serialize_message(message))


def main() -> None:
    """Publish the messages on the standard input."""
    with RosClient('raw_publisher') as client:
        publishers: dict[str, Any] = {}
        pause = threading.Event()

        def answer(message: tuple[str, str, str, str]) -> None:
            module, name, topic, data = message
            if topic not in publishers:
                message_type = getattr(importlib.import_module(module), name)
                publishers[topic] = client.publisher(message_type, topic, LATCHED)
            publishers[topic].publish(bytes.fromhex(data))
            pause.wait(PERIOD)

        answer_lines(answer)


if __name__ == '__main__':
    main()
