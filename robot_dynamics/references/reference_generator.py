# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
An online trajectory generator: references that the arm can follow, for any input.

A new trajectory is entered from the present reference (position, velocity and acceleration) by a
plan within `MotionLimits` (`planner`):

- a set-point without a velocity is a goal at rest, reached as early as the limits permit, but not
  before its time; if the same set-point is repeated, the plan remains unchanged, unless its time
  is earlier;
- a stream of such set-points is followed smoothly: each plan takes at least `HORIZON`, `PERIODS`
  of the stream and twice the duration of the earliest stop;
- a set-point with a velocity is a moving target, one period of the stream after its arrival; it is
  met as early as the limits permit, and followed up to the timeout of the stream; then the joints
  stop;
- a trajectory of several points that starts at rest is delayed until the arm is at its start;
- any other trajectory, and one that has already begun, is met on its path, at its own times. If
  that is impossible, the motion leads to rest at its end.

The plan is computed once, when a trajectory arrives; the cost per state is that of any trajectory.
A change of the limits takes effect at the next plan.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.references import planner
from robot_dynamics.references.active_trajectory import ActiveTrajectory
from robot_dynamics.references.motion_limits import MotionLimits
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import (
    check_end_in_future,
    JointTrajectory,
    nanoseconds,
    TrajectoryPoint,
)
from robot_dynamics.validation import check_vector, LARGEST_VALUE

SET_POINT_MAX_AGE_NS = NANOSECONDS_PER_SECOND
"""[ns] until which a set-point is due now: a sender with another clock is always late."""
LONGEST_PERIOD = 0.5
"""Largest interval [s] between two set-points of one stream."""
HORIZON = 0.1
"""Shortest time [s] in which the last position of a stream without velocities is reached."""
PERIODS = 4.0
"""The same time in periods, whose mean is that of twice as many. The lag is 2/3 of the time."""
FIRST_PERIOD = HORIZON / PERIODS
"""Period [s] of a stream before its second set-point."""
ON_PATH = 1e-6
"""Distance [rad] or [m], and [rad/s] or [m/s], up to which a reference is on a path."""
OF_LIMIT = 0.95
"""Largest velocity of a moving target as a fraction of its limit; the rest is to catch up."""
FIRST_MEETING = 0.01
"""Shortest time [s] after which a motion meets a path."""
_SAME_TIME_NS = 1_000_000
"""[ns] by which a goal has to be earlier for a new plan."""


