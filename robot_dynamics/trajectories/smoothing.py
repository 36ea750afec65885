# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A timing of a path whose accelerations do not jump, so that the efforts keep a limit of their rate.

The speed σ̇ along the path is replaced with its mean over a window. The arm stays on the path, σ̈
changes at most by its largest jump per window, and the motion becomes longer by the window. Rests
remain rests, because each section between them is averaged alone.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.trajectories.interpolation import position_coefficients
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, TrajectoryPoint
from robot_dynamics.trajectories.path_grid import PathEnd, PathGrid
from robot_dynamics.trajectories.reachability import fastest_states
from robot_dynamics.trajectories.segments import sample_pieces, TrajectorySegments
from robot_dynamics.trajectories.slow_down import slower, within_limits
from robot_dynamics.trajectories.timing_limits import (
    constraints,
    PathLimits,
    PathTerms,
    velocity_caps,
)

PER_WINDOW, LONGEST_STEP = 8, 0.01
"""Points of the result per window at least, and the longest time between them [s]."""
_WINDOWS, _SHORTEST_WINDOW = (0.01, 0.5), 0.1
_ROUNDS, _MOST_AT_ONCE, _ENOUGH, _PARTS = 40, 4.0, 0.02, 4
_ORDERS = np.arange(1.0, 6.0)[:, np.newaxis]
_GAUSS, _WEIGHTS = np.array([0.112702, 0.5, 0.887298]), np.array([5.0, 8.0, 5.0]) / 18.0


class PathTiming(NamedTuple):
    """When the arm passes the nodes of a grid: σ̇ (m + 1,), and the durations (m,) [s]."""

    grid: PathGrid
    speed: FloatArray
    duration: FloatArray


def durations(grid: PathGrid, x: FloatArray, rise: FloatArray) -> FloatArray:
    """Return the durations (m,) [s] of the intervals."""
    speed = np.sqrt(x)
    T: FloatArray = 2.0 * grid.length / (speed[:-1] + speed[1:])
    # The integral of the difference of 1/σ̇ from that with a constant control, by Gauss.
    for p, weight in zip(_GAUSS, _WEIGHTS):
        constant = x[:-1] + p * np.diff(x)
        rising = np.maximum(constant - p * (1.0 - p) * rise * grid.length, 0.25 * constant)
        T += weight * grid.length * (1.0 / np.sqrt(rising) - 1.0 / np.sqrt(constant))
    return T


def within_rates(
    limits: PathLimits, names: tuple[str, ...], timing: PathTiming,
    terms: tuple[PathTerms, PathTerms], rates: FloatArray,
) -> JointTrajectory:
    """
    Return a motion whose efforts without friction keep the limits of their rates (n,).

    In the window of the mean an effort may change by twice its limit. Parts of the path in which
    the motion exceeds a limit, such as narrow bends, are passed more slowly.
    """
    grid, x = timing.grid, np.square(timing.speed)
    m, n = grid.sign.shape
    window = _window(limits, rates)
    caps, rows = velocity_caps(grid, limits.velocity, np.zeros(m)), constraints(
        limits, grid, terms, x, np.zeros(m), np.zeros((m, n)))
    for _ in range(_ROUNDS):
        result, first, last = _smoothed(names, timing, window)
        excess = _excess_of_speed(limits, result, rates)
        if excess.max() <= 1.0 + _ENOUGH:
            break
        cap = np.full(m + 1, np.inf)
        for k in np.flatnonzero(excess > 1.0):
            part = slice(first[k], last[k] + 1)
            cap[part] = np.minimum(cap[part], x[part] / min(excess[k], _MOST_AT_ONCE))
        caps = np.minimum(caps, cap)
        x = fastest_states(rows, caps)
        timing = PathTiming(grid, np.sqrt(x), durations(grid, x, np.zeros(m)))
    result = within_limits(limits, result)
    return slower(result, max(1.0, float(_rates(limits, result, rates).max())))


def _window(limits: PathLimits, rates: FloatArray) -> float:
    with np.errstate(invalid='ignore'):
        windows = 2.0 * limits.share * limits.dynamics.arm.limits.effort / rates
    finite = windows[np.isfinite(windows) & (windows > 0.0)]
    return float(np.clip(finite.max(initial=_SHORTEST_WINDOW), *_WINDOWS))


def _excess_of_speed(
    limits: PathLimits, result: JointTrajectory, rates: FloatArray,
) -> FloatArray:
    """Return by which factors (k,) σ̇² is too large at each point."""
    motion = TrajectorySegments(result).points
    load = limits.dynamics.unchecked.rigid_body.inverse_dynamics_batch(*motion)
    by_name = limits.ratios(motion.velocity, motion.acceleration, load)
    velocity = by_name.pop('velocity')
    excess = np.maximum(velocity.max(axis=1)**2, np.max(list(by_name.values()), axis=(0, 2)))
    of_rate = _rates(limits, result, rates)**(2.0 / 3.0)
    excess[1:] = np.maximum(excess[1:], of_rate)
    excess[:-1] = np.maximum(excess[:-1], of_rate)
    return np.asarray(excess)


