# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The references that a control loop accepts: their start, their judgement and their early end."""

from collections.abc import Callable
import math

from robot_dynamics.control.controller import Controller
from robot_dynamics.control.followed_reference import Prepared
from robot_dynamics.control.safety.ending import Ending, Kind
from robot_dynamics.control.safety.faults import FOLLOWING_ERROR
from robot_dynamics.control.setpoint_stream import SetPointStream
from robot_dynamics.control.trajectory_goal import (
    default_tolerances,
    LATE,
    ResultCode,
    Tolerances,
    TrajectoryGoal,
)
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory

PAUSE = Ending(Kind.HOLD, 'the stream of set-points paused for more than reference_timeout')


class GoalExecution:
    """
    Set-points, trajectories and goals of one arm; safe to call from several threads.

    `ControlLoop` calls `judge`, `refuse` and `end` with its lock held.
    """

    def __init__(
        self, controller: Controller, obstacle: Callable[[], str], now: Callable[[], float],
    ) -> None:
        """
        Accept references for a controller.

        `obstacle` returns why no reference can be followed now, empty if one can. `now` returns
        the time of a steady clock [s].
        """
        self._controller, self._obstacle, self._now = controller, obstacle, now
        self.epoch, self._revoked = object(), 'another model is used'
        """Another object after each stop and fault, and the reason of the last one."""
        self.stream = SetPointStream(controller.options.stream_timeout)
        self.goal: TrajectoryGoal | None = None
        """The goal that is executed, or None."""
        self.interruption = ''
        """Reason why the last reference ended early, until the next reference."""
        self.paused_streams = 0

    def follow(self, trajectory: JointTrajectory, stamp_ns: int) -> None:
        """Follow a trajectory as `ControlLoop.follow` does."""
        epoch = self.epoch
        self._start(trajectory, self._prepared(trajectory), stamp_ns, epoch)

    def execute(
        self, trajectory: JointTrajectory, stamp_ns: int, tolerances: Tolerances | None,
        when_done: Callable[[], object], epoch: object = None,
    ) -> TrajectoryGoal:
        """
        Follow a trajectory and judge it as `ControlLoop.execute` does.

        `epoch` is that in which the goal was sent, by default the current one.
        """
        epoch = epoch or self.epoch
        prepared = self._prepared(trajectory)
        if round(prepared[1], 2) > 1.0:
            raise TrajectoryError(
                f'the trajectory would take {prepared[1]:.3g} times its duration, expected the '
                'duration itself: send a slower trajectory, such as that of ~/retime_trajectory')
        with self._controller.lock:
            self._start(
                trajectory, prepared, stamp_ns, epoch,
                math.inf if trajectory.is_set_point else LATE)
            self.goal = TrajectoryGoal(
                self._controller, tolerances or default_tolerances(trajectory.joint_names),
                when_done)
            return self.goal

    def _check_obstacle(self) -> None:
        if obstacle := self._obstacle():
            raise TrajectoryError(f'no reference can be followed now: {obstacle}')

    def _prepared(self, trajectory: JointTrajectory) -> Prepared:
        self._check_obstacle()
        return self._controller.prepare(trajectory)

    def _start(
        self, trajectory: JointTrajectory, prepared: Prepared, stamp_ns: int, epoch: object,
        latest: float = math.inf,
    ) -> None:
        with self._controller.lock:
            self._check_obstacle()
            if epoch is not self.epoch:
                raise TrajectoryError(self._revoked)
            self._controller.start(prepared, stamp_ns, latest)
            q = trajectory.points[-1].position.round(4).tolist()
            self._end_goal(f'another goal has replaced this one: {q}')
            self.stream.arrived(trajectory.is_set_point, self._now())
            self.interruption = ''

    def refuse(self, reason: str) -> None:
        """Refuse the references that were sent before and have not begun."""
        self.epoch, self._revoked = object(), reason

    def end(self, ending: Ending) -> None:
        """End the goal; unless a stream paused, refuse the references that were sent before."""
        if ending is not PAUSE:
            self.refuse(ending.reason)
        self.stream.end()
        if self._controller.trajectory is not None:
            self.interruption = ending.reason
        fault = ending.fault
        self._end_goal(ending.reason, ResultCode.PATH_TOLERANCE_VIOLATED if (
            fault is not None and fault.name == FOLLOWING_ERROR) else ResultCode.INVALID_GOAL)

    def _end_goal(self, reason: str, code: ResultCode = ResultCode.INVALID_GOAL) -> None:
        if self.goal is not None:
            goal, self.goal = self.goal, None
            goal.end(code, reason)

    def cancel(self, goal: TrajectoryGoal) -> None:
        """Stop the arm if it executes this goal, which ends when the arm is at rest."""
        with self._controller.lock:
            if goal is self.goal:
                self.stream.end()
                goal.cancel()

    def judge(self) -> None:
        """Compare the last state with the tolerances of the goal; forget a goal that has ended."""
        goal, state = self.goal, self._controller.state
        if goal is not None and state is not None:
            goal.judge(*state)
            if goal.result is not None:
                self.goal = None
                if goal.result.code is ResultCode.PATH_TOLERANCE_VIOLATED:
                    self.interruption = goal.result.message

    def pause(self) -> Ending:
        """Count a stream of set-points that has paused; return its ending."""
        self.paused_streams += 1
        return PAUSE