class ReferenceGenerator:
    """
    The active trajectory, entered and left within limits.

    `active` is that trajectory, None before the first one and after `clear()`.
    """

    def __init__(
        self, joint_names: Sequence[str], continuous_joints: Sequence[str] = (),
        limits: MotionLimits | None = None, stream_timeout: float = 0.1,
    ) -> None:
        """
        Take the arm's joints, in the order of all arrays.

        `continuous_joints` move to the first point along the shortest angular distance. Without
        `limits`, trajectories are followed unchanged. A set-point with a velocity is followed for
        at most `stream_timeout` [s].
        """
        self.joint_names = tuple(joint_names)
        self._continuous = [name in continuous_joints for name in joint_names]
        self.limits, self.stream_timeout = limits, stream_timeout
        self.active: ActiveTrajectory | None = None
        self._set_point: tuple[int, TrajectoryPoint] | None = None
        """The last set-point of the stream, and when it arrived [ns]."""
        self._period = 0.0
        """Mean interval [s] between the set-points of the stream; 0 before the second one."""
        self._arrival_ns = 0
        """The time of the last goal at rest; it arrives then or later."""

    def start(
        self, trajectory: JointTrajectory, now_ns: int, position: npt.ArrayLike,
        velocity: npt.ArrayLike, stamp_ns: int = 0,
    ) -> ActiveTrajectory:
        """
        Follow `trajectory` from now on, instead of the active one.

        `stamp_ns` is the time of its time 0; 0 means now. The reference continues from the active
        reference at `now_ns`. Without a reference, it starts from the measured `position` (n,)
        [rad or m] and `velocity` (n,) [rad/s or m/s]. The old trajectory is discarded at once,
        even if the new one starts later.

        Raises TrajectoryError for other joints or an end in the past, and InvalidInputError for
        an invalid measured state; the active trajectory then remains active.
        """
        self.check_joints(trajectory)
        is_set_point, first = trajectory.is_set_point, trajectory.points[0]
        check_end_in_future(
            trajectory, stamp_ns, now_ns, SET_POINT_MAX_AGE_NS if is_set_point else 0)
        state = self._state_at(now_ns, position, velocity)
        state = state._replace(position=self._turned(state.position, first.position))
        path = ActiveTrajectory(trajectory, stamp_ns or now_ns, now_ns, state)
        before, self._set_point = self._set_point, (now_ns, first) if is_set_point else None
        if self.limits is None:
            self.active = path
        elif not is_set_point:
            self.active = _entered(path, now_ns, state, self.limits)
        else:
            wait = max(path.start_ns - now_ns + trajectory.times_ns[0], 0)
            is_earlier = now_ns + wait + _SAME_TIME_NS < self._arrival_ns
            if self.active is None or is_earlier or before is None or not (
                    _is_same_goal(before[1], first)):
                self._arrival_ns = now_ns + wait
                plan = self._to_set_point(
                    first, wait / NANOSECONDS_PER_SECOND, now_ns, state, before, self.limits)
                self.active = ActiveTrajectory(trajectory, path.start_ns, now_ns, state, plan)
        return self.active

    def check_joints(self, trajectory: JointTrajectory) -> None:
        """Raise TrajectoryError for joints other than those of the arm, in its order."""
        if trajectory.joint_names != self.joint_names:
            raise TrajectoryError(
                f'joint_names is {list(trajectory.joint_names)}, expected '
                f'{list(self.joint_names)}, in this order')

    def sample(self, now_ns: int) -> Reference | None:
        """Return the reference at `now_ns`, or None while there is no trajectory."""
        return None if self.active is None else self.active.sample(now_ns)

    def clear(self) -> None:
        """Discard trajectory and stream; the next trajectory starts from the measured state."""
        self.active = self._set_point = None

    def stop(self, now_ns: int, position: FloatArray, velocity: FloatArray) -> None:
        """
        Stop each joint as early as the limits permit, then hold the position.

        The stop begins at the reference, or without one at the measured state, (n,) each.
        """
        state, before = self._state_at(now_ns, position, velocity), self.active
        plan = None if self.limits is None else planner.plan_stop(state, self.limits)
        end = state.position if plan is None else plan.end.position
        point = TrajectoryPoint(0.0, end, *np.zeros((2, len(end))))
        self._set_point = None
        self.active = ActiveTrajectory(
            JointTrajectory(self.joint_names, (point,)), now_ns, now_ns, state, plan,
            before is None or before.is_from_measurement)

    def _state_at(
        self, now_ns: int, position: npt.ArrayLike, velocity: npt.ArrayLike,
    ) -> Reference:
        reference = self.sample(now_ns)
        if reference is not None and (np.abs(reference) <= LARGEST_VALUE).all():
            return planner.without_creep(reference)
        n, names = len(self.joint_names), self.joint_names
        q = check_vector('position', position, n, names, LARGEST_VALUE)
        v = check_vector('velocity', velocity, n, names, LARGEST_VALUE)
        return planner.without_creep(Reference(q, v, np.zeros(n)))

    def _turned(self, q: FloatArray, target: FloatArray) -> FloatArray:
        turns = np.where(self._continuous, (target - q) / (2.0 * np.pi), 0.0)
        # At a distance of exactly half a turn, keep the sign of the difference.
        whole = np.maximum(np.ceil(np.abs(turns) - 0.5 - 1e-9), 0.0)
        return q + 2.0 * np.pi * np.copysign(whole, turns)

    def _to_set_point(
        self, point: TrajectoryPoint, wait: float, now_ns: int, state: Reference,
        before: tuple[int, TrajectoryPoint] | None, limits: MotionLimits,
    ) -> planner.Plan:
        interval = 0.0 if before is None else (now_ns - before[0]) / NANOSECONDS_PER_SECOND
        if before is None or not 0.0 <= interval <= LONGEST_PERIOD or (
                (before[1].velocity is None) != (point.velocity is None)):
            before, self._period = None, 0.0
        elif interval > 0.0:  # A gap is no change of the rate; a shorter period is one at once.
            period = min(self._period or interval, 2.0 * interval)
            self._period = period + (min(interval, 2.0 * period) - period) / (2.0 * PERIODS)
        if point.velocity is None:
            horizon = 0.0 if before is None else max(HORIZON, PERIODS * self._period)
            return planner.plan_to_goal(
                state, point.position, limits, max(wait, horizon), before is not None)
        period, most = self._period or FIRST_PERIOD, limits.lowered.whole.velocity
        time, v, a = max(wait, period), point.velocity, point.acceleration
        if a is None:
            last = None if before is None else before[1].velocity
            a = (v - (v if last is None else last)) / max(interval, period)
        # The velocity of the target stays within its limit while it is followed.
        v = np.clip(v, -OF_LIMIT * most, OF_LIMIT * most)
        most_a = np.minimum(limits.lowered.acceleration,
                            (most - np.abs(v)) / (time + self.stream_timeout))
        return planner.plan_with_target(
            state, Reference(point.position, v, np.clip(a, -most_a, most_a)), time, limits,
            self.stream_timeout)


def _entered(
    path: ActiveTrajectory, now_ns: int, state: Reference, limits: MotionLimits,
) -> ActiveTrajectory:
    """Return a trajectory of several points that is entered within limits."""
    first, start_ns = path.trajectory.points[0], path.start_ns
    wait_ns, begin = start_ns - now_ns + path.trajectory.times_ns[0], path.sample(now_ns)
    if wait_ns <= 0 and all(
            (np.abs(x - y) <= ON_PATH).all() for x, y in zip(begin[:2], state[:2])):
        return path
    wait = wait_ns / NANOSECONDS_PER_SECOND
    if wait_ns >= 0 and (first.velocity is None or not first.velocity.any()):
        plan = planner.plan_to_goal(state, first.position, limits, wait)
        start_ns += max(nanoseconds(plan.duration) - wait_ns, 0)
    else:
        plan = _to_path(path, wait, now_ns, state, limits)
    return ActiveTrajectory(path.trajectory, start_ns, now_ns, state, plan)


def _to_path(
    path: ActiveTrajectory, wait: float, now_ns: int, state: Reference, limits: MotionLimits,
) -> planner.Plan:
    """Return the plan that meets a path at its own times, after `wait` [s] or later."""
    left, first = (path.end_ns - now_ns) / NANOSECONDS_PER_SECOND, max(wait, FIRST_MEETING)
    # The times to try are a quarter of an octave apart; the last one is the end of the path.
    times = [*first * 2.0 ** np.arange(0.0, np.log2(max(left / first, 1.0)), 0.25), left]
    states = ((t, path.sample(now_ns + nanoseconds(t))) for t in times)
    return planner.plan_to_path(state, states, limits) or planner.plan_to_goal(
        state, path.sample(path.end_ns).position, limits, left)


def _is_same_goal(point: TrajectoryPoint, other: TrajectoryPoint) -> bool:
    return point.velocity is other.velocity is None and bool(
        (point.position == other.position).all())
