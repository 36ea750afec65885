# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Pictures of an arm: stick figure and marks."""

from robot_dynamics.pictures.arm_marks import ArmMarks
from robot_dynamics.pictures.stick_figure import StickFigure

__all__ = [
    'ArmMarks',
    'StickFigure',
]
