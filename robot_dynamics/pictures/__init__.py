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

"""Pictures of an arm: stick figure, marks, torque maps, workspace."""

from robot_dynamics.pictures.arm_marks import ArmMarks
from robot_dynamics.pictures.stick_figure import StickFigure
from robot_dynamics.pictures.torque_map import map_figure
from robot_dynamics.pictures.workspace_map import workspace_figure

__all__ = [
    'ArmMarks',
    'map_figure',
    'StickFigure',
    'workspace_figure',
]
