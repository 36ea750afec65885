# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The fastest timing of a path within the limits of an arm, or the least uniform slow-down.

The limits of effort contain payload and friction, and those of motors current and voltage. The
method is TOPP-RA with collocation (`reachability`); the constraints are linear at the states of
the last pass, and are tightened where the resulting trajectory exceeds a limit between the nodes.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.trajectories.goal_limits import motion_excesses
from robot_dynamics.trajectories.interpolation import position_coefficients
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, TrajectoryPoint
from robot_dynamics.trajectories.path import path_of
from robot_dynamics.trajectories.path_grid import make_grid, PathGrid
from robot_dynamics.trajectories.reachability import fastest_states, UNBOUNDED
from robot_dynamics.trajectories.segments import TrajectorySegments
from robot_dynamics.trajectories.slow_down import largest_ratios, slower, within_limits
from robot_dynamics.trajectories.smoothing import durations, PathTiming, within_rates
from robot_dynamics.trajectories.timing_limits import (
    check_slow_motion,
    constraints,
    path_terms,
    PathLimits,
    PathTerms,
    velocity_caps,
)
from robot_dynamics.validation import check_choice, check_scalar, check_vector, is_empty

METHODS = ('fastest', 'slow_down')
_PASSES, _EXACT, _EXACT_BY_TANGENTS, _CLOSE, _START = 10, 4e-5, 1e-4, 0.02, 0.5
_PARTS, _PARTS_OF_STEEP_FRICTION = 2, 8
_SHORTEST, _SHORTEST_FROM_REST = 5e-5, 1.5e-4
"""Times between two points of the result [s]; rounding of shorter times is noticeable."""


class Retiming(NamedTuple):
    """
    A trajectory with another timing.

    `trajectory` begins at 0 s. It has positions and velocities, because its accelerations are not
    continuous, and with `effort_rate_limits` accelerations too. `duration` [s]; `ratio` is the
    duration divided by that of the request.
    `limiting_joint` and `limited_quantity` name, for each point, the value closest to its limit,
    just before or after the point: 'velocity', 'acceleration', 'effort', 'current' or 'voltage'.
    `limit_ratio` (points,) is this value divided by its limit. `efforts` (points, n) [N·m] or [N]
    are those just after the points. `warnings` are positions beyond their limits.
    """

    trajectory: JointTrajectory
    duration: float
    ratio: float
    limiting_joint: tuple[str, ...]
    limited_quantity: tuple[str, ...]
    limit_ratio: FloatArray
    efforts: FloatArray
    warnings: tuple[str, ...]

    @property
    def summary(self) -> str:
        """The durations, and the value that is most often closest to its limit."""
        pairs = list(zip(self.limited_quantity, self.limiting_joint))
        quantity, joint = max(sorted(set(pairs)), key=pairs.count)
        return (f'the motion takes {self.duration:.4g} s, {self.ratio:.4g} times the duration of '
                f'the request; most often the {quantity} of {joint!r} is closest to its limit')


