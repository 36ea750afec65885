# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A client of the action `~/follow_joint_trajectory`, with bounded waits."""

from collections.abc import Callable
import threading
from typing import Any

from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionClient
from ros_harness import LONG, RosClient, TIMEOUT


def seconds(t: float) -> Duration:
    whole, rest = divmod(round(1e9 * t), 1_000_000_000)
    return Duration(sec=whole, nanosec=rest)


class Sent:
    """A goal that a server has accepted."""

    def __init__(self, client: 'Client', goal: FollowJointTrajectory.Goal) -> None:
        self.feedback: list[Any] = []
        self._client = client
        self.handle = client.answer(lambda: client.action.send_goal_async(
            goal, feedback_callback=lambda message: self.feedback.append(message.feedback)))
        assert self.handle.accepted
        self._result = client.in_executor(self.handle.get_result_async)

    def result(self, timeout: float = TIMEOUT) -> tuple[int, int, str]:
        """Return the status, the error code and the error string."""
        found = self._client.answer(lambda: self._result, timeout)
        return found.status, found.result.error_code, found.result.error_string

    def cancel(self) -> None:
        assert len(self._client.answer(self.handle.cancel_goal_async).goals_canceling) == 1


class Client:
    """A client of the action of one node."""

    def __init__(self, client: RosClient, namespace: str) -> None:
        self.namespace, self.in_executor = namespace, client.in_executor
        self.action = ActionClient(
            client.node, FollowJointTrajectory, f'{namespace}/dynamics/follow_joint_trajectory')
        assert self.action.wait_for_server(LONG)

    def answer(self, request: Callable[[], Any], timeout: float = TIMEOUT) -> Any:
        """Return the result of the future that a request returns."""
        done, future = threading.Event(), self.in_executor(request)
        future.add_done_callback(lambda _: done.set())
        assert done.wait(timeout), f'no answer in {timeout:g} s'
        return future.result()

    def send(self, goal: FollowJointTrajectory.Goal) -> Sent:
        return Sent(self, goal)
