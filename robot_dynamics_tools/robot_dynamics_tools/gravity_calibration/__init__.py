# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Calibration of effort scale and offset of each joint from static holds."""

from robot_dynamics_tools.gravity_calibration.calibration import (
    calibrate_holds,
    Calibration,
    ScaleReference,
)
from robot_dynamics_tools.gravity_calibration.holds import find_holds, Hold
from robot_dynamics_tools.gravity_calibration.poses import CalibrationPoses, select_poses
from robot_dynamics_tools.gravity_calibration.recorded_holds import (
    calibrate_recordings,
    RecordedCalibration,
)
from robot_dynamics_tools.gravity_calibration.scale_fit import Tool, ToolEstimate

__all__ = [
    'calibrate_holds',
    'calibrate_recordings',
    'Calibration',
    'CalibrationPoses',
    'find_holds',
    'Hold',
    'RecordedCalibration',
    'ScaleReference',
    'select_poses',
    'Tool',
    'ToolEstimate',
]
