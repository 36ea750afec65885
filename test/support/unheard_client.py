# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A client of a service whose response reader no other process discovers."""

import itertools
from pathlib import Path

from request_bench import answer_lines, ClientProcess
from ros_harness import RosClient, wait_until
from std_srvs.srv import Trigger


class UnheardClient(ClientProcess):
    """The process that sends requests and cannot receive their responses."""

    def __init__(self) -> None:
        super().__init__('unheard_client', environment={
            'FASTRTPS_DEFAULT_PROFILES_FILE': str(Path(__file__).with_name('silent_readers.xml'))})

    def send(self, service: str, count: int) -> None:
        """Send requests of the type Trigger."""
        self.ask((service, count))


def main() -> None:
    """Send the requests on the standard input."""
    with RosClient('unheard_client') as client:
        def send(line: tuple[str, int]) -> int:
            service, count = line
            caller = client.node.create_client(Trigger, service)
            wait_until(lambda: bool(client.node.get_subscriptions_info_by_topic(
                f'rq{service}Request', no_mangle=True)), f'the service {service}')
            for _ in itertools.repeat(None, count):
                caller.call_async(Trigger.Request())
            return count

        answer_lines(send)


if __name__ == '__main__':
    main()
