# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""From a measured state to a safe effort: control law, limits, supervisor."""

from robot_dynamics.control.control_output import ControlOutput
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.control_law import ControlLaw, LawInput
from robot_dynamics.control.laws.error_feedback import Gains, make_gains
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.control.safety.effort_limiter import EffortLimiter, EffortLimits
from robot_dynamics.control.safety.ending import Ending, Kind
from robot_dynamics.control.safety.fault_action import SafetyOptions
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.control.safety.supervisor import CommandSupervisor

__all__ = [
    'CommandSupervisor',
    'ControlLaw',
    'Controller',
    'ControllerOptions',
    'ControlOutput',
    'EffortLimiter',
    'EffortLimits',
    'Ending',
    'Fault',
    'Gains',
    'Kind',
    'LawInput',
    'make_gains',
    'SafetyOptions',
]