def retime(
    dynamics: ArmDynamics, trajectory: JointTrajectory, method: str = 'fastest',
    corner_tolerance: float = 0.0, acceleration_limits: npt.ArrayLike = (),
    effort_limit_fraction: float = 1.0, effort_rate_limits: npt.ArrayLike = (),
) -> Retiming:
    """
    Return the trajectory with the fastest timing, or slowed down, within the limits of the arm.

    The joints are in the arm's order. The limits are those of velocity and effort of the arm, with
    its payloads and friction, and of current and voltage of its motors; `acceleration_limits`
    [rad/s²] or [m/s²] (n,), or one number, are none if empty. `effort_limit_fraction` in (0, 1] is
    the usable share of effort, current and voltage. With `effort_rate_limits` [N·m/s] or [N/s]
    (n,), or one number, efforts without friction do not jump (`smoothing`); none if empty.

    'fastest' keeps the path (`path_of`, with `corner_tolerance` [rad] or [m]), starts and ends at
    rest, and rests where the request rests. 'slow_down' multiplies the times of a trajectory with
    velocities by the smallest factor of at least 1.

    Raises InvalidInputError for a wrong argument. Raises TrajectoryError if the path has no motion
    or a corner, if a pose exceeds a limit at rest or in slow motion, and if no limit applies.
    Source: H. Pham, Q.-C. Pham, IEEE Trans. Robotics 34(3), 2018.
    """
    check_choice('method', method, METHODS)
    check_scalar('corner_tolerance', corner_tolerance, minimum=0.0)
    share = check_scalar(
        'effort_limit_fraction', effort_limit_fraction, 0.0, 1.0, exclusive_minimum=True)
    names = dynamics.arm.joint_names
    limits = PathLimits(
        dynamics, _positive('acceleration_limits', acceleration_limits, names), share)
    rates = _positive('effort_rate_limits', effort_rate_limits, names)
    _check_limits(limits)
    points = trajectory.points
    before = points[-1].time_from_start - points[0].time_from_start
    q: FloatArray = np.array([point.position for point in points])
    check_slow_motion(limits, trajectory, q, dynamics.unchecked.rigid_body.gravity_batch(q))
    if method == 'slow_down':
        result = _slowed_down(limits, trajectory)
    else:
        grid, terms, x = _without_short_intervals(
            limits, trajectory, make_grid(path_of(trajectory, corner_tolerance)))
        timing = _fastest(limits, trajectory, grid, terms, x)
        if np.isfinite(rates).any():
            result = within_rates(limits, names, timing, terms, rates)
        else:
            result = within_limits(limits, slower(_as_trajectory(names, timing), 1.0))
    return _answer(limits, result, before)


def _answer(limits: PathLimits, result: JointTrajectory, before: float) -> Retiming:
    arm = limits.dynamics.arm
    ratios, joints, quantities = largest_ratios(limits, result)
    return Retiming(
        result, result.duration, result.duration / before,
        tuple(arm.joint_names[j] for j in joints), tuple(quantities), ratios,
        limits.dynamics.unchecked.inverse_dynamics_batch(*TrajectorySegments(result).points),
        _position_warnings(arm, result))


def _position_warnings(arm: ArmModel, result: JointTrajectory) -> tuple[str, ...]:
    q: FloatArray = np.array([point.position for point in result.points])
    if ((q >= arm.limits.lower) & (q <= arm.limits.upper)).all():
        return ()
    return tuple(motion_excesses(arm, result))


def _positive(field: str, given: npt.ArrayLike, names: Sequence[str]) -> FloatArray:
    """Return one limit per joint (n,), infinite if none are given; raise InvalidInputError."""
    if is_empty(given):
        return np.full(len(names), np.inf)
    a = np.asarray(given)
    limits = check_vector(
        field, np.broadcast_to(a, len(names)) if a.ndim == 0 else given, len(names), names)
    for name, limit in zip(names, limits):
        check_scalar(f'{field} of {name!r}', limit, minimum=0.0, exclusive_minimum=True)
    return limits


def _check_limits(limits: PathLimits) -> None:
    arm = limits.dynamics.arm
    for quantity, of_arm in (('velocity', limits.velocity), ('effort', arm.limits.effort)):
        for name, limit in zip(arm.joint_names, of_arm):
            if not limit > 0.0:
                raise TrajectoryError(
                    f'the {quantity} limit of {name!r} is {limit:g}, expected a number > 0')
    found = [limits.velocity, limits.acceleration, arm.limits.effort]
    if arm.actuators is not None:
        found += [arm.actuators.current_limit, arm.actuators.voltage_limit]
    if not any(np.isfinite(one).any() for one in found):
        raise TrajectoryError(
            'the arm has no limit of velocity, effort, current or voltage, and '
            'acceleration_limits is empty, expected at least one limit: the fastest timing would '
            'take no time')


def _slowed_down(limits: PathLimits, trajectory: JointTrajectory) -> JointTrajectory:
    for i, point in enumerate(trajectory.points):
        if point.velocity is None:
            raise TrajectoryError(
                f"points[{i}].velocities is empty, expected velocities for the method "
                "'slow_down': without them the velocity jumps; use the method 'fastest'")
    if len(trajectory.points) < 2:
        raise TrajectoryError('points has 1 point, expected at least 2: a path')
    return within_limits(limits, trajectory)


