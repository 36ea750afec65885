# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The motion between two points of a trajectory, one time at a time."""

from robot_dynamics.trajectories.interpolation import evaluate, motion_coefficients, Reference
from robot_dynamics.trajectories.joint_trajectory import TrajectoryPoint


def sample_segment(
    t: float, t0: float, p0: TrajectoryPoint, t1: float, p1: TrajectoryPoint,
) -> Reference:
    """
    Return the reference at the time `t` between `p0` at `t0` and `p1` at `t1`, all times in [s].

    A `t` outside [t0, t1] is replaced with the nearer end. The `time_from_start` of the points is
    not used.
    """
    span = min(max(t, t0), t1) - t0
    return evaluate(motion_coefficients(p0, p1, t1 - t0), span / (t1 - t0))
