# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Interpolation of a trajectory at many samples on all segments at once."""

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.trajectories.extrema import derivative
from robot_dynamics.trajectories.interpolation import position_coefficients, Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory

_ORDERS = np.arange(6)


class TrajectorySegments:
    """
    The k segments between the k + 1 points of a trajectory of n joints.

    The motion to the first point is not included. `points` are position, velocity and acceleration
    at the points, (k + 1, n) each. Fields that a point omits have the value that
    `ActiveTrajectory` returns there, on the segment that begins at the point.
    """

    def __init__(self, trajectory: JointTrajectory) -> None:
        points = trajectory.points
        self.times: FloatArray = np.array([point.time_from_start for point in points])
        """Times [s] of the points, (k + 1,)."""
        q: FloatArray = np.array([point.position for point in points])
        v, has_v = _field([point.velocity for point in points], q)
        a, has_a = _field([point.acceleration for point in points], q)
        T = self._duration = np.diff(np.rint(1e9 * self.times))[:, np.newaxis] / 1e9
        self.coefficients = np.zeros((len(points) - 1, 6, q.shape[1]))
        """The coefficients (k, 6, n) of 1, s, …, s⁵ of the positions, with the phase s."""
        self._end_velocity = np.diff(q, axis=0) / T
        both_v = has_v[1:] & has_v[:-1]
        fields = 1 + both_v + (both_v & has_a[1:] & has_a[:-1])
        for count in (1, 2, 3):
            rows, given = np.flatnonzero(fields == count), (v, a)[:count - 1]
            # Relative to the start position, so that a joint at rest has exactly zero velocity.
            way = np.zeros_like(q[rows]), q[rows + 1] - q[rows]
            self.coefficients[rows] = position_coefficients(
                [way[0], *(x[rows] for x in given)], [way[1], *(x[rows + 1] for x in given)],
                T[rows])
            if count > 1:
                self._end_velocity[rows] = v[rows + 1]
        self.coefficients[:, 0] += q[:-1]
        start = self.sample(np.arange(self.count), np.zeros(self.count))
        v[:-1] = np.where(has_v[:-1, np.newaxis], v[:-1], start.velocity)
        a[:-1] = np.where(has_a[:-1, np.newaxis], a[:-1], start.acceleration)
        self.points = Reference(q, v, a)

    @property
    def count(self) -> int:
        """The number of segments, k."""
        return len(self.coefficients)

    @property
    def velocity_coefficients(self) -> FloatArray:
        """The coefficients (k, 5, n) of 1, s, …, s⁴ of the velocities, with the phase s."""
        return derivative(self.coefficients) / self._duration[:, np.newaxis]

    def time(self, segment: IntArray, phase: FloatArray) -> FloatArray:
        """Return the times [s] from the start of the trajectory; the arguments are broadcast."""
        return (1.0 - phase) * self.times[segment] + phase * self.times[segment + 1]

    def sample(self, segment: IntArray, phase: FloatArray) -> Reference:
        """
        Return position, velocity and acceleration, (m, n) each.

        Each sample is on a `segment` (m,), at the `phase` (m,) in [0, 1].
        """
        T = self._duration[segment]
        position, first, second = sample_pieces(self.coefficients[segment], phase)
        # Exact at the end: the velocity at rest must be exactly 0, because of dry friction.
        velocity = np.where(phase[:, np.newaxis] == 1.0, self._end_velocity[segment], first / T)
        return Reference(position, velocity, second / T**2)


def sample_pieces(
    c: FloatArray, phase: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return polynomials c (m, 6, n) and their first two derivatives by the phase (m,)."""
    powers = np.vander(phase, 6, increasing=True)
    first, second = np.zeros_like(powers), np.zeros_like(powers)
    first[:, 1:] = _ORDERS[1:] * powers[:, :-1]
    second[:, 2:] = _ORDERS[2:] * _ORDERS[1:-1] * powers[:, :-2]
    values = np.stack((powers, first, second), axis=1) @ c
    return values[:, 0], values[:, 1], values[:, 2]


def _field(
    rows: list[FloatArray | None], position: FloatArray,
) -> tuple[FloatArray, BoolArray]:
    """Return a field of all points (m, n), 0 where it is absent, and which points have it (m,)."""
    has = np.array([row is not None for row in rows], dtype=np.bool_)
    values = np.zeros_like(position)
    if has.any():
        values[has] = [row for row in rows if row is not None]
    return values, has
