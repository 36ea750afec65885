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
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.references import planner
from robot_dynamics.references.follower import ActiveTrajectory, TrajectoryFollower
from robot_dynamics.references.joint_planner import Target
from robot_dynamics.references.motion_limits import MotionLimits
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import (
    JointTrajectory,
    nanoseconds,
    TrajectoryPoint,
)

LONGEST_PERIOD = 0.5
"""Largest interval [s] between two set-points of one stream."""
HORIZON = 0.1
"""Shortest time [s] in which the last position of a stream without velocities is reached."""
PERIODS = 4.0
"""The same time in periods of the stream; the reference lags by 2/3 of the longest time."""
FIRST_PERIOD = 0.02
"""Shortest time [s] in which the first set-point of a stream with velocities is met."""
ON_PATH = 1e-6
"""Distance [rad] or [m], and [rad/s] or [m/s], up to which a reference is on a path."""
_MEETINGS: FloatArray = np.geomspace(0.004, 20.0, 48)
"""[s] after which a motion may meet a path."""
_OF_LIMIT = 0.95
"""Largest velocity of a moving target as a fraction of its limit; the rest is to catch up."""
_NEW = 0.2
"""Weight of the last interval of a stream in its mean period."""
_SAME_TIME_NS = 1_000_000
"""[ns] by which a goal has to be earlier for a new plan."""
_APART = 3e-6
"""[s] by which a motion to the first point ends early, which permits rounding of durations."""


class ReferenceGenerator(TrajectoryFollower):
    """The active trajectory, entered and left within limits."""

    def __init__(
        self, joint_names: Sequence[str], continuous_joints: Sequence[str],
        limits: MotionLimits | None, stream_timeout: float = 0.1,
    ) -> None:
        """
        Without `limits`, trajectories are followed unchanged.

        A set-point with a velocity is followed for at most `stream_timeout` [s].
        """
        super().__init__(joint_names, continuous_joints)
        self.limits = limits
        self.stream_timeout = stream_timeout
        self._set_point: tuple[int, TrajectoryPoint] | None = None
        self._period = 0.0
        """Mean interval [s] between the set-points of the stream; 0 before the second one."""
        self._arrival_ns = 0
        """The time of the last goal at rest; it arrives then or later."""

    def clear(self) -> None:
        """Discard trajectory and stream; the next trajectory starts from the measured state."""
        super().clear()
        self._set_point = None

    def stop(self, now_ns: int, position: FloatArray, velocity: FloatArray) -> None:
        """
        Stop each joint as early as the limits permit, then hold the position.

        The stop begins at the reference, or without one at the measured state, (n,) each.
        """
        state, plan = planner.without_creep(self._state_at(now_ns, position, velocity)), None
        end = state.position
        if self.limits is not None:
            plan = planner.plan_stop(state, self.limits)
            end = plan.end.position
        self._set_point = None
        point, before = TrajectoryPoint(0.0, end, *np.zeros((2, len(end)))), self.active
        self.active = ActiveTrajectory(
            JointTrajectory(self.joint_names, (point,)), now_ns, now_ns, state, plan,
            before is None or before.is_from_measurement)

    def _entered(
        self, trajectory: JointTrajectory, start_ns: int, now_ns: int, state: Reference,
    ) -> ActiveTrajectory:
        limits = self.limits
        if limits is None:
            self._set_point = None
            return super()._entered(trajectory, start_ns, now_ns, state)
        state = planner.without_creep(state)
        first = trajectory.points[0]
        wait = (start_ns - now_ns) / NANOSECONDS_PER_SECOND + first.time_from_start
        if trajectory.is_set_point:
            before, self._set_point = self._set_point, (now_ns, first)
            arrival_ns = now_ns + nanoseconds(max(wait, 0.0))
            is_earlier = arrival_ns + _SAME_TIME_NS < self._arrival_ns
            if before is not None and self.active is not None and not is_earlier and (
                    _is_same_goal(before[1], first)):
                return self.active
            self._arrival_ns = arrival_ns
            plan = self._to_set_point(first, max(wait, 0.0), now_ns, state, before, limits)
            return ActiveTrajectory(trajectory, start_ns, now_ns, state, plan)
        self._set_point = None
        path = ActiveTrajectory(trajectory, start_ns, now_ns, state)
        if wait <= 0.0 and _is_near(path.sample(now_ns), state):
            return path
        if wait >= 0.0 and (first.velocity is None or not first.velocity.any()):
            plan = planner.plan_to_goal(state, first.position, limits, max(wait - _APART, 0.0))
            start_ns += max(nanoseconds(plan.duration - wait), 0)
        else:
            plan = _to_path(path, wait, now_ns, state, limits)
        return ActiveTrajectory(trajectory, start_ns, now_ns, state, plan)

    def _to_set_point(
        self, point: TrajectoryPoint, wait: float, now_ns: int, state: Reference,
        before: tuple[int, TrajectoryPoint] | None, limits: MotionLimits,
    ) -> planner.Plan:
        interval = 0.0 if before is None else (now_ns - before[0]) / NANOSECONDS_PER_SECOND
        if before is None or not 0.0 <= interval <= LONGEST_PERIOD or (
                (before[1].velocity is None) != (point.velocity is None)):
            before, self._period = None, 0.0
        elif not self._period or 0.0 < interval < 0.5 * self._period:
            self._period = interval
        elif interval > 0.0:  # A gap is no change of the rate.
            self._period += _NEW * (min(interval, 2.0 * self._period) - self._period)
        if point.velocity is None:
            horizon = 0.0 if before is None else max(HORIZON, PERIODS * self._period)
            return planner.plan_to_goal(state, point.position, limits, max(wait, horizon), horizon)
        time = max(wait, self._period or FIRST_PERIOD)
        last = None if before is None else before[1]
        target = _target(point, last, max(interval, self._period), time)
        return planner.plan_with_target(
            state, self._within_limits(target, limits), limits, self.stream_timeout)

    def _within_limits(self, target: Target, limits: MotionLimits) -> Target:
        """Return the target with a velocity that stays within its limit while it is followed."""
        most = limits.scale * limits.whole.velocity
        v = np.clip(target.velocity, -_OF_LIMIT * most, _OF_LIMIT * most)
        most_a = np.minimum(limits.scale**2 * limits.acceleration,
                            (most - np.abs(v)) / (target.time + self.stream_timeout))
        return target._replace(
            velocity=v, acceleration=np.clip(target.acceleration, -most_a, most_a))


