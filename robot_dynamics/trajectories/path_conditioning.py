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
Trajectories of several points made feasible, or rejected, before they are followed.

Velocities are added to a path without velocities: slopes of a monotone interpolant (F. N. Fritsch,
J. Butland, SIAM J. Sci. Stat. Comput. 5(2), 1984), so that the path does not overshoot its points,
and rest at both ends. The path is then slowed down until it is within `MotionLimits`. A trajectory
with velocities is compared with the limits of the arm, and is followed unchanged or rejected.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.trajectories.efforts import efforts_along
from robot_dynamics.trajectories.interpolation import position_coefficients
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, TrajectoryPoint
from robot_dynamics.trajectories.motion_limits import MotionLimits
from robot_dynamics.trajectories.segments import TrajectorySegments

_SAMPLES = 9
_s, _k = np.linspace(0.0, 1.0, _SAMPLES), np.arange(6)
_V, _A = np.zeros((2, _SAMPLES, 6))
_V[:, 1:] = _k[1:] * np.vander(_s, 5, increasing=True)
_A[:, 2:] = _k[2:] * _k[1:-1] * np.vander(_s, 4, increasing=True)
_RAMP_POINTS, _RAMP_FRACTION = 3, 0.8
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
    effort_scale: float = 1.0, slows_down: bool = False,
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
    slower, excess = trajectory, _excess(dynamics, trajectory, effort_scale)
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
        excess = _excess(dynamics, slower, effort_scale)
    return slower, slowness


def _excess(dynamics: ArmDynamics, trajectory: JointTrajectory, effort_scale: float) -> Excess:
    fastest = _fastest(dynamics, trajectory)
    if fastest.ratio > 1.0 + _TOLERANCE:
        return fastest
    efforts = efforts_along(dynamics, trajectory)
    of_effort = Excess(
        efforts.worst_ratio / max(effort_scale, 1e-9), efforts.worst_limit, efforts.worst_joint,
        efforts.worst_time)
    return max(fastest, of_effort, key=lambda excess: excess.ratio)


def _fastest(dynamics: ArmDynamics, trajectory: JointTrajectory) -> Excess:
    segments = TrajectorySegments(trajectory)
    k, phase = segments.count, np.linspace(0.0, 1.0, _SAMPLES)
    index, phases = np.repeat(np.arange(k), _SAMPLES), np.tile(phase, k)
    v = np.abs(segments.sample(index, phases).velocity) / dynamics.arm.limits.velocity
    i, j = np.unravel_index(int(np.argmax(v)), v.shape)
    time = segments.time(index[i:i + 1], phases[i:i + 1])[0]
    return Excess(float(v[i, j]), 'velocity', dynamics.arm.joint_names[j], float(time))


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

    def slower(self, factor: float) -> '_Path':
        """Return the same path with `factor` times the duration."""
        t_0 = self.t[0]
        return _Path(t_0 + factor * (self.t - t_0), self.q, self.v / factor, self.a / factor**2)


def _with_velocities(
    trajectory: JointTrajectory, limits: MotionLimits,
) -> tuple[JointTrajectory, float]:
    """Return a path with velocities and accelerations within the limits, and its slow-down."""
    points = trajectory.points
    t = np.array([p.time_from_start for p in points])
    q: FloatArray = np.array([p.position for p in points])
    v = _monotone_slopes(t, q)
    for i, point in enumerate(points):
        if point.velocity is not None:
            v[i] = point.velocity
    paths = [_Path(t, q, v, _monotone_accelerations(t, q, v))]
    if all(point.velocity is None for point in points):
        paths += _ramped(t, q, limits)
    feasible = [path.slower(max(1.0, _excess_of(path, limits))) for path in paths]
    path = min(feasible, key=lambda one: float(one.t[-1]))
    slowness = float((path.t[-1] - path.t[0]) / (t[-1] - t[0]))
    return JointTrajectory(trajectory.joint_names, tuple(
        TrajectoryPoint(float(time), *rows) for time, *rows in zip(*path))), slowness


def _ramped(t: FloatArray, q: FloatArray, limits: MotionLimits) -> list[_Path]:
    """
    Return a dense path whose time σ starts and ends slowly, instead of with a velocity step.

    In a ramp of duration T, σ̇ = 3 u² − 2 u³ rises from 0 to 1 with u = time / T, over σ = T / 2.
    The list is empty if the path is too short for both ramps, or if its ramps have few points.
    """
    v = _monotone_slopes(t, q)
    v[0], v[-1] = (q[1] - q[0]) / (t[1] - t[0]), (q[-1] - q[-2]) / (t[-1] - t[-2])
    path = _Path(t, q, v, _monotone_accelerations(t, q, v))
    path = path.slower(max(1.0, _excess_of(path, limits)))
    first, last = (_ramp_duration(np.abs(path.v[i]), limits) for i in (0, -1))
    since, left = path.t - path.t[0], path.t[-1] - path.t
    if first / 2.0 + last / 2.0 >= since[-1] or (
            min((since < first / 2.0).sum(), (left < last / 2.0).sum()) < _RAMP_POINTS):
        return []
    t_1, rate_1, slope_1 = _in_ramp(since, first)
    t_2, rate_2, slope_2 = _in_ramp(left, last)
    begins, ends = since < first / 2.0, left < last / 2.0
    # Outside the ramps σ̇ is 1, and the time is delayed by half a ramp.
    time = np.where(begins, t_1, since + first / 2.0)
    time = np.where(ends, since[-1] + first / 2.0 + last / 2.0 - t_2, time)
    rate = np.where(begins, rate_1, np.where(ends, rate_2, 1.0))[:, np.newaxis]
    slope = np.where(begins, slope_1, np.where(ends, -slope_2, 0.0))[:, np.newaxis]
    return [_Path(path.t[0] + time, q, path.v * rate, path.a * rate**2 + path.v * slope)]


def _ramp_duration(v: FloatArray, limits: MotionLimits) -> float:
    return float(max(np.max(1.5 * v / (_RAMP_FRACTION * limits.acceleration)),
                     np.sqrt(np.max(6.0 * v / limits.jerk))))


def _in_ramp(sigma: FloatArray, T: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return time, σ̇ and σ̈ at each σ (m,) in a ramp of duration T; σ = T (u³ − u⁴/2)."""
    if T == 0.0:
        return sigma, np.ones_like(sigma), np.zeros_like(sigma)
    grid = np.linspace(0.0, 1.0, 2001)
    u = np.interp(sigma, T * (grid**3 - 0.5 * grid**4), grid)
    for _ in range(3):  # steps of Newton's method, where σ̇ is not small
        rate = np.maximum(3.0 * u**2 - 2.0 * u**3, 1e-9)
        u = np.clip(u - np.where(u > 0.05, (T * (u**3 - 0.5 * u**4) - sigma) / (T * rate), 0.0),
                    0.0, 1.0)
    return T * u, 3.0 * u**2 - 2.0 * u**3, (6.0 * u - 6.0 * u**2) / T


def _excess_of(path: _Path, limits: MotionLimits) -> float:
    """Return the factor by which a path exceeds the limits of velocity or acceleration."""
    T = np.diff(path.t)[:, np.newaxis]
    c = position_coefficients([x[:-1] for x in path[1:]], [x[1:] for x in path[1:]], T)
    speed = np.abs(_V @ c) / T[:, np.newaxis] / limits.velocity
    acceleration = np.abs(_A @ c) / T[:, np.newaxis] ** 2 / limits.acceleration
    return max(float(speed.max()), float(np.sqrt(acceleration.max())))


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
