# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Limits of efforts, faults, stops and ramps."""

from robot_dynamics.control.safety.effort_limiter import EffortLimiter, EffortLimits
from robot_dynamics.control.safety.ending import Ending, Kind
from robot_dynamics.control.safety.fault_action import SafetyOptions
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.control.safety.supervisor import CommandSupervisor

__all__ = [
    'CommandSupervisor',
    'EffortLimiter',
    'EffortLimits',
    'Ending',
    'Fault',
    'Kind',
    'SafetyOptions',
]
