# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Trajectories compared with the position and velocity limits of an arm.

A goal is checked at its points, which the sender has chosen. A trajectory in a service request is
also checked between the points, where the interpolation may exceed a limit.
"""

from dataclasses import replace

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm import ArmModel, JointLimits
from robot_dynamics.trajectories.extrema import extrema
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, TrajectoryPoint
from robot_dynamics.trajectories.limit_warnings import lines_outside
from robot_dynamics.trajectories.segments import TrajectorySegments

POSITION_TOLERANCE = 0.0087
"""
Distance [rad] or [m] beyond a position limit above which a fault occurs: 0.5°, as in ros2_control.

The first of several points, usually the present position of the arm, may be that far beyond.
"""
_TOLERANCE = 1e-6
"""Tolerance [rad] or [m], and of velocity limits, for rounding of limits and points."""
_REMEDY = {
    'positions': "'clip' clips positions", 'velocities': "'slow_down' lowers velocities"}


def check_points(
    arm: ArmModel, trajectory: JointTrajectory, has_velocities: bool = True,
) -> None:
    """
    Raise TrajectoryError for a point beyond a position limit, or a velocity limit if selected.

    The message names point, joint, value and limit of the first such value, and their number.
    """
    points, limits = trajectory.points, arm.limits
    q: FloatArray = np.array([point.position for point in points])
    v: FloatArray = np.array([
        np.zeros_like(point.position) if point.velocity is None else point.velocity
        for point in points])
    tolerance = np.full((len(points), 1), _TOLERANCE)
    if not trajectory.is_set_point:
        tolerance[0] = POSITION_TOLERANCE
    fields = [('positions', q, limits.lower, limits.upper, tolerance),
              ('velocities', v, -limits.velocity, limits.velocity, _TOLERANCE * limits.velocity)]
    outside = [np.maximum(lower - values, values - upper) > slack
               for _, values, lower, upper, slack in fields[:2 if has_velocities else 1]]
    count = sum(int(one.sum()) for one in outside)
    for (field, values, lower, upper, _), is_outside in zip(fields, outside):
        for i, j in np.argwhere(is_outside)[:1]:
            others = f'; {count} values are beyond a limit' if count > 1 else ''
            raise TrajectoryError(
                f'points[{i}].{field} ({arm.joint_names[j]}) is {values[i, j]:.6g}, expected a '
                f'value within its limits [{lower[j]:.6g}, {upper[j]:.6g}]{others} '
                f'(infeasible_trajectory: {_REMEDY[field]})')


def with_clipped_positions(arm: ArmModel, trajectory: JointTrajectory) -> JointTrajectory:
    """Return the trajectory with clipped positions, at rest where a position was clipped."""
    return replace(trajectory, points=tuple(
        _clipped_position(point, arm.limits) for point in trajectory.points))


def with_clipped_velocity(arm: ArmModel, set_point: JointTrajectory) -> JointTrajectory:
    """Return a set-point with its velocities clipped to the limits."""
    point, limit = set_point.points[0], arm.limits.velocity
    if point.velocity is None:
        return set_point
    return replace(set_point, points=(
        replace(point, velocity=np.clip(point.velocity, -limit, limit)),))


def motion_excesses(arm: ArmModel, trajectory: JointTrajectory) -> list[str]:
    """
    Return one line for each joint whose position or velocity exceeds its limits in the motion.

    Each line names joint, largest excess, limit and time. The motion consists of the points and
    the interpolated segments, without the motion to the first point.
    """
    segments, limits = TrajectorySegments(trajectory), arm.limits
    q, q_times = _points_and_extrema(
        segments, segments.points.position, segments.coefficients)
    v, v_times = _points_and_extrema(
        segments, segments.points.velocity, segments.velocity_coefficients)
    return [
        *lines_outside('position', arm.joint_names, q, limits.lower, limits.upper, _TOLERANCE,
                       q_times),
        *lines_outside('velocity', arm.joint_names, v, -limits.velocity, limits.velocity,
                       _TOLERANCE * limits.velocity, v_times)]


def _points_and_extrema(
    segments: TrajectorySegments, at_points: FloatArray, coefficients: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the values at the points and the extrema between them, and their times (m, n)."""
    phases, values = extrema(coefficients)
    times = segments.time(np.arange(segments.count)[:, np.newaxis], phases)
    point_times = np.broadcast_to(segments.times[:, np.newaxis], at_points.shape)
    return np.concatenate((at_points, *values)), np.concatenate((point_times, *times))


def _clipped_position(point: TrajectoryPoint, limits: JointLimits) -> TrajectoryPoint:
    q = np.clip(point.position, limits.lower, limits.upper)
    is_clipped: BoolArray = q != point.position
    if not is_clipped.any():
        return point
    q.setflags(write=False)
    v, a = (None if rate is None else np.where(is_clipped, 0.0, rate)
            for rate in (point.velocity, point.acceleration))
    return TrajectoryPoint(point.time_from_start, q, v, a)
