# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Joint trajectories: type, interpolation, limits, files, efforts and excitation trajectories."""

from robot_dynamics.trajectories.demo_motion import make_reference_motion
from robot_dynamics.trajectories.efforts import efforts_along, TrajectoryEfforts
from robot_dynamics.trajectories.excitation import find_excitation
from robot_dynamics.trajectories.files import read_trajectory, write_trajectory
from robot_dynamics.trajectories.follower import TrajectoryFollower
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics.trajectories.motion_limits import MotionLimits
from robot_dynamics.trajectories.reference_generator import ReferenceGenerator

__all__ = [
    'efforts_along',
    'find_excitation',
    'JointTrajectory',
    'make_reference_motion',
    'make_trajectory',
    'MotionLimits',
    'read_trajectory',
    'Reference',
    'ReferenceGenerator',
    'TrajectoryEfforts',
    'TrajectoryFollower',
    'write_trajectory',
]
