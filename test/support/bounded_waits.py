# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Bounded waits of the tests: for a condition, and for messages of a topic."""

from collections.abc import Callable
import sys
import threading
import time
import traceback
from typing import Any

from children import TIMEOUT
from rclpy.node import Node


def stacks() -> str:
    """Return the stack of each thread of this process, for the report of a timeout."""
    names = {thread.ident: thread.name for thread in threading.enumerate()}
    return '\n'.join(
        f'thread {names.get(ident)}:\n{"".join(traceback.format_stack(frame)[-4:])}'
        for ident, frame in sys._current_frames().items())


class Collector:
    """Records the messages of a topic; close it, or use it in a `with` statement."""

    def __init__(self, node: Node, message_type: type, topic: str, qos: Any) -> None:
        self._node = node
        self._messages: list[Any] = []
        self._news = threading.Condition()
        self._topic = topic
        self._subscription = node.create_subscription(message_type, topic, self._keep, qos)

    def _keep(self, message: Any) -> None:
        with self._news:
            self._messages.append(message)
            self._news.notify_all()

    @property
    def messages(self) -> list[Any]:
        """Return all messages so far, oldest first."""
        with self._news:
            return list(self._messages)

    def matching(self) -> str:
        """Return how many publishers are known and matched, for the report of a timeout."""
        known = self._node.count_publishers(self._subscription.topic_name)
        return f'{known} publishers known, {self._subscription.get_publisher_count()} matched'

    def clear(self) -> None:
        """Discard the messages received so far."""
        with self._news:
            self._messages.clear()

    def wait_matched(self, count: int = 1, timeout: float = TIMEOUT) -> None:
        """Wait until this number of publishers is discovered."""
        wait_until(
            lambda: self._node.count_publishers(self._subscription.topic_name) >= count,
            f'{count} publishers of {self._topic}', timeout)

    def find(self, predicate: Callable[[Any], bool], timeout: float = TIMEOUT) -> Any | None:
        """Return the first past or future message that fulfils this; None after the timeout."""
        looked, found = 0, None

        def look() -> bool:
            nonlocal looked, found
            while found is None and looked < len(self._messages):
                if predicate(self._messages[looked]):
                    found = self._messages[looked]
                looked += 1
            return found is not None

        with self._news:
            self._news.wait_for(look, timeout)
        return found

    def wait_for(
        self, predicate: Callable[[Any], bool] = lambda _: True, timeout: float = TIMEOUT,
    ) -> Any:
        """Return the first message that fulfils this; fail after the timeout."""
        found = self.find(predicate, timeout)
        assert found is not None, (
            f'no such message on {self._topic} in {timeout:g} s; {len(self.messages)} others, '
            f'the last: {self.messages[-1:]}; {self.matching()}\n{stacks()}')
        return found

    def wait_count(self, count: int, timeout: float = TIMEOUT) -> list[Any]:
        """Wait for this number of messages; return all."""
        with self._news:
            enough = self._news.wait_for(lambda: len(self._messages) >= count, timeout)
            got = list(self._messages)
        assert enough, (
            f'{len(got)} of {count} messages on {self._topic} in {timeout:g} s; '
            f'{self.matching()}\n{stacks()}')
        return got

    def close(self) -> None:
        self._node.destroy_subscription(self._subscription)

    def __enter__(self) -> 'Collector':
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def has_stamp(stamp: Any) -> Callable[[Any], bool]:
    """Return a predicate for messages with this stamp."""
    return lambda message: bool(message.header.stamp == stamp)


def wait_until(condition: Callable[[], bool], what: str, timeout: float = TIMEOUT) -> None:
    """Check a condition without notification every 10 ms; fail after the timeout."""
    deadline = time.monotonic() + timeout
    pause = threading.Event()
    while not condition():
        assert time.monotonic() < deadline, f'{timeout:g} s passed without {what}'
        pause.wait(0.01)