def _fastest(
    limits: PathLimits, trajectory: JointTrajectory, grid: PathGrid,
    terms: tuple[PathTerms, PathTerms], x: FloatArray,
) -> PathTiming:
    """Return the fastest timing, whose values may exceed limits slightly between the nodes."""
    m, n = grid.sign.shape
    margins, of_velocity = np.zeros((m, n)), np.zeros(m)
    duration = 0.0
    exact_at_once = not limits.depend_on_speed()
    if not exact_at_once:
        free_speed = velocity_caps(grid, limits.free_velocity(), of_velocity)
        x = _START * np.minimum(x, free_speed)
        rows = constraints(limits, grid, terms, x, _rise(grid, x), margins)
        x = np.minimum(
            fastest_states(rows, velocity_caps(grid, limits.velocity, of_velocity)), free_speed)
    rise = _rise(grid, x)
    best: tuple[float, FloatArray, FloatArray] = (np.inf, x, rise)
    for passed in range(_PASSES):
        rows = constraints(limits, grid, terms, x, rise, margins)
        before, x = x, fastest_states(rows, velocity_caps(grid, limits.velocity, of_velocity))
        _check_states(limits, trajectory, grid, x)
        T = durations(grid, x, rise)
        load, speed = _excesses(limits, grid, x, T, is_first=passed == 0)
        is_close = np.abs(x - before) <= _CLOSE * x
        known = (is_close[:-1] & is_close[1:]) | exact_at_once
        margins = np.where(
            known[:, np.newaxis], np.clip(margins + load, 0.0, 0.5), margins)
        of_velocity = np.clip(of_velocity + speed, 0.0, 0.5)
        largest = max(0.0, float(load.max()), float(speed.max()))
        slowed_down = float(T.sum()) * (1.0 + largest)
        if slowed_down < best[0]:
            best = slowed_down, x, T
        change, duration = abs(float(T.sum()) - duration), float(T.sum())
        if max(change / duration, largest) < (_EXACT if exact_at_once else _EXACT_BY_TANGENTS):
            break
        rise = _rise(grid, x) if passed < 3 else rise
        if passed == 0 and not exact_at_once:
            x = np.minimum(x, free_speed)
    _, x, T = best
    return PathTiming(grid, np.sqrt(x), T)


