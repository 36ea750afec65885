# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The active trajectory: its reference at a time.

Absolute times are whole nanoseconds, because 1.7e9 s since the epoch, as a 64-bit float, has a
resolution of only 2e-7 s. Durations are in seconds.
"""

from bisect import bisect_right
import sys

import numpy as np
from robot_dynamics.arrays import NANOSECONDS_PER_SECOND
from robot_dynamics.references.planner import Plan
from robot_dynamics.trajectories.interpolation import (
    constant_segment,
    evaluate,
    motion_coefficients,
    Reference,
    Segment,
)
from robot_dynamics.trajectories.joint_trajectory import (
    JointTrajectory,
    nanoseconds,
    TrajectoryPoint,
)

_LATEST = sys.maxsize
"""[ns] beyond all times."""


class ActiveTrajectory:
    """
    A trajectory with its start time, and the state from which it begins.

    From `arrival_ns` to the first point the reference is interpolated from `state_before`, with
    the degree that the fields of the first point permit. After the last of several points the
    reference is the position of that point, at rest; a single set-point is held with its own
    velocity and acceleration. A trajectory that arrives after its first point is entered at the
    current time.
    """

    def __init__(
        self,
        trajectory: JointTrajectory,
        start_ns: int,
        arrival_ns: int,
        state_before: Reference,
        plan: Plan | None = None,
        is_from_measurement: bool = False,
    ) -> None:
        """
        Take all times as nanoseconds of the same clock as the argument of `sample`.

        A `plan`, which begins at the arrival, replaces the points of the trajectory until its end.
        `is_from_measurement`: this is a stop of an arm that moves without a reference.
        """
        self.trajectory = trajectory
        self.start_ns = start_ns
        self._arrival_ns = arrival_ns
        self._state_before = state_before
        self._plan, self._plan_end_ns = plan, arrival_ns
        self._times = [start_ns + t for t in trajectory.times_ns]
        self._points = list(trajectory.points)
        if plan is not None:
            self._plan_end_ns += nanoseconds(plan.duration)
            rest = bisect_right(self._times, self._plan_end_ns)
            self._times[:rest] = [self._plan_end_ns]
            self._points[:rest] = [TrajectoryPoint(0.0, *plan.end)]
        elif arrival_ns < self._times[0]:
            self._times.insert(0, arrival_ns)
            self._points.insert(0, TrajectoryPoint(0.0, *state_before))
        self.end_ns = self._times[-1]
        self._final = _held(self._points[-1], trajectory.is_set_point and plan is None)
        self._segment: Segment | None = None
        self.is_from_measurement = is_from_measurement

    def sample(self, now_ns: int) -> Reference:
        """
        Return the reference at `now_ns`.

        A time before the arrival gives the state before the trajectory.
        """
        segment = self.segment(now_ns)
        return evaluate(segment.coefficients, segment.phase(now_ns))

    def segment(self, now_ns: int) -> Segment:
        """Return the segment at `now_ns`; before the arrival and after the end it is constant."""
        segment = self._segment
        if segment is None or not segment.since_ns <= now_ns < segment.end_ns:
            segment = self._segment = self._make_segment(now_ns)
        return segment

    def _make_segment(self, now_ns: int) -> Segment:
        if now_ns >= self.end_ns:
            return constant_segment(self.end_ns, _LATEST, self._final)
        if now_ns < self._arrival_ns:
            return constant_segment(-_LATEST, self._arrival_ns, self._state_before)
        if self._plan is not None and now_ns < self._plan_end_ns:
            return self._plan.segment(self._arrival_ns, now_ns)
        index = bisect_right(self._times, now_ns) - 1
        begin_ns, end_ns = self._times[index:index + 2]
        duration = (end_ns - begin_ns) / NANOSECONDS_PER_SECOND
        p0, p1 = self._points[index:index + 2]
        return Segment(
            max(begin_ns, self._arrival_ns), end_ns, begin_ns, duration,
            motion_coefficients(p0, p1, duration))


def _held(last: TrajectoryPoint, is_moving: bool) -> Reference:
    """Return the reference after the last point, at rest unless `is_moving`."""
    zero = np.zeros_like(last.position)
    zero.setflags(write=False)
    return Reference(last.position, *(
        rate if is_moving and rate is not None else zero
        for rate in (last.velocity, last.acceleration)))
