# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Joint impedance: a spring and a damper between each joint and its reference.

With the given stiffness K_0, diagonal, and the modes K_0 = Q Ω² Qᵀ of `modal_impedance`,
K = Q min(Ω, Ω_c)² Qᵀ and D = 2 Q min(Ω, Ω_c) Qᵀ: the modes of light joints, and of joints that
turn against each other, are slowed down, and slower modes keep K_0. All are critically damped.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.control_law import LawParameter
from robot_dynamics.control.laws.error_feedback import ErrorFeedback
from robot_dynamics.control.laws.modal_impedance import ModalImpedance, root_of
from robot_dynamics.control.options import LawOptions
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics

FULL_EFFORT_ERROR = 0.25
"""[rad] or [m] of error at which the default stiffness takes the effort limit of a joint."""
UNLIMITED_STIFFNESS = 100.0
"""Default stiffness [N·m/rad] or [N/m] of a joint without an effort limit."""


class JointImpedance(ModalImpedance):
    """The law τ = M q̈_ref + C q̇ + g + friction + K e + D ė."""

    PARAMETERS = (
        LawParameter('impedance.stiffness', (), (
            'Stiffness [N·m/rad] or [N/m] of joint_impedance; one value for all joints or one per '
            'joint. If empty, the effort limit of the joint per 0.25 rad or 0.25 m, 100 without '
            'an effort limit.'), maximum=1e8),
    )

    def __init__(self, feedback: ErrorFeedback, options: LawOptions) -> None:
        super().__init__(feedback, options)
        self._stiffness, = options.parameters.values()
        if self._stiffness is None:
            limit = options.arm.limits.effort
            self._stiffness = np.where(
                np.isfinite(limit), limit / FULL_EFFORT_ERROR, UNLIMITED_STIFFNESS)

    def gains(
        self, dynamics: UncheckedArmDynamics, q: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return K and D (n, n) at q (n,); raise LinAlgError far outside of the model's range."""
        L = root_of(dynamics.rigid_body.mass_matrix(q))
        to_modes = np.linalg.inv(L)
        squares, V = np.linalg.eigh((to_modes * self._stiffness) @ to_modes.T)
        Q, omega = L @ V, np.minimum(np.sqrt(np.maximum(squares, 0.0)), self.largest_frequency)
        return (Q * omega**2) @ Q.T, (Q * (2.0 * omega)) @ Q.T
