# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A trajectory that is executed within tolerances, with a result, without ROS.

The rules are those of the action `control_msgs/action/FollowJointTrajectory` and of
`joint_trajectory_controller` (ros2_controllers, branch jazzy), with the differences that
docs/trajectories.md lists. `ControlLoop.execute` starts a goal, and judges it after each state.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import auto, Enum
import math
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.gains.oscillation import REST_SPEED
from robot_dynamics.joints.units import units_of
from robot_dynamics.trajectories.interpolation import Reference

LATE = 0.5
"""[s] by which a goal may end late because the arm is not yet at its first point; and after the
end of a reference, until which the arm may move."""
REST_TIME_NS = 20_000_000
"""[ns] over which no joint of an arm at rest moves faster than REST_SPEED."""
GOAL_TOLERANCE = 0.01
"""Default distance [rad] or [m] from the goal at which it is reached."""
DEFAULT_GOAL_TIME = 5.0
"""[s] after the end of the trajectory for the arm to reach the goal, without a given time; also
after the planned stop of a cancelled goal for the arm to be at rest."""


class ResultCode(Enum):
    """The names of the error codes of the result of `FollowJointTrajectory`."""

    SUCCESSFUL = auto()
    INVALID_GOAL = auto()
    INVALID_JOINTS = auto()
    OLD_HEADER_TIMESTAMP = auto()
    PATH_TOLERANCE_VIOLATED = auto()
    GOAL_TOLERANCE_VIOLATED = auto()


class GoalResult(NamedTuple):
    """How a goal ended: its code, the reason, and whether it was cancelled."""

    code: ResultCode
    message: str = ''
    is_canceled: bool = False


@dataclass(frozen=True)
class Tolerances:
    """
    Tolerances of position [rad] or [m] and velocity [rad/s] or [m/s], (n,) each, ∞ for none.

    Path tolerances apply during the motion, goal tolerances at its end, within `goal_time` [s]. A
    `goal_velocity` of NaN requires rest: at most REST_SPEED over REST_TIME_NS.
    """

    path: FloatArray
    path_velocity: FloatArray
    goal: FloatArray
    goal_velocity: FloatArray
    goal_time: float = DEFAULT_GOAL_TIME


def default_tolerances(
    joint_names: Sequence[str], goal: FloatArray | None = None,
) -> Tolerances:
    """Return tolerances of the `goal` (n,) only, 0 for none."""
    n = len(joint_names)
    goal = np.full(n, GOAL_TOLERANCE) if goal is None else goal
    none = np.full(n, math.inf)
    return Tolerances(none, none, np.where(goal > 0.0, goal, math.inf), np.full(n, math.nan))


class GoalFeedback(NamedTuple):
    """A state with its reference: the stamp [ns], and position and velocity (n,)."""

    stamp_ns: int
    position: FloatArray
    velocity: FloatArray
    desired: Reference


class TrajectoryGoal:
    """One goal; `ControlLoop` calls its methods with its lock held."""

    def __init__(
        self, controller: Controller, tolerances: Tolerances,
        when_done: Callable[[], object] = lambda: None,
    ) -> None:
        """Judge the trajectory that the controller follows now; `when_done` must return soon."""
        self._controller, self._tolerances = controller, tolerances
        self._when_done, self._names = when_done, controller.arm.joint_names
        self._recent: deque[tuple[int, FloatArray]] = deque()
        """Stamps and positions of the last REST_TIME_NS, at least the last two."""
        self.is_stopping = False
        """Whether the goal was cancelled, and the arm stops."""
        self.result: GoalResult | None = None
        """The result, None while the goal is active."""
        self.progress: GoalFeedback | None = None
        """The newest state, with its reference."""

    def end(self, code: ResultCode, message: str = '', is_canceled: bool = False) -> None:
        """Set the result, unless there is one."""
        if self.result is None:
            self.result = GoalResult(code, message, is_canceled)
            self._when_done()

    def cancel(self) -> None:
        """Stop the arm; the goal ends when it is at rest."""
        if self.result is None and not self.is_stopping:
            self._controller.stop()
            self.is_stopping = True

    def judge(self, stamp_ns: int, q: FloatArray, v: FloatArray) -> None:
        """Compare a state (n,) with the tolerances, and end the goal if it has a result."""
        active = self._controller.trajectory
        if active is None:
            return
        desired = active.sample(stamp_ns)
        self.progress = GoalFeedback(stamp_ns, q, v, desired)
        recent = self._recent
        if recent and stamp_ns <= recent[-1][0]:
            recent.clear()
        recent.append((stamp_ns, q))
        while len(recent) > 2 and stamp_ns - recent[0][0] > REST_TIME_NS:
            recent.popleft()
        late = (stamp_ns - active.end_ns) / NANOSECONDS_PER_SECOND
        if self.is_stopping:
            if late >= 0.0 and self._is_at_rest():
                self.end(ResultCode.INVALID_GOAL, 'cancelled: the arm is at rest', True)
            elif late > DEFAULT_GOAL_TIME:
                self.end(
                    ResultCode.GOAL_TOLERANCE_VIOLATED,
                    f'cancelled, but the arm is not at rest {DEFAULT_GOAL_TIME:g} s after its '
                    'stop')
            return
        e = self._controller.position_error(desired.position, q)
        e_v = desired.velocity - v
        allowed = self._tolerances
        if late < 0.0:
            violation = self._violation(e, allowed.path, e_v, allowed.path_velocity)
            if violation:
                self._controller.stop()
                self.end(ResultCode.PATH_TOLERANCE_VIOLATED, f'path tolerance: {violation}')
            return
        must_rest = np.isnan(allowed.goal_velocity)
        violation = self._violation(
            e, allowed.goal, e_v, np.where(must_rest, math.inf, allowed.goal_velocity))
        if not violation and must_rest.any() and not self._is_at_rest():
            violation = 'the arm is not at rest'
        if not violation:
            self.end(ResultCode.SUCCESSFUL)
        elif late > allowed.goal_time:
            self.end(
                ResultCode.GOAL_TOLERANCE_VIOLATED,
                f'goal tolerance, {allowed.goal_time:g} s after the end: {violation}')

    def _is_at_rest(self) -> bool:
        """Return whether the recent states are close to the last one."""
        (first, _), (stamp, q) = self._recent[0], self._recent[-1]
        most = 1e-9 * REST_SPEED * min(stamp - first, 2 * REST_TIME_NS)  # of slow states
        return len(self._recent) > 1 and all(bool(
            (np.abs(self._controller.position_error(one, q)) <= most).all())
            for _, one in self._recent)

    def _violation(
        self, e: FloatArray, most_e: FloatArray, e_v: FloatArray, most_v: FloatArray,
    ) -> str:
        """Return the joint that exceeds its tolerance most, or nothing; all arrays are (n,)."""
        for error, most, of in ((e, most_e, ''), (e_v, most_v, 'the velocity of ')):
            j = int(np.argmax(np.abs(error) / most))
            if not abs(error[j]) <= most[j]:
                units = units_of(self._controller.arm.joint_kinds[j])
                texts = [f'{x:.3g} {units.position}/s' if of else units.error_text(x)
                         for x in (abs(error[j]), most[j])]
                return f'{of}{self._names[j]!r} is {texts[0]} off, expected at most {texts[1]}'
        return ''
