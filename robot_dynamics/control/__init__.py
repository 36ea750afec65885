# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""From a measured state to a safe effort: control law, limits, supervisor."""

from robot_dynamics.control.control_output import ControlOutput
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.control_law import ControlLaw, LawInput
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import ControllerOptions

__all__ = [
    'ControlLaw', 'Controller', 'ControllerOptions', 'ControlOutput', 'LawInput', 'make_gains']
