# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
An online trajectory generator: references that the arm can follow, for any input.

A new trajectory is entered from the present reference (position, velocity and acceleration) by a
quintic within `MotionLimits`:

- a set-point without a velocity is a goal at rest, reached as early as the limits permit, but not
  before its time; if the same set-point is repeated, the plan remains unchanged, unless its time
  is earlier;
- a set-point with a velocity is a moving target; it is met one period of the stream after its
  arrival, or as early as the limits permit; when the stream ends, a planned stop follows;
- a trajectory of several points that starts at rest is delayed until the arm is at its start;
- any other trajectory, and one that has already begun, is met on its path, at its own times.

The plan is computed once, when a trajectory arrives; the cost per state is that of any trajectory.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.trajectories.follower import ActiveTrajectory, TrajectoryFollower
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import (
    JointTrajectory,
    nanoseconds,
    TrajectoryPoint,
)
from robot_dynamics.trajectories.motion_limits import (
    EFFORT_FRACTION,
    MotionLimits,
    VELOCITY_FRACTION,
)
from robot_dynamics.trajectories.point_to_point import (
    goal_points,
    meeting_points,
    stop_points,
    without_creep,
)

LONGEST_PERIOD = 0.5
"""Largest interval [s] between two set-points of one stream."""
HORIZON = 0.1
"""Shortest time [s] in which the last position of a stream without velocities is reached."""
PERIODS = 4.0
"""The same time in periods of the stream; the reference lags by 0.6 times the longer one."""
FIRST_PERIOD = 0.02
"""Shortest time [s] in which the first set-point of a stream with velocities is met."""
ON_PATH = 1e-6
"""Distance [rad] or [m], and [rad/s] or [m/s], up to which a reference is on a path."""
_LONGEST = 20.0
_MEETINGS: FloatArray = np.geomspace(0.004, _LONGEST, 48)
_STOP_POINTS = 12
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
        self._arrival_ns = 0
        """The time of the last goal at rest; it arrives then or later."""

    def clear(self) -> None:
        """Discard trajectory and stream; the next trajectory starts from the measured state."""
        super().clear()
        self._set_point = None

    def shift_time(self, shift_ns: int) -> None:
        """Lower the times of the active trajectory by `shift_ns`, as for a shifted clock."""
        super().shift_time(shift_ns)
        self._set_point = None

    def stop(self, now_ns: int, position: FloatArray, velocity: FloatArray) -> None:
        """
        Stop as early as the limits permit along the active path, then hold the position.

        Without a path, the stop begins at the measured state, (n,) each.
        """
        limits, active = self.limits, self.active
        state = self._state_at(now_ns, position, velocity)
        if limits is None:
            n = len(self.joint_names)
            points = [TrajectoryPoint(0.0, state.position, np.zeros(n), np.zeros(n))]
        elif active is None:
            points = stop_points(state, limits)
        else:
            points = _stop_on_path(active, now_ns, state, limits)
        self._set_point = None
        self.active = ActiveTrajectory(
            JointTrajectory(self.joint_names, tuple(points[-1:])), now_ns, now_ns, state, points)

    def _entered(
        self, trajectory: JointTrajectory, start_ns: int, now_ns: int, state: Reference,
    ) -> ActiveTrajectory:
        if self.limits is None:
            self._set_point = None
            return super()._entered(trajectory, start_ns, now_ns, state)
        state = without_creep(state)
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
            lead_in = self._to_set_point(first, max(wait, 0.0), now_ns, state, before)
        else:
            self._set_point = None
            path = ActiveTrajectory(trajectory, start_ns, now_ns, state)
            if wait <= 0.0 and _is_near(path.sample(now_ns), state):
                lead_in = []
            elif wait >= 0.0 and (first.velocity is None or not first.velocity.any()):
                lead_in = goal_points(
                    state, first.position, self.limits, max(wait - _APART, 0.0))
                start_ns += max(nanoseconds(lead_in[-1].time_from_start - wait), 0)
            else:
                lead_in = self._to_path(path, wait, now_ns, state)
        return ActiveTrajectory(trajectory, start_ns, now_ns, state, lead_in)

    def _to_set_point(
        self, point: TrajectoryPoint, wait: float, now_ns: int, state: Reference,
        before: tuple[int, TrajectoryPoint] | None,
    ) -> list[TrajectoryPoint]:
        assert self.limits is not None
        period = (now_ns - before[0]) / NANOSECONDS_PER_SECOND if before is not None else 0.0
        if before is None or period > LONGEST_PERIOD:
            before, period = None, 0.0
        if point.velocity is None:
            horizon = 0.0 if before is None else max(HORIZON, PERIODS * period)
            return goal_points(state, point.position, self.limits, max(wait, horizon), horizon)
        return self._to_moving(point, max(wait, period or FIRST_PERIOD), state, before, period)

    def _to_moving(
        self, point: TrajectoryPoint, wait: float, state: Reference,
        before: tuple[int, TrajectoryPoint] | None, period: float,
    ) -> list[TrajectoryPoint]:
        """Return the points that meet a moving set-point, follow it, and stop at the timeout."""
        assert self.limits is not None
        assert point.velocity is not None
        limits = whole(self.limits)
        v, a = np.clip(point.velocity, -limits.velocity, limits.velocity), point.acceleration
        if a is None:
            a = np.zeros_like(v)
            if before is not None and before[1].velocity is not None and period > 0.0:
                a = (v - before[1].velocity) / period
        a = np.clip(a, -limits.acceleration, limits.acceleration)

        def target(T: FloatArray) -> Reference:
            t = (T - wait)[:, np.newaxis]
            s = np.minimum(t, self.stream_timeout)
            return Reference(
                point.position + v * t + a * s * (t - 0.5 * s),
                np.clip(v + a * s, -limits.velocity, limits.velocity), np.where(t > s, 0.0, a))

        T: FloatArray = wait * np.geomspace(1.0, max(200.0, _LONGEST / wait), 48)
        points = _meeting(state, target, T, self.limits, point.position)
        last = points[-1]
        assert last.velocity is not None
        until = last.time_from_start + self.stream_timeout
        end = Reference(
            last.position + self.stream_timeout * last.velocity, last.velocity, np.zeros_like(v))
        return [*points, TrajectoryPoint(until, *end), *_later(
            stop_points(end, self.limits), until)]

    def _to_path(
        self, path: ActiveTrajectory, wait: float, now_ns: int, state: Reference,
    ) -> list[TrajectoryPoint]:
        """Return the points that meet a path at its own times, after `wait` [s] or later."""
        assert self.limits is not None

        def target(T: FloatArray) -> Reference:
            samples = [path.sample(now_ns + nanoseconds(t)) for t in T.tolist()]
            return Reference(*(np.array([x[k] for x in samples]) for k in range(3)))

        T: FloatArray = _MEETINGS if wait <= 0.0 else wait * np.geomspace(1.0, 100.0, 48)
        end_ns = path.end_ns
        return _meeting(state, target, T, self.limits, path.sample(end_ns).position,
                        (end_ns - now_ns) / NANOSECONDS_PER_SECOND)


