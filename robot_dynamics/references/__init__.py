# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The planner of references, and what follows trajectories and streams."""

from robot_dynamics.references.motion_limits import MotionLimits
from robot_dynamics.references.reference_generator import ReferenceGenerator

__all__ = [
    'MotionLimits',
    'ReferenceGenerator',
]
