# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
An excitation motion as a joint trajectory, and the peaks of the interpolated motion.

The points are so close together that the quintics between them, with which `dynamics` and
`joint_trajectory_controller` interpolate, agree with the Fourier series to about one millionth.
"""

from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics.validation import check_scalar
from robot_dynamics_tools.excitation.demo_motion import sample_trajectory
from robot_dynamics_tools.excitation.excitation import Excitation

POINTS_PER_PERIOD = 24
"""Points per period of the fastest harmonic."""
_CHECKS_PER_SEGMENT = 8


@dataclass(frozen=True, eq=False)
class ExcitingTrajectory:
    """
    A trajectory, and the peaks (n,) of its interpolation.

    The peaks are the `lowest` and `highest` position [rad or m], and the largest magnitudes of
    `velocity`, `acceleration` and `effort`. `interpolation_error` is the largest distance from the
    series [rad or m]. `lead` [s] is the time of the first point, which is at rest at the start of
    the motion.
    """

    trajectory: JointTrajectory
    lead: float
    lowest: FloatArray
    highest: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    effort: FloatArray
    interpolation_error: float


def exciting_trajectory(
    excitation: Excitation, dynamics: ArmDynamics, lead: float = 0.0,
) -> ExcitingTrajectory:
    """
    Return the motion as a trajectory that has `lead` [s] to reach its first point.

    The motion between the samples of the search stays within the limits, because `excitation.KEPT`
    leaves room for it. Raises InvalidInputError if the lead is negative.
    """
    check_scalar('lead', lead, 0.0)
    count = POINTS_PER_PERIOD * excitation.harmonics
    times = np.linspace(0.0, excitation.duration, count + 1)
    names = dynamics.arm.joint_names
    motion = excitation.motion(times)
    for values in motion:  # exact values at the ends, without rounding errors
        values[-1] = values[0]
    motion.velocity[[0, -1]] = motion.acceleration[[0, -1]] = 0.0

    def begun_at(first: float) -> JointTrajectory:
        return make_trajectory(names, (first + times).tolist(), *motion)

    trajectory = begun_at(0.0)
    dense = np.linspace(0.0, excitation.duration, _CHECKS_PER_SEGMENT * count + 1)
    q, v, a = sample_trajectory(trajectory, dense)
    effort = np.abs(dynamics.inverse_dynamics_batch(q, v, a)).max(axis=0)
    return ExcitingTrajectory(
        begun_at(lead), lead,
        q.min(axis=0), q.max(axis=0), np.abs(v).max(axis=0), np.abs(a).max(axis=0), effort,
        float(np.abs(q - excitation.motion(dense).position).max()))
