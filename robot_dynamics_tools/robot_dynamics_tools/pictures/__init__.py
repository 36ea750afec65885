# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Pictures of an arm: stick figure, marks, torque maps and the workspace."""

from robot_dynamics_tools.pictures.arm_marks import ArmMarks
from robot_dynamics_tools.pictures.stick_figure import StickFigure
from robot_dynamics_tools.pictures.torque_map import map_figure
from robot_dynamics_tools.pictures.workspace_map import workspace_figure

__all__ = ['ArmMarks', 'map_figure', 'StickFigure', 'workspace_figure']
