# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The active trajectory: its reference at a time, and its replacement by a new trajectory.

Absolute times are whole nanoseconds, because 1.7e9 s since the epoch, as a 64-bit float, has a
resolution of only 2e-7 s. Durations are in seconds.
"""

from bisect import bisect_right
from collections.abc import Sequence
from math import ceil, copysign, pi

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.references.planner import Plan
from robot_dynamics.trajectories.interpolation import (
    constant_segment,
    evaluate,
    motion_coefficients,
    Reference,
    Segment,
)
from robot_dynamics.trajectories.joint_trajectory import (
    check_end_in_future,
    JointTrajectory,
    nanoseconds,
    TrajectoryPoint,
)
from robot_dynamics.validation import check_scalar, check_vector, LARGEST_VALUE

_LATEST = 1 << 62
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

    def earlier(self, shift_ns: int) -> 'ActiveTrajectory':
        """Return the same trajectory with all times lower by `shift_ns`."""
        return ActiveTrajectory(
            self.trajectory, self.start_ns - shift_ns, self._arrival_ns - shift_ns,
            self._state_before, self._plan, self.is_from_measurement)

    def sample(self, now_ns: int) -> Reference:
        """
        Return the reference at `now_ns`; calls may share its arrays, which must not be modified.

        A time before the arrival gives the state before the trajectory.
        """
        if now_ns >= self.end_ns:
            return self._final
        if now_ns < self._arrival_ns:
            return self._state_before
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
    if not is_moving:
        return Reference(last.position, zero, zero)
    return Reference(
        last.position,
        last.velocity if last.velocity is not None else zero,
        last.acceleration if last.acceleration is not None else zero)


class TrajectoryFollower:
    """
    The active trajectory, and the rules by which a new trajectory replaces it.

    `active` is that trajectory, None before the first one and after `clear()`.
    """

    def __init__(
        self,
        joint_names: Sequence[str],
        continuous_joints: Sequence[str] = (),
        set_point_max_age: float = 1.0,
    ) -> None:
        """
        Take the arm's joints, in the order of all arrays.

        `continuous_joints` move to the first point along the shortest angular distance. A single
        set-point counts as due now until `set_point_max_age` [s] after its stamped time, because a
        sender that stamps with its own clock is always late by the transport delay.
        Raises InvalidInputError.
        """
        unknown = [name for name in continuous_joints if name not in joint_names]
        if unknown:
            raise InvalidInputError(
                f'continuous_joints has {unknown}, expected names of {list(joint_names)}')
        self.joint_names = tuple(joint_names)
        self.active: ActiveTrajectory | None = None
        self._continuous = [j for j, name in enumerate(joint_names) if name in continuous_joints]
        self._max_age_ns = nanoseconds(
            check_scalar('set_point_max_age', set_point_max_age, minimum=0.0))

    def start(
        self,
        trajectory: JointTrajectory,
        now_ns: int,
        position: npt.ArrayLike,
        velocity: npt.ArrayLike,
        stamp_ns: int = 0,
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
        max_age_ns = self._max_age_ns if trajectory.is_set_point else 0
        check_end_in_future(trajectory, stamp_ns, now_ns, max_age_ns)
        state = self._state_at(now_ns, position, velocity)
        state = state._replace(position=self._turned(
            state.position, trajectory.points[0].position))
        start_ns = now_ns if stamp_ns == 0 else stamp_ns
        self.active = self._entered(trajectory, start_ns, now_ns, state)
        return self.active

    def check_joints(self, trajectory: JointTrajectory) -> None:
        """Raise TrajectoryError for joints other than those of the arm, in its order."""
        if trajectory.joint_names != self.joint_names:
            raise TrajectoryError(
                f'joint_names is {list(trajectory.joint_names)}, expected '
                f'{list(self.joint_names)}, in this order')

    def _entered(
        self, trajectory: JointTrajectory, start_ns: int, now_ns: int, state: Reference,
    ) -> ActiveTrajectory:
        """Return the active trajectory that begins from `state`."""
        return ActiveTrajectory(trajectory, start_ns, now_ns, state)

    def sample(self, now_ns: int) -> Reference | None:
        """Return the reference at `now_ns`, or None while there is no trajectory."""
        active = self.active
        return None if active is None else active.sample(now_ns)

    def clear(self) -> None:
        """Discard the trajectory; the next one starts from the measured state."""
        self.active = None

    def shift_time(self, shift_ns: int) -> None:
        """Lower the times of the active trajectory by `shift_ns`, as for a shifted clock."""
        if self.active is not None:
            self.active = self.active.earlier(shift_ns)

    def _state_at(
        self, now_ns: int, position: npt.ArrayLike, velocity: npt.ArrayLike,
    ) -> Reference:
        if self.active is not None:
            reference = self.active.sample(now_ns)
            if all((np.abs(values) <= LARGEST_VALUE).all() for values in reference):
                return reference
        n, names = len(self.joint_names), self.joint_names
        q = check_vector('position', position, n, names, LARGEST_VALUE)
        v = check_vector('velocity', velocity, n, names, LARGEST_VALUE)
        return Reference(q, v.copy(), np.zeros(n))

    def _turned(self, position: FloatArray, target: FloatArray) -> FloatArray:
        q = position.copy()
        for j in self._continuous:
            turns = (target[j] - q[j]) / (2.0 * pi)
            # At a distance of exactly half a turn, keep the sign of the difference.
            q[j] += 2.0 * pi * copysign(max(ceil(abs(turns) - 0.5 - 1e-9), 0), turns)
        return q
