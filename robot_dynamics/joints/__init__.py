# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Models of one joint: friction, stiction, gears, motors, and the convention of its effort."""

from robot_dynamics.joints.actuator import Actuators, make_actuators
from robot_dynamics.joints.effort_convention import EffortConvention, make_effort_convention
from robot_dynamics.joints.friction import JointFriction, make_friction

__all__ = [
    'Actuators',
    'EffortConvention',
    'JointFriction',
    'make_actuators',
    'make_effort_convention',
    'make_friction',
]
