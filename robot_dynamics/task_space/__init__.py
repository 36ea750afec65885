# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The dynamics of an arm at a point of a link: pose, Jacobian, Λ, and the forces of Khatib."""

from robot_dynamics.task_space.state import TaskSpaceState
from robot_dynamics.task_space.task_space import REFERENCES, TaskSpace

__all__ = ['REFERENCES', 'TaskSpace', 'TaskSpaceState']
