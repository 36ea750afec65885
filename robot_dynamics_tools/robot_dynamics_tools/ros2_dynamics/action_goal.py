# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A goal of `ros2 dynamics move` as the action of the node, which reports its own result."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import math
import time
from typing import Any

from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from robot_dynamics.tools.command_line import ToolError
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError
from trajectory_msgs.msg import JointTrajectory

GOAL_TIME = 1
"""[s] after the motion in which the arm must reach the goal."""
GOAL_TOLERANCE_VIOLATED = -5
GLANCE = 0.5
"""[s] in which an action is found whose node is known."""


class ActionGoal:
    """One goal of the action; its client receives while it waits."""

    def __init__(self, client: DynamicsClient, action: Any, action_client: ActionClient) -> None:
        self._client, self._type, self._action = client, action, action_client
        self._handle: ClientGoalHandle | None = None
        self._result: Any = None
        self._stamps: list[int] = []
        """Stamps [ns] of the first and of the newest feedback."""
        self._heard_at = math.inf

    def send(self, trajectory: JointTrajectory) -> None:
        """Send a goal, and wait until the node follows it; raise ToolError, NoAnswerError."""
        request = self._type.Goal(trajectory=trajectory)
        request.goal_time_tolerance.sec = GOAL_TIME
        sent = self._action.send_goal_async(request, feedback_callback=self._on_feedback)
        if not self._client.wait(sent.done):
            raise NoAnswerError(
                f'{self._client.name} does not accept a goal in {self._client.timeout:g} s')
        self._handle = sent.result()
        self._result = self._handle.get_result_async()
        if not self._client.wait(lambda: self._stamps or self._result.done()):
            raise NoAnswerError(
                f'{self._client.name} has sent neither feedback nor a result for '
                f'{self._client.timeout:g} s')
        if not self._stamps and self._result.result().result.error_code:
            raise ToolError(
                f'{self._client.name} rejected the goal: '
                f'{self._result.result().result.error_string}')

    def _on_feedback(self, message: Any) -> None:
        stamp, self._heard_at = stamp_from_ros(message.feedback.header.stamp), time.monotonic()
        self._stamps = [*self._stamps[:1], stamp]

    def wait_end(self, on_progress: Callable[[float], None]) -> None:
        """
        Wait for the result; raise ToolError, NoAnswerError.

        `on_progress` receives the time [s] since the start, by the stamps. A joint that does not
        reach the goal is no error.
        """
        def has_ended() -> bool:
            if self._stamps:
                on_progress(1e-9 * (self._stamps[-1] - self._stamps[0]))
            if self._result.done():
                return True
            if time.monotonic() - self._heard_at > self._client.timeout:
                raise NoAnswerError(
                    f'{self._client.name} has sent no feedback for {self._client.timeout:g} s')
            return False

        self._client.wait(has_ended, math.inf)
        result = self._result.result().result
        if result.error_code not in (0, GOAL_TOLERANCE_VIOLATED):
            raise ToolError(f'the motion ended early: {result.error_string}')


@contextmanager
def action_goal(client: DynamicsClient) -> Iterator[ActionGoal | None]:
    """Yield a goal of the action of the node, None if it does not offer the action."""
    try:
        from control_msgs.action import FollowJointTrajectory
    except ImportError:
        yield None
        return
    action = ActionClient(client.node, FollowJointTrajectory, client.resolve(
        '~/follow_joint_trajectory'))
    try:
        is_offered = client.wait(action.server_is_ready, GLANCE)
        yield ActionGoal(client, FollowJointTrajectory, action) if is_offered else None
    finally:
        action.destroy()