def _target(
    point: TrajectoryPoint, before: TrajectoryPoint | None, interval: float, time: float,
) -> Target:
    """Return the target of a point, at `time` [s], that came `interval` [s] after `before`."""
    v, a = point.velocity, point.acceleration
    assert v is not None
    if a is None:
        a = np.zeros_like(v)
        if before is not None and before.velocity is not None and interval > 0.0:
            a = (v - before.velocity) / interval
    since = np.full_like(v, time)
    if before is not None:
        # The target was at the point before, up to the distance that it covers in the time.
        error = before.position + (v - 0.5 * a * time) * time - point.position
        since[np.abs(error) <= (np.abs(v) + np.abs(a) * time) * time] = 0.0
    return Target(point.position, v, a, time, since)


def _to_path(
    path: ActiveTrajectory, wait: float, now_ns: int, state: Reference, limits: MotionLimits,
) -> planner.Plan:
    """Return the plan that meets a path at its own times, after `wait` [s] or later."""
    times = _MEETINGS if wait <= 0.0 else wait * np.geomspace(1.0, 100.0, 48)
    left = (path.end_ns - now_ns) / NANOSECONDS_PER_SECOND
    states = ((t, path.sample(now_ns + nanoseconds(t))) for t in times[times <= left].tolist())
    return planner.plan_to_path(state, states, limits) or planner.plan_to_goal(
        state, path.sample(path.end_ns).position, limits, max(left, 0.0))


def _is_same_goal(point: TrajectoryPoint, other: TrajectoryPoint) -> bool:
    return point.velocity is other.velocity is None and bool(
        (point.position == other.position).all())


def _is_near(path: Reference, state: Reference) -> bool:
    return bool(
        np.abs(path.position - state.position).max(initial=0.0) <= ON_PATH
        and np.abs(path.velocity - state.velocity).max(initial=0.0) <= ON_PATH)
