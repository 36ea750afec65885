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

from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.references.motion_limits import MotionLimits
from robot_dynamics.trajectories.efforts import efforts_along
from robot_dynamics.trajectories.extrema import derivative, extrema
from robot_dynamics.trajectories.interpolation import position_coefficients
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, TrajectoryPoint
from robot_dynamics.trajectories.segments import TrajectorySegments

PATH_TOLERANCE = 0.005
"""Largest distance [rad] or [m] by which a path of many points without velocities misses them."""
MANY_POINTS = 10
"""Points from which a path without velocities may miss its points by PATH_TOLERANCE."""
_ACCEPTED = 1.1
"""Ratio to the shortest duration up to which the path that is nearer to its points is taken."""
_FEWEST_CELLS = 8
_B_SPLINE = np.array([
    [1.0, 4.0, 1.0, 0.0],
    [-3.0, 0.0, 3.0, 0.0],
    [3.0, -6.0, 3.0, 0.0],
    [-1.0, 3.0, -3.0, 1.0],
]) / 6.0
_SHORTEST_RAMP, _RAMP_SAMPLES, _RAMP_FRACTION = 1e-3, 9, 0.8
_TOLERANCE = 1e-6
_ROUNDS, _MARGIN, SLOWEST = 20, 1.02, 100.0
"""SLOWEST: the largest factor by which a trajectory is slowed down."""


class Excess(NamedTuple):
    """The largest excess of a limit: ratio to the limit, quantity, joint, and time [s]."""

    ratio: float
    quantity: str
    joint: str
    time: float

    def __str__(self) -> str:
        return (f'the {self.quantity} of {self.joint!r} is {self.ratio:.3g} times its limit at '
                f'{self.time:.3g} s')


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
    if any(point.velocity is None for point in trajectory.points):
        return _with_velocities(trajectory, limits)
    slowness = 1.0
    slower, excess = trajectory, _excess(dynamics, trajectory, effort_limit_fraction)
    while excess.ratio > 1.0 + _TOLERANCE:
        if not slows_down:
            raise TrajectoryError(
                f'the trajectory is not feasible: {excess}; expected at most 1 (send a slower '
                "trajectory, or set infeasible_trajectory to 'slow_down')")
        slowness *= max(
            _MARGIN, excess.ratio if excess.quantity == 'velocity' else excess.ratio**0.5)
        if slowness > SLOWEST:
            raise TrajectoryError(f'the trajectory is not feasible at any speed: {excess}')
        slower = _slower(trajectory, slowness)
        excess = _excess(dynamics, slower, effort_limit_fraction)
    return slower, slowness


def _excess(
    dynamics: ArmDynamics, trajectory: JointTrajectory, effort_limit_fraction: float,
) -> Excess:
    fastest = _fastest(dynamics, trajectory)
    if fastest.ratio > 1.0 + _TOLERANCE:
        return fastest
    efforts = efforts_along(dynamics, trajectory)
    of_effort = Excess(
        efforts.worst_ratio / max(effort_limit_fraction, 1e-9), efforts.worst_limit,
        efforts.worst_joint,
        efforts.worst_time)
    return max(fastest, of_effort, key=lambda excess: excess.ratio)


def _fastest(dynamics: ArmDynamics, trajectory: JointTrajectory) -> Excess:
    segments, arm = TrajectorySegments(trajectory), dynamics.arm
    phases, v = extrema(segments.velocity_coefficients)
    ratios = np.abs(v) / arm.limits.velocity
    worst = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
    _, i, j = worst
    return Excess(float(ratios[worst]), 'velocity', arm.joint_names[j],
                  float(segments.time(np.asarray(i), phases[worst])))


def _slower(trajectory: JointTrajectory, factor: float) -> JointTrajectory:
    return JointTrajectory(trajectory.joint_names, tuple(
        TrajectoryPoint(
            factor * p.time_from_start, p.position,
            p.velocity / factor if p.velocity is not None else None,
            p.acceleration / factor**2 if p.acceleration is not None else None)
        for p in trajectory.points))


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
    if is_dense and path.duration > _ACCEPTED * (t[-1] - t[0]):
        near = [_within(one, limits) for one in _near_points(t, q, limits)]
        path = _nearest([path, *near])
    slowness = path.duration / float(t[-1] - t[0])
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
    with np.errstate(divide='ignore', invalid='ignore'):
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


def _near_points(t: FloatArray, q: FloatArray, limits: MotionLimits) -> list[_Path]:
    """
    Return a smooth path from rest to rest within PATH_TOLERANCE of its points.

    Of several spacings of the control points, the smallest with an accepted duration is used. The
    list is empty if no spacing is within the tolerance.
    """
    splines = []
    cells = len(t) - 1
    while cells >= _FEWEST_CELLS:
        spline = _Spline.near(t, q, cells)
        if np.abs(spline.sample(t - t[0])[0] - q).max() <= PATH_TOLERANCE:
            splines.append(spline.slower(spline.excess(limits)))
        cells //= 2
    return [_nearest(splines).from_rest_to_rest(float(t[0]), limits)] if splines else []


