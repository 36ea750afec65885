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
Following a joint trajectory: the reference q(t), v(t), a(t) that a control law tracks.

Points are interpolated as `joint_trajectory_controller` does (ros2_controllers, branch jazzy,
class `Trajectory`): linear, cubic or quintic by the fields that both ends of a segment have.
docs/trajectories.md says what is different here, and why.

Absolute times are whole nanoseconds: 1.7e9 s since the epoch, as a 64-bit float, is only good
to 2e-7 s. Spans of time are seconds.
"""

from bisect import bisect_right
from collections.abc import Sequence
from math import ceil, copysign, pi
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.trajectories.joint_trajectory import (
    check_end_in_future,
    JointTrajectory,
    make_trajectory,
    nanoseconds,
    TrajectoryPoint,
)
from robot_dynamics.validation import check_scalar, check_vector, LARGEST_VALUE

__all__ = [
    'ActiveTrajectory', 'JointTrajectory', 'make_trajectory', 'position_coefficients',
    'quintic_point_to_point', 'quintic_via_points', 'Reference', 'sample_segment',
    'TrajectoryFollower', 'TrajectoryPoint',
]

# Coefficients of 1, s, s², … for s = (t - t0) / T in [0, 1], from the values at both ends, each
# derivative by s: linear from (q0, q1), cubic from (q0, v0, q1, v1), quintic from
# (q0, v0, a0, q1, v1, a1).
_LINEAR = np.zeros((6, 2))
_LINEAR[:2] = [
    [1.0, 0.0],
    [-1.0, 1.0],
]
_CUBIC = np.zeros((6, 4))
_CUBIC[:4] = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [-3.0, -2.0, 3.0, -1.0],
    [2.0, 1.0, -2.0, 1.0],
]
_QUINTIC = np.array([
    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.5, 0.0, 0.0, 0.0],
    [-10.0, -6.0, -1.5, 10.0, -4.0, 0.5],
    [15.0, 8.0, 1.5, -15.0, 7.0, -1.0],
    [-6.0, -3.0, -0.5, 6.0, -3.0, 0.5],
])
_BY_FIELDS = {1: _LINEAR, 2: _CUBIC, 3: _QUINTIC}
_ORDERS = np.arange(6.0)[:, np.newaxis]


class Reference(NamedTuple):
    """
    What the arm should do at one instant: three arrays of shape (n,).

    `position` [rad or m], `velocity` [rad/s or m/s], `acceleration` [rad/s² or m/s²].
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


class Segment(NamedTuple):
    """
    The motion from one point to the next.

    It is in force from `since_ns` until before `end_ns`, and began at `begin_ns`; `duration` [s].
    `coefficients` has shape (6, 3 n): those of position, velocity and acceleration.
    """

    since_ns: int
    end_ns: int
    begin_ns: int
    duration: float
    coefficients: FloatArray

    def share(self, now_ns: int) -> float:
        """Return s, how much of the segment has passed, from 0 to 1."""
        return (now_ns - self.begin_ns) / NANOSECONDS_PER_SECOND / self.duration


def sample_segment(
    t: float, t0: float, p0: TrajectoryPoint, t1: float, p1: TrajectoryPoint,
) -> Reference:
    """
    Return the reference at the time `t` on the way from `p0` at `t0` to `p1` at `t1`, in s.

    Quintic where both points have velocity and acceleration, cubic where both have velocity,
    linear otherwise, with acceleration 0. A `t` outside [t0, t1] is read as the nearer end. The
    points' own `time_from_start` is not read.
    Raises TrajectoryError unless t0 < t1. Source: K. M. Lynch and F. C. Park, Modern Robotics,
    2017, section 9.3 (cubic) and, for quintics from conditions at both ends, J. J. Craig,
    Introduction to Robotics, 3rd edition, section 7.3.
    """
    if not t0 < t1:
        raise TrajectoryError(f't1 is {t1!r} s, expected more than t0, which is {t0!r} s')
    span = min(max(t, t0), t1) - t0
    return _evaluate(_coefficients(p0, p1, t1 - t0), span / (t1 - t0))


def _coefficients(p0: TrajectoryPoint, p1: TrajectoryPoint, T: float) -> FloatArray:
    """Return the coefficients of 1, s, …, s⁵ for s = t / T, of q, q̇ and q̈ side by side."""
    c = position_coefficients(*_common_fields(p0, p1), T)
    v, a = np.zeros_like(c), np.zeros_like(c)
    v[:5] = c[1:] * (_ORDERS[1:] / T)
    a[:4] = c[2:] * (_ORDERS[2:] * _ORDERS[1:5] / T**2)
    return np.hstack((c, v, a))


