# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Control laws: computed torque, impedances, gravity compensation, and those of users."""

from robot_dynamics.control.laws.control_law import (
    ControlLaw,
    LawInput,
    LawOutput,
    LawParameter,
    LawTopic,
)
from robot_dynamics.control.laws.law_table import LAWS

__all__ = ['ControlLaw', 'LawInput', 'LawOutput', 'LawParameter', 'LawTopic', 'LAWS']