class _Spline(NamedTuple):
    """
    A uniform cubic B-spline: control points (m, n), and the time `h` [s] between them.

    It does not overshoot the polygon of its control points, and each derivative is within the
    divided differences of the control points (C. de Boor, A Practical Guide to Splines, 2001).
    """

    control: FloatArray
    h: float

    @classmethod
    def near(cls, t: FloatArray, q: FloatArray, cells: int) -> '_Spline':
        """Return the spline from the first to the last point, with control points on the lines."""
        grid = np.linspace(t[0], t[-1], cells + 1)
        c = np.stack([np.interp(grid, t, column) for column in q.T], axis=1)
        c = np.concatenate((2.0 * c[:1] - c[1:2], c, 2.0 * c[-1:] - c[-2:-1]))
        return cls(c, float(t[-1] - t[0]) / cells)

    @property
    def duration(self) -> float:
        """The duration [s] from the first to the last point."""
        return (len(self.control) - 3) * self.h

    def slower(self, factor: float) -> '_Spline':
        """Return the same path with `factor` times the duration."""
        return self._replace(h=factor * self.h)

    def excess(self, limits: MotionLimits) -> float:
        """Return the factor by which the spline has to be slower, at least 1."""
        rates = (np.abs(np.diff(self.control, k, axis=0)) / self.h**k for k in (1, 2, 3))
        return _factor(limits, *rates)

    def sample(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position, velocity and acceleration (k, n) at times (k,) [s] from its start."""
        cell = np.clip((time / self.h).astype(np.intp), 0, len(self.control) - 4)
        x = (time / self.h - cell)[:, np.newaxis]
        around = self.control[cell[:, np.newaxis] + np.arange(4)]
        c0, c1, c2, c3 = np.moveaxis(_B_SPLINE @ around, 1, 0)
        return (c0 + x * (c1 + x * (c2 + x * c3)), (c1 + x * (2.0 * c2 + x * 3.0 * c3)) / self.h,
                (2.0 * c2 + x * 6.0 * c3) / self.h**2)

    def from_rest_to_rest(self, start: float, limits: MotionLimits) -> _Path:
        """
        Return the path whose time σ along the spline starts and ends slowly, from `start` [s].

        In a ramp of duration T, σ = T (u³ − u⁴/2) with u = time / T, so that σ̇ rises from 0 to 1
        over σ = T/2. A spline that is too short for both ramps is slowed down.
        """
        first, last = self._ramp_durations(limits)
        if 0.5 * (first + last) > 0.9 * self.duration:
            return self.slower(1.2).from_rest_to_rest(start, limits)
        h, end = self.h, self.duration
        knots = h * np.arange(len(self.control) - 2)
        knots = knots[(knots > 0.5 * first + 0.25 * h) & (knots < end - 0.5 * last - 0.25 * h)]
        t_1, sigma_1, rate_1, slope_1 = _ramp(first, h)
        t_2, sigma_2, rate_2, slope_2 = (row[::-1] for row in _ramp(last, h))
        # Outside the ramps σ̇ is 1, and the time is delayed by half a ramp.
        time = np.concatenate((t_1, knots + 0.5 * first, end + 0.5 * (first + last) - t_2))
        rate = np.concatenate((rate_1, np.ones_like(knots), rate_2))[:, np.newaxis]
        slope = np.concatenate((slope_1, np.zeros_like(knots), -slope_2))[:, np.newaxis]
        q, v, a = self.sample(np.concatenate((sigma_1, knots, end - sigma_2)))
        q[[0, -1]] = self.control[[1, -2]]
        return _Path(start + time, q, v * rate, a * rate**2 + v * slope)

    def _ramp_durations(self, limits: MotionLimits) -> list[float]:
        """Return the durations [s] of the ramps at the start and at the end."""
        speeds = np.abs(np.diff(self.control, axis=0))[[0, -1]] / self.h
        return [max(
            _SHORTEST_RAMP, float(np.max(1.5 * v / (_RAMP_FRACTION * limits.acceleration))),
            float(np.max(6.0 * v / (_RAMP_FRACTION * limits.jerk))) ** 0.5) for v in speeds]


def _ramp(T: float, h: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return time, σ, σ̇ and σ̈ at samples of a ramp of duration T, at most `h` apart."""
    u = np.linspace(0.0, 1.0, max(_RAMP_SAMPLES, int(np.ceil(T / h)) + 1))
    return T * u, T * (u**3 - 0.5 * u**4), 3.0 * u**2 - 2.0 * u**3, 6.0 * (u - u**2) / T


_Motion = TypeVar('_Motion', _Path, _Spline)


def _nearest(motions: Sequence[_Motion]) -> _Motion:
    """Return the first of several motions that is about as short as the shortest."""
    shortest = min(one.duration for one in motions)
    return next(one for one in motions if one.duration <= _ACCEPTED * shortest)