def _rates(limits: PathLimits, result: JointTrajectory, rates: FloatArray) -> FloatArray:
    """Return the largest rate of an effort without friction, by its limit, on each segment."""
    segments = TrajectorySegments(result)
    k, phases = segments.count, np.linspace(0.0, 1.0, _PARTS + 1)
    motion = segments.sample(np.repeat(np.arange(k), len(phases)), np.tile(phases, k))
    tau = limits.dynamics.unchecked.rigid_body.inverse_dynamics_batch(*motion)
    steps = np.abs(np.diff(tau.reshape(k, len(phases), -1), axis=1)).max(axis=1)
    T = np.diff(segments.times)[:, np.newaxis]
    return np.asarray((_PARTS * steps / T / rates).max(axis=1))


def _smoothed(
    names: tuple[str, ...], timing: PathTiming, window: float,
) -> tuple[JointTrajectory, IntArray, IntArray]:
    """
    Return the motion with the mean σ̇ over a window [s], with accelerations at all k points.

    The other values (k,) are the first and last nodes between which σ̇ was averaged.
    """
    stops = np.flatnonzero(timing.grid.rests)
    points: list[TrajectoryPoint] = []
    nodes: list[FloatArray] = []
    begin = 0.0
    for first, last in zip(stops[:-1], stops[1:]):
        t, motion, part = _section(timing, slice(first, last), window)
        more = slice(1 if points else 0, None)
        points += [TrajectoryPoint(begin + float(time), *row) for time, *row in zip(
            t[more], *(values[more] for values in motion))]
        nodes.append(first + part[:, more])
        begin += float(t[-1])
    return JointTrajectory(names, tuple(points)), *np.concatenate(nodes, axis=1)


def _section(
    timing: PathTiming, rows: slice, window: float,
) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray], FloatArray]:
    """
    Return times (k,), and position, velocity and acceleration (k, n), from rest to rest.

    The last value are the nodes (2, k) between which σ̇ is averaged.
    """
    T, length = timing.duration[rows], timing.grid.length[rows]
    path = _PathTime(T, length, timing.speed[rows.start:rows.stop + 1])
    whole = path.t[-1] + window
    t = np.linspace(
        0.0, whole, 1 + int(np.ceil(whole / min(window / PER_WINDOW, LONGEST_STEP))))
    now, before = path.sample(t), path.sample(t - window)
    integral, sigma, rate = ((a - b) / window for a, b in zip(now, before))
    left, right = (PathEnd(*(values[rows] for values in end))
                   for end in (timing.grid.left, timing.grid.right))
    q, tangent, curvature = _at(length, left, right, integral)
    v, a = tangent * sigma[:, np.newaxis], (
        curvature * sigma[:, np.newaxis]**2 + tangent * rate[:, np.newaxis])
    v[[0, -1]] = a[[0, -1]] = 0.0
    q[0], q[-1] = left.q[0], right.q[-1]
    nodes = np.searchsorted(path.t, np.stack((t - window, t)))
    return t, (q, v, a), np.clip(nodes, 0, len(T))


class _PathTime:
    """σ over time: cubics between nodes, 0 before the start, constant after the end."""

    def __init__(self, T: FloatArray, length: FloatArray, speed: FloatArray) -> None:
        self.t = np.concatenate(([0.0], np.cumsum(T)))
        sigma = np.concatenate(([0.0], np.cumsum(length)))
        c = position_coefficients(
            [np.zeros((len(T), 1)), speed[:-1, np.newaxis]],
            [length[:, np.newaxis], speed[1:, np.newaxis]], T[:, np.newaxis])
        c[:, 0, 0] += sigma[:-1]
        self._T, self._end = T, sigma[-1]
        self._integral = np.zeros_like(c)
        self._integral[:, 1:] = T[:, np.newaxis, np.newaxis] * c[:, :5] / _ORDERS
        self._integral[1:, 0] = np.cumsum(self._integral[:-1].sum(axis=1), axis=0)

    def sample(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the integral of σ, σ and σ̇, (k,) each."""
        inside = np.clip(t, 0.0, self.t[-1])
        i = np.clip(np.searchsorted(self.t, inside, side='right') - 1, 0, len(self._T) - 1)
        T = self._T[i]
        integral, sigma, rate = (
            x[:, 0] for x in sample_pieces(self._integral[i], (inside - self.t[i]) / T))
        return (integral + self._end * np.maximum(t - self.t[-1], 0.0), sigma / T,
                np.where(t == inside, rate / T**2, 0.0))


def _at(
    length: FloatArray, left: PathEnd, right: PathEnd, sigma: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return position and its derivatives by σ at lengths (k,), (k, n) each."""
    along = np.concatenate(([0.0], np.cumsum(length)))
    i = np.clip(np.searchsorted(along, sigma, side='right') - 1, 0, len(length) - 1)
    left, right, h = left.rows(i), right.rows(i), length[i][:, np.newaxis]
    way = right.q - left.q
    c = position_coefficients(
        [np.zeros_like(way), left.tangent, left.curvature],
        [way, right.tangent, right.curvature], h)
    q, first, second = sample_pieces(c, np.clip((sigma - along[i]) / length[i], 0.0, 1.0))
    return left.q + q, first / h, second / h**2
