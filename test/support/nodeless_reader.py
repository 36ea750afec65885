# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A process whose subscription belongs to no node, as a DDS reader of a program without ROS."""

from pathlib import Path

from request_bench import answer_lines, ClientProcess
from ros_harness import RosClient
from std_msgs.msg import Float64MultiArray


class NodelessReader(ClientProcess):
    """The process that reads a topic of the type Float64MultiArray."""

    def __init__(self) -> None:
        super().__init__('nodeless_reader', environment={
            'FASTRTPS_DEFAULT_PROFILES_FILE': str(Path(__file__).with_name('silent_writers.xml'))})

    def subscribe(self, topic: str) -> None:
        """Subscribe to a topic."""
        self.ask(topic)

    def wait_for_message(self) -> list[float]:
        """Return the data of the first message."""
        return list(self.ask(''))


def main() -> None:
    """Subscribe to the topic on the standard input, then print the first message."""
    with RosClient('nodeless') as client:
        collectors = []

        def read(topic: str) -> list[float]:
            if topic:
                collectors.append(client.collect(Float64MultiArray, topic, 1))
                return []
            return list(collectors[0].wait_for().data)

        answer_lines(read)


if __name__ == '__main__':
    main()
