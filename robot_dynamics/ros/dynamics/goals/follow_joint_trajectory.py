# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The action `~/follow_joint_trajectory`, through which MoveIt 2 moves an arm.

A goal is always accepted, and an invalid one is aborted at once: only a result can contain the
reason. An invalid goal does not disturb the motion.
"""

from collections.abc import Generator
import math
from operator import attrgetter
import threading
import time
from typing import Any, NamedTuple

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.trajectory_goal import (
    GoalFeedback,
    ResultCode,
    TrajectoryGoal,
)
from robot_dynamics.exceptions import InvalidInputError, JointNamesError, PastTrajectoryError
from robot_dynamics.ros.dynamics.control_path import ControlPath
from robot_dynamics.ros.dynamics.goals.tolerances import tolerances_of
from robot_dynamics.ros.dynamics.goals.trajectory_input import TrajectoryInput
from robot_dynamics.ros.middleware.answer_delivery import (
    LONGEST_WAIT,
    request_writers,
    response_readers,
)
from robot_dynamics.ros.middleware.conversions import (
    floats_to_ros,
    stamp_from_ros,
    stamp_to_ros,
    trajectory_from_ros,
)
from robot_dynamics.ros.middleware.guarded_callbacks import describe_error, GuardedCallbacks
from robot_dynamics.ros.middleware.joint_state_loop import LOG_PERIOD
from robot_dynamics.ros.middleware.pausing_timer import PausingTimer
from trajectory_msgs.msg import JointTrajectoryPoint

FEEDBACK_PERIOD = 0.05
"""[s]"""
RESULT_TIMEOUT = 60
"""[s] for which a result is kept; rclpy keeps those of many goals for 900 s."""
LAST_REQUEST = 0.2
"""[s] after the end of a goal in which its client asks for the result."""


class _Running(NamedTuple):
    """A goal that is executed, by the loop that has accepted it."""

    handle: ServerGoalHandle
    loop: ControlLoop
    goal: TrajectoryGoal
    done: Future


class FollowJointTrajectoryServer:
    """Offers the action on a node, if `control_msgs` is installed."""

    def __init__(
        self, node: GuardedCallbacks, path: ControlPath, accepted: TrajectoryInput,
    ) -> None:
        """Count goals in `accepted`."""
        self._node, self._path, self._input = node, path, accepted
        self._running: list[_Running] = []
        self._open, self._ended_at = dict[int, object](), -math.inf
        """Of each open request its epoch (`GoalExecution`), by its identity."""
        self._turns = 0
        """Of the executor, in which it takes requests that were sent before a stop."""
        self._lock = threading.Lock()
        """Protects the four above: an executor may have several threads."""
        self._server: _GuardedServer | None = None
        try:
            from control_msgs.action import FollowJointTrajectory
        except ImportError:
            node.get_logger().info(
                '~/follow_joint_trajectory is not offered: control_msgs is not installed '
                '(ros-jazzy-control-msgs)')
            return
        self._type: Any = FollowJointTrajectory
        # A goal that waits for its client in `_take` must not stop the other callbacks.
        group = ReentrantCallbackGroup()
        self._feedback = PausingTimer(node, FEEDBACK_PERIOD, self._publish_feedback, group)
        self._ended = node.create_guard_condition(self._look, group)
        self._turned = node.create_guard_condition(self._count_turn, group)
        self._server = _GuardedServer(
            node, self._type, '~/follow_joint_trajectory', self._execute,
            callback_group=group, goal_callback=self._take, cancel_callback=self._cancel,
            result_timeout=RESULT_TIMEOUT)

    @property
    def is_busy(self) -> bool:
        """Whether a goal awaits its result, or its client may still ask for it."""
        return bool(self._open) or time.monotonic() < self._ended_at + LAST_REQUEST

    def stop(self) -> None:
        """Let the requests end that wait for a busy executor: it takes them in its next turn."""
        if self._server is not None:
            with self._lock:
                self._turns = 2
            self._turned.trigger()

    def _count_turn(self) -> None:
        with self._lock:
            self._turns -= 1
            if self._turns > 0:
                self._turned.trigger()

    def close(self) -> None:
        """End the action, before the node is destroyed."""
        if self._server is not None:
            self._server.destroy()

    def _cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        self._ended.trigger()  # rclpy marks the goal as cancelled after this callback
        return CancelResponse.ACCEPT

    async def _take(self, request: Any) -> GoalResponse:
        """Accept a goal, as soon as its client can receive all answers (`answer_delivery`)."""
        loop = self._path.loop
        with self._lock:
            self._open[id(request)] = object() if self._turns > 0 else (
                None if loop is None else loop.goals.epoch)
        self._feedback.run(True)  # lets the executor look again
        until = time.monotonic() + LONGEST_WAIT
        while time.monotonic() < until and not self._is_client_discovered():
            await _Turn()
        return GoalResponse.ACCEPT

    def _is_client_discovered(self) -> bool:
        action = self._node.resolve_topic_name('~/follow_joint_trajectory')
        clients = request_writers(self._node, f'{action}/_action/send_goal')
        return all(
            response_readers(self._node, f'{action}/_action/{service}') >= clients
            for service in ('send_goal', 'cancel_goal', 'get_result'))

    async def _execute(self, handle: ServerGoalHandle) -> Any:
        try:
            return await self._executed(handle)
        finally:
            with self._lock:
                del self._open[id(handle.request)]
                self._ended_at = time.monotonic()

    async def _executed(self, handle: ServerGoalHandle) -> Any:
        if handle.is_cancel_requested:
            handle.canceled()
            return self._result(ResultCode.INVALID_GOAL, 'cancelled before its start')
        try:
            loop, goal = self._start(handle.request)
        except Exception as error:
            self._input.refuse(error)
            handle.abort()
            return self._result(_code_of(error), describe_error(error))
        done = Future()
        with self._lock:
            self._running.append(_Running(handle, loop, goal, done))
        if goal.result is not None:
            self._ended.trigger()
        await done
        result = goal.result
        assert result is not None
        if result.is_canceled:
            handle.canceled()
        elif result.code is ResultCode.SUCCESSFUL:
            handle.succeed()
        else:
            handle.abort()
        self._node.get_logger().info(
            f'~/follow_joint_trajectory: {result.code.name}{": " * bool(result.message)}'
            f'{result.message}')
        return self._result(result.code, result.message)

    def _start(self, request: Any) -> tuple[ControlLoop, TrajectoryGoal]:
        served = self._path.command.served
        if served is None:
            raise InvalidInputError('no model yet: no trajectory can be followed')
        loop, names = served.loop, served.arm.joint_names
        for field in ('multi_dof_trajectory.joint_names', 'component_path_tolerance',
                      'component_goal_tolerance'):
            values = attrgetter(field)(request)
            if len(values):
                raise InvalidInputError(
                    f'{field} has {len(values)} entries, expected none: each joint of an arm has '
                    'one degree of freedom')
        trajectory = trajectory_from_ros(request.trajectory, names)
        tolerances = tolerances_of(request, served.arm, served.values)
        goal = loop.goals.execute(
            trajectory, stamp_from_ros(request.trajectory.header.stamp), tolerances,
            self._ended.trigger, self._open[id(request)])
        self._input.accept(loop, trajectory)
        return loop, goal

    def _look(self) -> None:
        """Stop for goals that are cancelled, and report the goals that have ended."""
        waiting = []
        with self._lock:
            for one in self._running:
                handle, loop, goal, done = one
                if goal.result is not None and not (
                        goal.result.is_canceled and not handle.is_cancel_requested):
                    done.set_result(None)
                    continue
                waiting.append(one)
                if handle.is_cancel_requested:
                    loop.goals.cancel(goal)
            self._running = waiting
            self._feedback.run(bool(self._open))

    def _publish_feedback(self) -> None:
        self._look()
        for handle, loop, goal, _ in list(self._running):
            if goal.progress is not None:
                handle.publish_feedback(self._as_feedback(loop, goal.progress))

    def _as_feedback(self, loop: ControlLoop, progress: GoalFeedback) -> Any:
        message, controller = self._type.Feedback(), loop.controller
        q, desired = progress.position, progress.desired
        message.header.stamp = stamp_to_ros(progress.stamp_ns)
        message.joint_names = list(controller.arm.joint_names)
        message.desired = _point(*desired)
        message.actual = _point(q, progress.velocity)
        message.error = _point(
            controller.position_error(desired.position, q),
            desired.velocity - progress.velocity)
        return message

    def _result(self, code: ResultCode, message: str) -> Any:
        result = self._type.Result
        return result(error_code=getattr(result, code.name), error_string=message)


def _point(
    q: FloatArray, v: FloatArray, a: FloatArray | None = None,
) -> JointTrajectoryPoint:
    return JointTrajectoryPoint(
        positions=floats_to_ros(q), velocities=floats_to_ros(v),
        accelerations=[] if a is None else floats_to_ros(a))


def _code_of(error: Exception) -> ResultCode:
    if isinstance(error, JointNamesError):
        return ResultCode.INVALID_JOINTS
    if isinstance(error, PastTrajectoryError):
        return ResultCode.OLD_HEADER_TIMESTAMP
    return ResultCode.INVALID_GOAL


class _Turn:
    """Awaitable once: until the executor has waited for its next event."""

    def __await__(self) -> Generator[None, None, None]:
        yield


class _GuardedServer(ActionServer):
    """An action server that a request which cannot be read does not end."""

    def take_data(self) -> Any:
        try:
            return super().take_data()
        except Exception as error:
            self._log(error)
            return {}

    async def execute(self, taken_data: Any) -> None:
        try:
            await super().execute(taken_data)
        except Exception as error:
            self._log(error)

    def _log(self, error: Exception) -> None:
        self._node.get_logger().error(
            f'Rejected a request of ~/follow_joint_trajectory: {describe_error(error)}',
            throttle_duration_sec=LOG_PERIOD)
