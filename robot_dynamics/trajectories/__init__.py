# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Joint trajectories: type, interpolation, exact limits, files and efforts."""

from robot_dynamics.trajectories.efforts import efforts_along, TrajectoryEfforts
from robot_dynamics.trajectories.files import read_trajectory, write_trajectory
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics.trajectories.retiming import retime, Retiming

__all__ = [
    'efforts_along',
    'JointTrajectory',
    'make_trajectory',
    'read_trajectory',
    'Reference',
    'retime',
    'Retiming',
    'TrajectoryEfforts',
    'write_trajectory',
]