def _without_short_intervals(
    limits: PathLimits, trajectory: JointTrajectory, grid: PathGrid,
) -> tuple[PathGrid, tuple[PathTerms, PathTerms], FloatArray]:
    """Return the grid without nodes that would follow others in less than _SHORTEST."""
    m, n = grid.sign.shape
    terms = path_terms(limits.dynamics, grid.left), path_terms(limits.dynamics, grid.right)
    for each in terms:
        check_slow_motion(limits, trajectory, each.end.q, each.gravity, grid.sign)
    without_friction = limits._replace(dynamics=limits.dynamics.rigid_body)
    rows = constraints(
        without_friction, grid, terms, np.zeros(m + 1), np.zeros(m), np.zeros((m, n)))
    x = fastest_states(rows, velocity_caps(grid, limits.velocity, np.zeros(m)))
    _check_states(limits, trajectory, grid, x)
    speed = np.sqrt(x)
    times = np.concatenate(([0.0], np.cumsum(2.0 * grid.length / (speed[:-1] + speed[1:]))))
    keep = grid.rests.copy()
    stops = np.flatnonzero(grid.rests)
    for start, end in zip(stops[:-1], stops[1:]):
        last = times[start]
        for i in range(start + 1, end):
            from_rest = min(times[i] - times[start], times[end] - times[i])
            if times[i] - last >= _SHORTEST and from_rest >= _SHORTEST_FROM_REST:
                keep[i], last = True, times[i]
        keep[(start + end) // 2] |= not keep[start + 1:end].any()
    left, right = terms
    return grid.merged(keep), (
        left.rows(np.flatnonzero(keep[:-1])), right.rows(np.flatnonzero(keep[1:]))), x[keep]


def _check_states(
    limits: PathLimits, trajectory: JointTrajectory, grid: PathGrid, x: FloatArray,
) -> None:
    if x.max() > 1e-6 * UNBOUNDED:
        i = min(int(np.argmax(x)), len(grid.sign) - 1)
        moving = [name for name, s in zip(trajectory.joint_names, grid.sign[i]) if s != 0.0]
        raise TrajectoryError(
            f'no limit applies to the motion of {moving} at {grid.left.q[i].tolist()}, expected '
            'limits of velocity or effort of these joints, or acceleration_limits')
    stuck = (x[:-1] <= 0.0) & (x[1:] <= 0.0)
    if stuck.any():
        i = int(np.argmax(stuck))
        raise TrajectoryError(
            f'the arm cannot move on from {grid.left.q[i].tolist()} within its limits: an effort '
            'of gravity and friction is at its limit there')


def _rise(grid: PathGrid, x: FloatArray) -> FloatArray:
    """
    Return by how much the control rises over each interval (m,), 0 where it jumps.

    With constant controls the effort reaches its limit at one end of an interval only, and the
    duration has an error proportional to the width of the intervals.
    """
    u = np.diff(x) / (2.0 * grid.length)
    slope = np.zeros(len(u) + 1)
    slope[1:-1] = np.diff(u) / (0.5 * (grid.length[1:] + grid.length[:-1]))
    slope[grid.rests] = 0.0
    before, after = slope[:-1], slope[1:]
    least = np.where(np.abs(before) < np.abs(after), before, after)
    return np.asarray(np.where(before * after > 0.0, least, 0.0) * grid.length)


def _excesses(
    limits: PathLimits, grid: PathGrid, x: FloatArray, T: FloatArray, is_first: bool,
) -> tuple[FloatArray, FloatArray]:
    """
    Return the shares by which the interpolated trajectory exceeds limits, below 0 for none.

    They are those of efforts (m, n) and of velocities (m,), on each interval.
    """
    speed = np.sqrt(x)[:, np.newaxis]
    is_steep = limits.dynamics.arm.friction.steep_below.any() and not is_first
    T = T[:, np.newaxis]
    left, right = grid.left, grid.right
    v_0, v_1 = left.tangent * speed[:-1], right.tangent * speed[1:]
    way = right.q - left.q
    _, c1, c2, c3, *_ = np.moveaxis(
        position_coefficients([np.zeros_like(way), v_0], [way, v_1], T), 1, 0)

    def motion(phases: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        p = phases[:, np.newaxis, np.newaxis]
        v = (c1 + p * (2.0 * c2 + p * 3.0 * c3)) / T
        v[0], v[-1] = v_0, v_1
        return left.q + p * (c1 + p * (c2 + p * c3)), v, (2.0 * c2 + p * 6.0 * c3) / T**2

    phases = np.array([0.0, 0.5, 1.0])
    q, v, a = motion(phases)
    flat = -1, way.shape[1]
    load = limits.dynamics.unchecked.rigid_body.inverse_dynamics_batch(
        q.reshape(flat), v.reshape(flat), a.reshape(flat)).reshape(q.shape)
    if is_steep:  # the effort of the rigid bodies is smooth: a parabola
        phases = np.linspace(0.0, 1.0, 1 + _PARTS_OF_STEEP_FRICTION)
        parabola = np.linalg.solve(np.vander([0.0, 0.5, 1.0], 3).T, np.vander(phases, 3).T).T
        _, v, a = motion(phases)
        load = np.tensordot(parabola, load, 1)
    by_name = limits.ratios(v, a, load)
    ratio = by_name.pop('velocity').max(axis=(0, 2))
    peak = np.clip(-c2 / np.where(c3 != 0.0, 3.0 * c3, 1.0), 0.0, 1.0)
    fastest = np.abs(c1 + peak * (2.0 * c2 + peak * 3.0 * c3)) / T / limits.velocity
    largest = np.maximum.reduce(list(by_name.values())).max(axis=0)
    return largest - 1.0, np.maximum(ratio, fastest.max(axis=1)) - 1.0


def _as_trajectory(names: tuple[str, ...], timing: PathTiming) -> JointTrajectory:
    """Return the nodes as points."""
    grid, speed, T = timing
    t = np.concatenate(([0.0], np.cumsum(T)))
    q = np.concatenate((grid.left.q, grid.right.q[-1:]))
    v = np.concatenate((grid.left.tangent, grid.right.tangent[-1:])) * speed[:, np.newaxis]
    return JointTrajectory(names, tuple(
        TrajectoryPoint(float(time), *row) for time, *row in zip(t, q, v)))
