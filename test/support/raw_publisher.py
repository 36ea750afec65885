# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A process that publishes arbitrary bytes as messages.

Each line on its standard input is a type, a topic and bytes in hexadecimal, such as
`sensor_msgs.msg.JointState /joint_states 00010000…`. It answers each line with a line.
"""

import importlib
from pathlib import Path
import subprocess
import sys
import threading
from typing import Any

import children
from rclpy.serialization import serialize_message
from ros_harness import LATCHED, RosClient

PERIOD = 0.003
"""Time between two messages [s], so that a subscriber of depth 1 receives most messages."""


class RawPublisher:
    """Runs the process, for use in a `with` statement."""

    def __init__(self) -> None:
        self.sent = 0

    def publish(self, topic: str, message_type: type, data: bytes) -> None:
        """Publish bytes as a message of this type, once there is a subscriber."""
        name = f'{message_type.__module__.split("._")[0]}.{message_type.__name__}'
        self._process.stdin.write(f'{name} {topic} {data.hex()}\n')
        self._process.stdin.flush()
        assert self._process.stdout.readline(), f'the publisher ended with {data.hex()}'
        self.sent += 1

    def __enter__(self) -> 'RawPublisher':
        self._process: Any = children.popen(
            [sys.executable, str(Path(__file__))], text=True, stdin=subprocess.PIPE,
            stdout=subprocess.PIPE)
        return self

    def __exit__(self, *_: object) -> None:
        self._process.stdin.close()
        assert self._process.wait(children.TIMEOUT) == 0
        self._process.stdout.close()


def bytes_of(message: Any) -> bytes:
    """Return a serialized message."""
    return bytes(serialize_message(message))


def main() -> None:
    with RosClient('raw_publisher') as client:
        publishers: dict[str, Any] = {}
        pause = threading.Event()
        for line in sys.stdin:
            type_name, topic, data = line.rstrip('\n').split(' ')
            if topic not in publishers:
                module, name = type_name.rsplit('.', 1)
                message_type = getattr(importlib.import_module(module), name)
                publishers[topic] = client.publisher(message_type, topic, LATCHED)
            publishers[topic].publish(bytes.fromhex(data))
            pause.wait(PERIOD)
            print('published', flush=True)


if __name__ == '__main__':
    main()
