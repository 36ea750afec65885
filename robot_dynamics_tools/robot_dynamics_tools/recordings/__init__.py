# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings of rosbag2, read and written without ROS."""

from robot_dynamics_tools.recordings.bag_files import find_recordings
from robot_dynamics_tools.recordings.joint_series import JointSeries
from robot_dynamics_tools.recordings.reader import Recording
from robot_dynamics_tools.recordings.writer import RecordingWriter

__all__ = ['find_recordings', 'JointSeries', 'Recording', 'RecordingWriter']
