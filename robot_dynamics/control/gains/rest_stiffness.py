# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The stiffness of the closed loop at rest, and the error at which friction can hold a joint."""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.law_table import NO_COMMAND


class RestStiffness(NamedTuple):
    """
    The closed loop of a law that follows references, at rest, each (n,).

    `stiffness` K_j [N·m/rad] or [N/m] is the effort of the feedback per position error of the
    joint, with scaled gains: of computed torque M_jj K_p, with rotors as far as they are known.
    `friction_error` [rad] or [m] is the position error up to which the known dry friction F_s can
    hold the joint against the feedback and against the compensation of F_s over the width w
    (`tracking_effort`), if it acts at rest: F_s / (K_j + F_s / w). It is NaN if no dry friction
    is known.
    """

    stiffness: FloatArray
    friction_error: FloatArray


def rest_stiffness(controller: Controller) -> RestStiffness | None:
    """Return the stiffness at the last state, None without a state or a law that follows."""
    with controller.lock:
        laws, state = controller.laws, controller.state
        if state is None or not laws.follows or controller.options.command == NO_COMMAND:
            return None
        M = controller.dynamics.rigid_body.mass_matrix(state[1])
        K = laws.with_reference.stiffness(M)
    friction = controller.dynamics.arm.friction
    F_s = friction.at_rest.static
    is_compensated = controller.options.friction_compensation == 'reference'
    spring = F_s / friction.tracking_width if is_compensated else 0.0
    with np.errstate(divide='ignore', invalid='ignore'):
        return RestStiffness(K, np.where(F_s > 0.0, F_s / (K + spring), np.nan))
