# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Processes of which others discover only a part: a reader without a node, a deaf client."""

import itertools
from pathlib import Path
import sys
from typing import Any

from request_bench import answer_lines, ClientProcess
from ros_harness import RosClient, wait_until
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger


class SilentProcess(ClientProcess):
    """A process in a role, whose writers or readers no other process discovers."""

    def __init__(self, role: str, silent: str) -> None:
        super().__init__('silent_clients', role, environment={
            'FASTRTPS_DEFAULT_PROFILES_FILE': str(
                Path(__file__).with_name(f'silent_{silent}.xml'))})


class NodelessReader(SilentProcess):
    """
    The process that reads a topic of the type Float64MultiArray.

    Its subscription belongs to no node, as a DDS reader of a program without ROS.
    """

    def __init__(self) -> None:
        super().__init__('nodeless', 'writers')

    def subscribe(self, topic: str) -> None:
        """Subscribe to a topic."""
        self.ask(topic)

    def wait_for_message(self) -> list[float]:
        """Return the data of the first message."""
        return list(self.ask(''))


class UnheardClient(SilentProcess):
    """The process that sends requests and cannot receive their responses."""

    def __init__(self) -> None:
        super().__init__('unheard_client', 'readers')

    def send(self, service: str, count: int) -> None:
        """Send requests of the type Trigger."""
        self.ask((service, count))


def main() -> None:
    """Act on the topics, or on the services and counts, on the standard input."""
    with RosClient(sys.argv[1]) as client:
        collectors = []

        def read(topic: str) -> list[float]:
            if topic:
                collectors.append(client.collect(Float64MultiArray, topic, 1))
                return []
            return list(collectors[0].wait_for().data)

        def send(line: tuple[str, int]) -> int:
            service, count = line
            caller = client.node.create_client(Trigger, service)
            wait_until(lambda: bool(client.node.get_subscriptions_info_by_topic(
                f'rq{service}Request', no_mangle=True)), f'the service {service}')
            for _ in itertools.repeat(None, count):
                caller.call_async(Trigger.Request())
            return count

        acts: dict[str, Any] = {'nodeless': read, 'unheard_client': send}
        answer_lines(acts[sys.argv[1]])


if __name__ == '__main__':
    main()
