# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Quintic trajectories from rest to rest: point to point, and through via points."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.trajectories.interpolation import QUINTIC
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory, Points


def quintic_point_to_point(
    joint_names: Sequence[str], start: npt.ArrayLike, goal: npt.ArrayLike, duration: float,
) -> JointTrajectory:
    """
    Return the motion from rest at `start` to rest at `goal` in `duration` [s].

    Positions have shape (n,) [rad or m]; velocity and acceleration are zero at both ends, so
    that the path is q = start + (10 s³ - 15 s⁴ + 6 s⁵)(goal - start) with s = t / duration.
    Raises TrajectoryError. Source: K. M. Lynch and F. C. Park, Modern Robotics, 2017, section
    9.2.2 (fifth-order time scaling).
    """
    rest = [[0.0] * len(joint_names)] * 2
    return make_trajectory(joint_names, (0.0, duration), (start, goal), rest, rest)


def quintic_via_points(
    joint_names: Sequence[str], times: Sequence[float], positions: Points,
) -> JointTrajectory:
    """
    Return the smoothest motion through `positions` at `times`, from rest to rest.

    `times` (m,) [s], m >= 2, are strictly increasing; `positions` are (m, n) [rad or m]. Of all
    motions through these points with zero velocity and acceleration at both ends, this one has the
    smallest ∫ jerk² dt for each joint: quintics whose jerk and snap are continuous as well. The
    cost is one dense solve of 2 (m - 2) unknowns, suitable for a few hundred points.
    Raises TrajectoryError.
    """
    path = make_trajectory(joint_names, times, positions)
    if path.is_set_point:
        raise TrajectoryError('points has 1 point, expected at least a start and a goal')
    q = np.array([point.position for point in path.points])
    T = np.diff([point.time_from_start for point in path.points])
    v, a = _least_jerk_derivatives(q, T)
    return make_trajectory(joint_names, times, q, v, a)


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
    rows: FloatArray = np.vstack((third, fourth)) @ QUINTIC * np.tile((1.0, T, T**2), 2)
    return rows