def _common_fields(
    p0: TrajectoryPoint, p1: TrajectoryPoint,
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return position, velocity and acceleration of two points, as far as both have them."""
    start, end = [p0.position], [p1.position]
    for x0, x1 in ((p0.velocity, p1.velocity), (p0.acceleration, p1.acceleration)):
        if x0 is None or x1 is None:
            break
        start.append(x0)
        end.append(x1)
    return start, end


def position_coefficients(
    start: Sequence[FloatArray], end: Sequence[FloatArray], T: FloatArray | float,
) -> FloatArray:
    """
    Return the coefficients (..., 6, n) of 1, s, …, s⁵ for s = t / T, of the position.

    `start` and `end` have the fields of which the degree follows: position, velocity and
    acceleration, or the first or the first two of these, each (..., n); T is a number, or
    (..., 1) [s].
    """
    scaled = [x * T**order for side in (start, end) for order, x in enumerate(side)]
    return np.asarray(_BY_FIELDS[len(start)] @ np.stack(scaled, axis=-2))


def _evaluate(c: FloatArray, s: float) -> Reference:
    s2 = s * s
    s3 = s2 * s
    values = np.array((1.0, s, s2, s3, s2 * s2, s2 * s3)) @ c
    n = len(values) // 3
    return Reference(values[:n], values[n:2 * n], values[2 * n:])


class ActiveTrajectory:
    """
    A trajectory with its start time, and the state that it begins from.

    From `arrival_ns` to the first point the reference leads from `state_before`, by the degree
    that the first point's fields allow. After the last point of several it holds that point's
    position, at rest; a single set-point is held with the velocity and acceleration that it
    carries. A trajectory that arrives after its first point is entered where the clock is.
    """

    def __init__(
        self,
        trajectory: JointTrajectory,
        start_ns: int,
        arrival_ns: int,
        state_before: Reference,
        lead_in: Sequence[TrajectoryPoint] = (),
    ) -> None:
        """
        Take all times as nanoseconds of the clock that `sample` is asked with.

        The points of `lead_in`, with times [s] from the arrival, replace those of the trajectory
        up to the last of them.
        """
        self.trajectory = trajectory
        self.start_ns = start_ns
        self._arrival_ns = arrival_ns
        self._state_before = state_before
        self._times = [start_ns + t for t in trajectory.times_ns]
        self._points = list(trajectory.points)
        self._lead_in = lead_in
        if lead_in:
            before = [arrival_ns + nanoseconds(p.time_from_start) for p in lead_in]
            rest = bisect_right(self._times, before[-1])
            self._times[:rest], self._points[:rest] = before, lead_in
        self.end_ns = self._times[-1]
        if arrival_ns < self._times[0]:
            self._times.insert(0, arrival_ns)
            self._points.insert(0, TrajectoryPoint(0.0, *state_before))
        self._final = _held(self._points[-1], trajectory.is_set_point and not lead_in)
        self._segment: Segment | None = None

    def earlier(self, shift_ns: int) -> 'ActiveTrajectory':
        """Return the same with all its times lower by `shift_ns`."""
        return ActiveTrajectory(
            self.trajectory, self.start_ns - shift_ns, self._arrival_ns - shift_ns,
            self._state_before, self._lead_in)

    def sample(self, now_ns: int) -> Reference:
        """
        Return the reference at `now_ns`; the arrays may be shared between calls, do not write.

        A time before the arrival gives the state before the trajectory.
        """
        segment = self.segment(now_ns)
        if segment is not None:
            return _evaluate(segment.coefficients, segment.share(now_ns))
        return self._final if now_ns >= self.end_ns else self._state_before

    def segment(self, now_ns: int) -> Segment | None:
        """Return the segment in force at `now_ns`, None before the arrival and after the end."""
        segment = self._segment
        if segment is None or not segment.since_ns <= now_ns < segment.end_ns:
            if not self._arrival_ns <= now_ns < self.end_ns:
                return None
            index = bisect_right(self._times, now_ns) - 1
            segment = self._segment = self._make_segment(index)
        return segment

    def _make_segment(self, index: int) -> Segment:
        begin_ns, end_ns = self._times[index:index + 2]
        duration = (end_ns - begin_ns) / NANOSECONDS_PER_SECOND
        p0, p1 = self._points[index:index + 2]
        return Segment(
            max(begin_ns, self._arrival_ns), end_ns, begin_ns, duration,
            _coefficients(p0, p1, duration))


def _held(last: TrajectoryPoint, is_moving: bool) -> Reference:
    """Return what is held after the last point, at rest unless `is_moving`."""
    zero = np.zeros_like(last.position)
    zero.setflags(write=False)
    if not is_moving:
        return Reference(last.position, zero, zero)
    return Reference(
        last.position,
        zero if last.velocity is None else last.velocity,
        zero if last.acceleration is None else last.acceleration)


class TrajectoryFollower:
    """
    The one trajectory in force, and the rules by which a new one takes over.

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

        `continuous_joints` turn without end: they lead to the first point the short way round.
        A single set-point counts as due now until `set_point_max_age` [s] after its stamped
        time: a sender that stamps with its own clock is always late by the transport.
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
        position: Any,
        velocity: Any,
        stamp_ns: int = 0,
    ) -> ActiveTrajectory:
        """
        Follow `trajectory` from now on, in place of the one in force.

        `stamp_ns` is when its time 0 is, 0 for now. The reference goes on from the one in force
        at `now_ns`; where there is none, from the measured `position` (n,) [rad or m] and
        `velocity` (n,) [rad/s or m/s]. The old trajectory is forgotten at once, even where the
        new one starts later.

        Raises TrajectoryError for other joints or an end in the past, and InvalidInputError for
        a measured state that is no state; what was in force then stays so.
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
        """Return the trajectory as it is followed from `state` on."""
        return ActiveTrajectory(trajectory, start_ns, now_ns, state)

    def sample(self, now_ns: int) -> Reference | None:
        """Return the reference at `now_ns`, or None while there is no trajectory."""
        active = self.active
        return None if active is None else active.sample(now_ns)

    def clear(self) -> None:
        """Forget the trajectory; the next one starts from the measured state."""
        self.active = None

    def shift_time(self, shift_ns: int) -> None:
        """Let the times of the trajectory in force be lower by `shift_ns`, as those to come."""
        if self.active is not None:
            self.active = self.active.earlier(shift_ns)

    def _state_at(self, now_ns: int, position: Any, velocity: Any) -> Reference:
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
            # Exactly half a turn away, go the way that the numbers say, despite rounding.
            q[j] += 2.0 * pi * copysign(max(ceil(abs(turns) - 0.5 - 1e-9), 0), turns)
        return q


def quintic_point_to_point(
    joint_names: Sequence[str], start: Any, goal: Any, duration: float,
) -> JointTrajectory:
    """
    Return the motion from rest at `start` to rest at `goal` in `duration` [s].

    Positions have shape (n,) [rad or m]; velocity and acceleration are zero at both ends, so
    that the path is q = start + (10 s³ - 15 s⁴ + 6 s⁵)(goal - start) with s = t / duration.
    Raises TrajectoryError. Source: K. M. Lynch and F. C. Park, Modern Robotics, 2017, section
    9.2.2 (fifth-order time scaling).
    """
    rest = [[0.0] * len(joint_names)] * 2
    return make_trajectory(joint_names, (0.0, duration), (start, goal), rest, rest, joint_names)


def quintic_via_points(
    joint_names: Sequence[str], times: Sequence[float], positions: Any,
) -> JointTrajectory:
    """
    Return the smoothest motion through `positions` at `times`, from rest to rest.

    `times` (m,) [s], m >= 2, strictly increasing; `positions` (m, n) [rad or m]. Of all motions
    through these points with zero velocity and acceleration at both ends, this one has the
    least ∫ jerk² dt for each joint: quintics whose jerk and snap are continuous too. The cost
    is one dense solve of 2 (m - 2) unknowns, fine for some hundred points.
    Raises TrajectoryError.
    """
    path = make_trajectory(joint_names, times, positions, (), (), joint_names)
    if path.is_set_point:
        raise TrajectoryError('points has 1 point, expected at least a start and a goal')
    q = np.array([point.position for point in path.points])
    T = np.diff([point.time_from_start for point in path.points])
    v, a = _least_jerk_derivatives(q, T)
    return make_trajectory(
        joint_names, times, q.tolist(), v.tolist(), a.tolist(), joint_names)


def _least_jerk_derivatives(q: FloatArray, T: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return v and a at the points, (m, n) each, from continuous jerk and snap between them."""
    m = len(q)
    # The unknown x holds (q, v, a) of each point; a row of `jumps` is one jump of jerk or snap.
    jumps = np.zeros((m - 2, 2, 3 * m))
    for i in range(1, m - 1):
        jumps[i - 1, :, 3 * (i - 1):3 * (i + 1)] += _jerk_and_snap(T[i - 1], 1.0)
        jumps[i - 1, :, 3 * i:3 * (i + 2)] -= _jerk_and_snap(T[i], 0.0)
    system = jumps.reshape(2 * (m - 2), 3 * m)
    unknown = [3 * i + k for i in range(1, m - 1) for k in (1, 2)]
    x = np.zeros((m, 3, q.shape[1]))
    x[:, 0] = q
    found = np.linalg.solve(system[:, unknown], -system[:, ::3] @ q)
    x[1:-1, 1:] = found.reshape(m - 2, 2, q.shape[1])
    return x[:, 1], x[:, 2]


def _jerk_and_snap(T: float, s: float) -> FloatArray:
    """Return the rows that give jerk and snap at `s` from (q0, v0, a0, q1, v1, a1), in s."""
    third = np.array((0.0, 0.0, 0.0, 6.0, 24.0 * s, 60.0 * s**2)) / T**3
    fourth = np.array((0.0, 0.0, 0.0, 0.0, 24.0, 120.0 * s)) / T**4
    scale = np.array((1.0, T, T**2))
    rows: FloatArray = np.vstack((third, fourth)) @ _QUINTIC * np.concatenate((scale, scale))
    return rows
