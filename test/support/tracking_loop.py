# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The loop of computed torque with given gains."""

import numpy as np
from robot_dynamics.control.gains.gain_scaling import loop_gains, LoopGains
from robot_dynamics.control.laws.computed_torque import ComputedTorque
from robot_dynamics.control.laws.error_feedback import ErrorFeedback, Gains
from robot_dynamics.control.options import ControllerOptions

MASS = np.diag([2.0, 0.5])[np.newaxis]
"""M of two joints without coupling, (1, 2, 2) [kg·m²]."""


def loop_of(gains: Gains, mass_matrices: np.ndarray = MASS) -> LoopGains:
    """Return the loop with these gains at poses with M (m, n, n)."""
    law = ComputedTorque(
        ErrorFeedback(gains, ('revolute',) * len(gains.kp)), ControllerOptions(gains))
    return loop_gains(law.closed_loop, mass_matrices)