def whole(limits: MotionLimits) -> MotionLimits:
    """Return the unscaled limits, for a motion that the sender has planned."""
    return replace(
        limits, velocity=limits.velocity / VELOCITY_FRACTION,
        acceleration=limits.acceleration / EFFORT_FRACTION, jerk=limits.jerk / EFFORT_FRACTION)


def _meeting(
    state: Reference, target: Callable[[FloatArray], Reference], T: FloatArray,
    limits: MotionLimits, end: FloatArray, arrival: float = 0.0,
) -> list[TrajectoryPoint]:
    """
    Return the points that meet a target after one of the durations T (m,) [s], if possible.

    Otherwise the motion stops first. If it cannot meet the target from there, it leads to rest at
    `end` (n,), after `arrival` [s] or later.
    """
    points = meeting_points(state, target(T), T, whole(limits))
    if points:
        return points
    stop = stop_points(state, limits)
    since = stop[-1].time_from_start
    rest = Reference(stop[-1].position, 0.0 * state.velocity, 0.0 * state.velocity)
    points = meeting_points(rest, target(since + T), T, whole(limits)) or goal_points(
        rest, end, limits, arrival - since)
    return [*stop, *_later(points, since)]


def _later(points: list[TrajectoryPoint], time: float) -> list[TrajectoryPoint]:
    return [replace(point, time_from_start=time + point.time_from_start) for point in points]


def _is_same_goal(point: TrajectoryPoint, other: TrajectoryPoint) -> bool:
    return point.velocity is other.velocity is None and bool(
        (point.position == other.position).all())


def _is_near(path: Reference, state: Reference) -> bool:
    return bool(
        np.abs(path.position - state.position).max(initial=0.0) <= ON_PATH
        and np.abs(path.velocity - state.velocity).max(initial=0.0) <= ON_PATH)


def _stop_on_path(
    active: ActiveTrajectory, now_ns: int, state: Reference, limits: MotionLimits,
) -> list[TrajectoryPoint]:
    """
    Return the points of a stop on the path of a trajectory, whose time σ slows down to rest.

    σ(t) = T (u − u³ + u⁴/2) with u = t / T: σ̇ falls from 1 to 0 with σ̈ = 0 at both ends.
    """
    T = stop_points(state, limits)[-1].time_from_start
    u = np.arange(1, _STOP_POINTS + 1) / _STOP_POINTS
    rate, slope = 1.0 - 3.0 * u**2 + 2.0 * u**3, -6.0 * u + 6.0 * u**2
    points: list[TrajectoryPoint] = []
    for _ in range(8):
        sigma = T * (u - u**3 + 0.5 * u**4)
        samples = [active.sample(now_ns + nanoseconds(t)) for t in sigma.tolist()]
        points = [
            TrajectoryPoint(float(t), q, v * r, a * r * r + v * (r_dot / T))
            for t, r, r_dot, (q, v, a) in zip(T * u, rate, slope, samples)]
        if all((np.abs(p.acceleration) <= 2.0 * limits.acceleration).all()
               for p in points if p.acceleration is not None):
            break
        T *= 1.4
    return points
