# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Joint impedance: a spring and a damper between each joint and its reference.

With the given stiffness K_0, diagonal, and the modes K_0 = Q Ω² Qᵀ of `modal_impedance`,
K = Q min(Ω, Ω_c)² Qᵀ and D = 2 ζ Q min(Ω, Ω_c) Qᵀ: the modes of light joints, and of joints that
turn against each other, are slowed down, and slower modes keep K_0. A given damping D_0 replaces
this D, raised to 2 LEAST_RATIO Q min(Ω, Ω_c) Qᵀ and lowered to 2 Ω_c M.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.control_law import LawParameter
from robot_dynamics.control.laws.error_feedback import ErrorFeedback, LEAST_RATIO
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
        LawParameter('impedance.damping_ratio', (1.0,), (
            'Damping ratio of joint_impedance, with the inertia in the present configuration; one '
            'value for all joints or one per joint.'), 0.2, 1e4),
        LawParameter('impedance.damping', (), (
            'Damping [N·m·s/rad] or [N·s/m] of joint_impedance, which replaces '
            'impedance.damping_ratio; one value for all joints or one per joint. At least half of '
            'the critical damping acts.'), maximum=1e8),
    )

    def __init__(self, feedback: ErrorFeedback, options: LawOptions) -> None:
        self._stiffness, ratio, self._damping = options.parameters.values()
        if self._stiffness is None:
            limit = options.arm.limits.effort
            self._stiffness = np.where(
                np.isfinite(limit), limit / FULL_EFFORT_ERROR, UNLIMITED_STIFFNESS)
        if self._damping is not None:  # between LEAST_RATIO and 1 at the largest frequency
            ratio = np.ones_like(self._stiffness)
        super().__init__(feedback, options, ratio)

    def gains(
        self, dynamics: UncheckedArmDynamics, q: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return K and D (n, n) at q (n,), NaN far outside of the range of the model."""
        M = dynamics.rigid_body.mass_matrix(q)
        try:
            L = root_of(M)
        except np.linalg.LinAlgError:  # M is not positive definite, because of its rounding
            return np.full_like(M, np.nan), np.full_like(M, np.nan)
        to_modes = np.linalg.inv(L)
        squares, V = np.linalg.eigh((to_modes * self._stiffness) @ to_modes.T)
        largest, Q = self.largest_frequency, L @ V
        omega = np.minimum(np.sqrt(np.maximum(squares, 0.0)), largest)
        K = (Q * omega**2) @ Q.T
        if self._damping is None:
            zeta = np.sqrt(self._damping_ratio)
            return K, 2.0 * zeta[:, np.newaxis] * ((Q * omega) @ Q.T) * zeta
        least, most = np.diag(2.0 * LEAST_RATIO * omega), 2.0 * largest * np.eye(len(M))
        given = (V.T @ to_modes * self._damping) @ (V.T @ to_modes).T
        D = most - _positive_part(most - (least + _positive_part(given - least)))
        return K, Q @ D @ Q.T


def _positive_part(A: FloatArray) -> FloatArray:
    """Return a symmetric matrix (n, n) with its negative eigenvalues replaced by 0."""
    values, vectors = np.linalg.eigh(A)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)
