# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The effort against friction that the laws with references add to the motion equation."""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.control_law import LawInput

FRICTION_MODES = ('reference', 'measured', 'none')
"""The velocity at which friction is compensated; see `error_feedback`."""


class FrictionCompensation:
    """The compensation of n joints in one of FRICTION_MODES."""

    def __init__(self, mode: str, n: int) -> None:
        self._mode = mode
        self.none = np.zeros(n)
        self.none.setflags(write=False)

    def effort(
        self, state: LawInput, v_ref: FloatArray, e: FloatArray, rate: FloatArray,
        load: FloatArray,
    ) -> FloatArray:
        """
        Return the effort (n,) [N·m] or [N] at a state, along a reference with v_ref.

        `e` is the position error, `rate` K_p/K_d [1/s], and `load` the effort without friction. A
        stop from a measured velocity is not helped along: friction brakes the arm.
        """
        if self._mode == 'reference':
            if state.trajectory is not None and state.trajectory.is_from_measurement:
                v_ref = self.none
            return state.dynamics.friction.tracking_effort(v_ref, e, rate, load)
        if self._mode == 'none':
            return self.none
        return state.dynamics.friction_effort(state.v, load)
