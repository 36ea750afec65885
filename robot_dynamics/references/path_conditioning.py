# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Trajectories of several points made feasible, or rejected, before they are followed.

Velocities are added to a path without velocities: slopes of a monotone interpolant (F. N. Fritsch,
J. Butland, SIAM J. Sci. Stat. Comput. 5(2), 1984), so that the path does not overshoot its points,
and rest at both ends. Such a path of many points is replaced with a B-spline near the points, if
this needs less slow-down. The path is then slowed down until its velocity, acceleration and jerk
are within `MotionLimits`. A trajectory with velocities is compared with the limits of the arm, and
is followed unchanged or rejected.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.references.motion_limits import MotionLimits
from robot_dynamics.trajectories.efforts import efforts_along
from robot_dynamics.trajectories.extrema import derivative, extrema
from robot_dynamics.trajectories.interpolation import position_coefficients
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, TrajectoryPoint
from robot_dynamics.trajectories.path import LINE_DISTANCE
from robot_dynamics.trajectories.segments import TrajectorySegments
from robot_dynamics.trajectories.slow_down import within_limits
from robot_dynamics.trajectories.timing_limits import PathLimits

MANY_POINTS = 10
"""Points from which a path without velocities may miss its points by LINE_DISTANCE."""
ACCEPTED = 1.1
"""Ratio to its own duration up to which a path passes its points."""
SLOWEST = 100.0
"""Largest factor by which a trajectory is slowed down."""
_ROUNDING = 1e-6
"""Tolerance of ratios to limits."""


def feasible_trajectory(
    dynamics: ArmDynamics, trajectory: JointTrajectory, limits: MotionLimits,
    effort_limit_fraction: float = 1.0, slows_down: bool = False,
) -> tuple[JointTrajectory, float]:
    """
    Return a trajectory of several points that the arm can follow, and its slow-down factor.

    Raises TrajectoryError, naming quantity, joint, time and ratio, for a trajectory with
    velocities that exceeds a limit, unless `slows_down`; and for a trajectory that exceeds a limit
    at any speed.
    """
    points, share = trajectory.points, max(effort_limit_fraction, 1e-9)
    if any(point.velocity is None for point in points):
        return _with_velocities(trajectory, limits)
    ratio, excess = _excess(dynamics, trajectory, share)
    if ratio <= 1.0 + _ROUNDING:
        return trajectory, 1.0
    if not slows_down:
        raise TrajectoryError(
            f'the trajectory is not feasible: {excess}; expected at most 1 (send a slower '
            "trajectory, or set infeasible_trajectory to 'slow_down')")
    slow = within_limits(
        PathLimits(dynamics, np.full(len(points[0].position), np.inf), share), trajectory)
    begin = points[0].time_from_start
    slowness = slow.duration / (trajectory.duration - begin)
    if slowness > SLOWEST:
        raise TrajectoryError(f'the trajectory is not feasible at any speed: {excess}')
    return JointTrajectory(trajectory.joint_names, tuple(
        replace(point, time_from_start=slowness * begin + point.time_from_start)
        for point in slow.points)), slowness


def _excess(
    dynamics: ArmDynamics, trajectory: JointTrajectory, share: float,
) -> tuple[float, str]:
    """Return the ratio to a limit that is exceeded, or the largest one of efforts, and which."""
    segments, arm = TrajectorySegments(trajectory), dynamics.arm
    phases, v = extrema(segments.velocity_coefficients)
    ratios = np.abs(v) / arm.limits.velocity
    worst = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
    ratio, quantity, joint = float(ratios[worst]), 'velocity', arm.joint_names[worst[2]]
    time = float(segments.time(np.asarray(worst[1]), phases[worst]))
    if ratio <= 1.0 + _ROUNDING:
        efforts = efforts_along(dynamics, trajectory)
        ratio, quantity = efforts.worst_ratio / share, efforts.worst_limit
        joint, time = efforts.worst_joint, efforts.worst_time
    return ratio, (
        f'the {quantity} of {joint!r} is {ratio:.3g} times its limit at {time:.3g} s')


class _Path(NamedTuple):
    """Times (m,) [s], positions, velocities and accelerations (m, n) at the points of a path."""

    t: FloatArray
    q: FloatArray
    v: FloatArray
    a: FloatArray

    @property
    def duration(self) -> float:
        """The duration [s] from the first to the last point."""
        return float(self.t[-1] - self.t[0])

    def slower(self, factor: float) -> '_Path':
        """Return the same path with `factor` times the duration."""
        t_0 = self.t[0]
        return _Path(t_0 + factor * (self.t - t_0), self.q, self.v / factor, self.a / factor**2)


def _with_velocities(
    trajectory: JointTrajectory, limits: MotionLimits,
) -> tuple[JointTrajectory, float]:
    """Return a path with velocities and accelerations, within the limits, and its slow-down."""
    points = trajectory.points
    t = np.array([p.time_from_start for p in points])
    q: FloatArray = np.array([p.position for p in points])
    v = _monotone_slopes(t, q)
    for i, point in enumerate(points):
        if point.velocity is not None:
            v[i] = point.velocity
    path = _within(_Path(t, q, v, _monotone_accelerations(t, q, v)), limits)
    is_dense = len(points) >= MANY_POINTS and all(point.velocity is None for point in points)
    duration = float(t[-1] - t[0])
    if is_dense and path.duration > ACCEPTED * duration:
        path = min((path, *_near_points(t, q, limits)), key=lambda one: one.duration)
    slowness = path.duration / duration
    return JointTrajectory(trajectory.joint_names, tuple(
        TrajectoryPoint(float(time), *rows) for time, *rows in zip(*path))), slowness


