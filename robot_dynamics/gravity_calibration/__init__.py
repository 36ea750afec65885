# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Calibration of effort scale and offset of each joint from static holds."""

from robot_dynamics.gravity_calibration.calibration import calibrate_holds, Calibration, Reference
from robot_dynamics.gravity_calibration.holds import find_holds, Hold
from robot_dynamics.gravity_calibration.poses import CalibrationPoses, select_poses
from robot_dynamics.gravity_calibration.recorded_holds import (
    calibrate_recordings,
    RecordedCalibration,
)
from robot_dynamics.gravity_calibration.tool_estimate import Tool, ToolEstimate

__all__ = [
    'calibrate_holds',
    'calibrate_recordings',
    'Calibration',
    'CalibrationPoses',
    'find_holds',
    'Hold',
    'RecordedCalibration',
    'Reference',
    'select_poses',
    'Tool',
    'ToolEstimate',
]
