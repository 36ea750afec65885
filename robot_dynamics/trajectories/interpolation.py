# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Interpolation between the points of a joint trajectory: q(t), v(t), a(t) on one segment.

The interpolation is that of `joint_trajectory_controller` (ros2_controllers, branch jazzy,
class `Trajectory`): linear, cubic or quintic, depending on the fields of both ends of a segment.
docs/evidence/jtc.md lists the differences.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.trajectories.joint_trajectory import TrajectoryPoint

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
QUINTIC = np.array([
    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.5, 0.0, 0.0, 0.0],
    [-10.0, -6.0, -1.5, 10.0, -4.0, 0.5],
    [15.0, 8.0, 1.5, -15.0, 7.0, -1.0],
    [-6.0, -3.0, -0.5, 6.0, -3.0, 0.5],
])
_BY_FIELDS = {1: _LINEAR, 2: _CUBIC, 3: QUINTIC}
_ORDERS = np.arange(6.0)[:, np.newaxis]


class Reference(NamedTuple):
    """
    The desired state of the arm at one instant: three arrays of shape (n,).

    `position` [rad or m], `velocity` [rad/s or m/s], `acceleration` [rad/s² or m/s²].
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


class Segment(NamedTuple):
    """
    The motion from one point to the next.

    It is active from `since_ns` until before `end_ns`, and begins at `begin_ns`; `duration` [s].
    `coefficients` has shape (6, 3 n): those of position, velocity and acceleration.
    """

    since_ns: int
    end_ns: int
    begin_ns: int
    duration: float
    coefficients: FloatArray

    def phase(self, now_ns: int) -> float:
        """Return s, the elapsed fraction of the segment, from 0 to 1."""
        return (now_ns - self.begin_ns) / NANOSECONDS_PER_SECOND / self.duration


def constant_segment(since_ns: int, end_ns: int, state: Reference) -> Segment:
    """Return the segment of a reference that does not change between two times [ns]."""
    c = np.zeros((6, 3 * len(state.position)))
    c[0] = np.concatenate(state)
    return Segment(since_ns, end_ns, since_ns, 1.0, c)


def motion_coefficients(p0: TrajectoryPoint, p1: TrajectoryPoint, T: float) -> FloatArray:
    """
    Return the coefficients of 1, s, …, s⁵ for s = t / T, of q, q̇ and q̈ side by side.

    The interpolation is quintic if both points have velocity and acceleration, cubic if both have
    velocity, and otherwise linear with acceleration 0. Source: K. M. Lynch and F. C. Park, Modern
    Robotics, 2017, section 9.3 (cubic) and, for quintics from conditions at both ends, J. J.
    Craig, Introduction to Robotics, 3rd edition, section 7.3.
    """
    c = position_coefficients(*_common_fields(p0, p1), T)
    v, a = np.zeros_like(c), np.zeros_like(c)
    v[:5] = c[1:] * (_ORDERS[1:] / T)
    a[:4] = c[2:] * (_ORDERS[2:] * _ORDERS[1:5] / T**2)
    return np.hstack((c, v, a))


def _common_fields(
    p0: TrajectoryPoint, p1: TrajectoryPoint,
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return those fields (position, velocity, acceleration) of two points that both have."""
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

    The fields of `start` and `end` determine the degree: position, velocity and acceleration, or
    the first or the first two of these, each (..., n). T [s] is a number, or (..., 1).
    """
    scaled = [x * T**order for side in (start, end) for order, x in enumerate(side)]
    return np.asarray(_BY_FIELDS[len(start)] @ np.stack(scaled, axis=-2))


def evaluate(c: FloatArray, s: float) -> Reference:
    """Return the reference of `motion_coefficients` c (6, 3 n) at s = t / T in [0, 1]."""
    s2 = s * s
    s3 = s2 * s
    values = np.array((1.0, s, s2, s3, s2 * s2, s2 * s3)) @ c
    n = len(values) // 3
    return Reference(values[:n], values[n:2 * n], values[2 * n:])