def _within(path: _Path, limits: MotionLimits) -> _Path:
    """Return the path, slowed down until it is within the limits."""
    T = np.diff(path.t)[:, np.newaxis]
    c = position_coefficients([x[:-1] for x in path[1:]], [x[1:] for x in path[1:]], T)
    v = derivative(c) / T[:, np.newaxis]
    a = derivative(v) / T[:, np.newaxis]
    j = derivative(a) / T[:, np.newaxis]
    return path.slower(_factor(limits, *(np.abs(extrema(x).values) for x in (v, a, j))))


def _factor(limits: MotionLimits, *rates: FloatArray) -> float:
    """Return the slow-down, at least 1, for |v|, |a| and |j| (..., n) to be within the limits."""
    most = limits.velocity, limits.acceleration, limits.jerk
    return max(1.0, *(
        float(np.max(x / limit) ** (1.0 / k)) for k, (x, limit) in enumerate(zip(rates, most), 1)))


def _monotone_slopes(t: FloatArray, q: FloatArray) -> FloatArray:
    """
    Return the slopes (m, n) at the points: harmonic means, 0 at turns and at both ends.

    They are at most 5/4 of the slopes of the lines on both sides; see `_monotone_accelerations`.
    """
    h = np.diff(t)[:, np.newaxis]
    d = np.diff(q, axis=0) / h
    w1, w2 = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
    same = d[1:] * d[:-1] > 0.0
    slopes = np.zeros_like(q)
    with np.errstate(all='ignore'):  # a slope of 5e-324 is 0
        slopes[1:-1] = np.where(same, (w1 + w2) / (w1 / d[:-1] + w2 / d[1:]), 0.0)
    most = 1.25 * np.minimum(np.abs(d[1:]), np.abs(d[:-1]))
    slopes[1:-1] = np.clip(slopes[1:-1], -most, most)
    return slopes


def _monotone_accelerations(t: FloatArray, q: FloatArray, v: FloatArray) -> FloatArray:
    """
    Return accelerations (m, n) at the points with which the quintics do not overshoot them.

    They are central differences, within bounds for which the Bernstein coefficients of each
    quintic, q, q + v T/5, q + 2 v T/5 + a T²/20 and the same from the end, are monotone.
    """
    a, h = np.zeros_like(q), np.diff(t)[:, np.newaxis]
    d, speed, sign = np.abs(np.diff(q, axis=0) / h), np.abs(v[1:-1]), np.sign(v[1:-1])
    before, after = h[:-1], h[1:]
    low = np.maximum(-4.0 * speed / after, -10.0 * (d[:-1] - 0.8 * speed) / before)
    high = np.minimum(4.0 * speed / before, 10.0 * (d[1:] - 0.8 * speed) / after)
    central = sign * (v[2:] - v[:-2]) / (before + after)
    a[1:-1] = sign * np.clip(central, np.minimum(low, 0.0), np.maximum(high, 0.0))
    return a


def _near_points(t: FloatArray, q: FloatArray, limits: MotionLimits) -> Iterator[_Path]:
    """Yield smooth paths from rest to rest within LINE_DISTANCE of the points of a path."""
    cells = len(t) - 1
    while cells > 0:
        for ramp in (t[-1] - t[0]) * 0.5 ** np.arange(8):
            path = _near(t, q, limits, cells, ramp)
            if path is not None:
                yield path
        cells //= 2


def _near(
    t: FloatArray, q: FloatArray, limits: MotionLimits, cells: int, ramp: float,
) -> _Path | None:
    """
    Return a uniform cubic B-spline near the points of a path, None beyond LINE_DISTANCE.

    Its control points are on the lines between the points, at times that start and end slowly
    within `ramp` [s]. It does not overshoot the polygon of its control points, and each derivative
    is within their divided differences (C. de Boor, A Practical Guide to Splines, 2001). It starts
    and ends at rest, because its first and its last control point are repeated.
    """
    duration = t[-1] - t[0]
    clock = np.linspace(0.0, duration + ramp, 1 + int(np.ceil(cells * (1.0 + ramp / duration))))
    u, h = np.minimum(clock / ramp, 1.0), clock[1]
    rising = ramp * (u**3 - 0.5 * u**4) + np.maximum(clock - ramp, 0.0)
    at = t[0] + np.where(clock < 0.5 * clock[-1], rising, duration - rising[::-1])
    # The time on the lines is one more coordinate, which states where on them the spline is.
    lines = np.stack([np.interp(at, t, column) for column in (*q.T, t)], axis=1)
    c = np.pad(lines, ((2, 2), (0, 0)), 'edge')
    knots = (c[:-2] + 4.0 * c[1:-1] + c[2:]) / 6.0
    middles = (c[:-3] + 23.0 * c[1:-2] + 23.0 * c[2:-1] + c[3:]) / 48.0
    near = np.insert(knots, np.arange(1, len(knots)), middles, axis=0)
    if any(np.abs(np.interp(t, near[:, -1], x) - y).max() > LINE_DISTANCE
           for x, y in zip(near.T, q.T)):
        return None
    c, knots[[0, -1], :-1] = c[:, :-1], q[[0, -1]]
    path = _Path(t[0] + h * np.arange(len(knots)), knots[:, :-1], (c[2:] - c[:-2]) / (2.0 * h),
                 np.diff(c, 2, axis=0) / h**2)
    return path.slower(_factor(limits, *(
        np.abs(np.diff(c, k, axis=0)) / h**k for k in (1, 2, 3))))
