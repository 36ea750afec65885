# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The quantities of task space at one state, or at many states.

Source: O. Khatib, "A unified approach for motion and force control of robot manipulators: the
operational space formulation", IEEE J. Robotics and Automation 3(1), 1987; T. Yoshikawa,
"Manipulability of robotic mechanisms", Int. J. Robotics Research 4(2), 1985.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.exceptions import InvalidInputError

RANK_TOLERANCE = 1e-8
"""Singular value of J in SI units, relative to the largest, up to which a direction is lost."""


class _Decomposition(NamedTuple):
    """
    L⁻¹ Jᵀ = W Σ Uᵀ with M = L Lᵀ.

    U is (..., 6, 6), W (..., n, k) and `inverse` (..., k), the diagonal of Σ⁺, k = min(6, n).
    The rank is that of J, because singular values of L⁻¹ Jᵀ are also small for heavy directions.
    """

    L: FloatArray
    U: FloatArray
    inverse: FloatArray
    W: FloatArray


@dataclass(frozen=True, eq=False)
class TaskSpaceState:
    """
    Task space at one state: arrays have the given shapes, or (samples, ...) for many states.

    Vectors of six are linear [m], then angular [rad]. With v = J q̇ and the force F on the arm,

        Λ v̇ + μ + p = F,   τ = Jᵀ F,   Λ = (J M⁻¹ Jᵀ)⁻¹.

    M contains payloads and reflected rotor inertia; friction is no part of these equations.
    Other quantities are computed when they are first used. If the Jacobian has a rank below 6,
    Λ is the Moore–Penrose pseudo-inverse of Λ⁻¹ in SI units, and J̄, μ and p follow from it: no
    quantity is NaN, and only the margin of a joint without limits is infinite.
    """

    joint_position: FloatArray
    """q (n,) [rad] or [m]."""
    lower: FloatArray
    upper: FloatArray
    """Position limits (n,) [rad] or [m], infinite for no limit."""
    translation: FloatArray
    """The point in the base frame, (3,) [m]."""
    rotation: FloatArray
    """The rotation (3, 3) from the frame of the link to the base frame."""
    jacobian: FloatArray
    """J (6, n)."""
    bias_acceleration: FloatArray
    """J̇ q̇ (6,): the acceleration v̇ if q̈ = 0 [m/s²], [rad/s²]."""
    mass_matrix: FloatArray
    """M(q) (n, n)."""
    joint_gravity: FloatArray
    """g(q) (n,) [N·m] or [N]."""
    joint_coriolis: FloatArray
    """C(q, q̇) q̇ (n,) [N·m] or [N]."""

    @cached_property
    def inverse_inertia(self) -> FloatArray:
        """Λ⁻¹ = J M⁻¹ Jᵀ (6, 6), also at a rank loss: force to acceleration, [1/kg] and so on."""
        A = self._whitened[1]
        return np.asarray(np.swapaxes(A, -1, -2) @ A)

    @cached_property
    def inertia(self) -> FloatArray:
        """Λ (6, 6) [kg], [kg·m], [kg·m²]; at a rank loss the pseudo-inverse of Λ⁻¹."""
        scaled = self._reduced_U * self._decomposition.inverse[..., None, :]
        return np.asarray(scaled @ np.swapaxes(scaled, -1, -2))

    @cached_property
    def dynamic_inverse(self) -> FloatArray:
        """
        J̄ = M⁻¹ Jᵀ Λ (n, 6): the dynamically consistent inverse, which minimises q̇ᵀ M q̇.

        J J̄ is the identity at rank 6, and otherwise the projection onto the range of J.
        """
        L, _, inverse, W = self._decomposition
        left = np.linalg.solve(np.swapaxes(L, -1, -2), W * inverse[..., None, :])
        return np.asarray(left @ np.swapaxes(self._reduced_U, -1, -2))

    @cached_property
    def gravity_force(self) -> FloatArray:
        """The force of gravity p = J̄ᵀ g (6,) [N], [N·m], that holds the arm in this task."""
        return self._force(self.joint_gravity)

    @cached_property
    def coriolis_force(self) -> FloatArray:
        """The Coriolis and centrifugal force μ = J̄ᵀ C q̇ − Λ J̇ q̇ (6,) [N], [N·m]."""
        return np.asarray(
            self._force(self.joint_coriolis)
            - np.einsum('...ij,...j->...i', self.inertia, self.bias_acceleration))

    @cached_property
    def rank(self) -> IntArray:
        """The rank of J, () or (samples,), with `RANK_TOLERANCE`."""
        s = np.linalg.svd(self.jacobian, compute_uv=False)
        return np.asarray((s > RANK_TOLERANCE * s[..., :1]).sum(axis=-1))

    @property
    def directions(self) -> FloatArray:
        """
        Orthonormal directions (6, 6), one per row, from the lightest to the heaviest.

        They are the eigenvectors of Λ⁻¹. Rows from `rank` on are the lost directions: no joint
        acceleration moves the point along them, and a force along them needs no joint effort.
        """
        return np.swapaxes(self._decomposition.U, -1, -2)

    @property
    def lost_directions(self) -> FloatArray:
        """The lost directions (6 − rank, 6) of one state, one per row."""
        if self.jacobian.ndim > 2:
            raise InvalidInputError(
                'lost_directions needs one state, expected rows of directions from rank on')
        return np.asarray(self.directions[int(self.rank):])

    @cached_property
    def translation_singular_values(self) -> FloatArray:
        """Singular values (3,) of the upper half of J [m/rad] or [m/m], descending."""
        return _three_singular_values(self.jacobian[..., :3, :])

    @cached_property
    def rotation_singular_values(self) -> FloatArray:
        """Singular values (3,) of the lower half of J [rad/rad] or [rad/m], descending."""
        return _three_singular_values(self.jacobian[..., 3:, :])

    @property
    def translation_manipulability(self) -> FloatArray:
        """√det(J_v J_vᵀ), () (Yoshikawa 1985): the product of the three singular values."""
        return np.asarray(self.translation_singular_values.prod(axis=-1))

    @property
    def rotation_manipulability(self) -> FloatArray:
        """√det(J_ω J_ωᵀ), (): the product of the three singular values."""
        return np.asarray(self.rotation_singular_values.prod(axis=-1))

    @property
    def position_margin(self) -> FloatArray:
        """Distance (n,) [rad] or [m] to the nearest position limit, negative beyond it."""
        return np.minimum(self.joint_position - self.lower, self.upper - self.joint_position)

    def _force(self, effort: FloatArray) -> FloatArray:
        """Return J̄ᵀ τ (6,)."""
        return np.asarray(np.einsum('...ji,...j->...i', self.dynamic_inverse, effort))

    @cached_property
    def _whitened(self) -> tuple[FloatArray, FloatArray]:
        """L with M = L Lᵀ, and L⁻¹ Jᵀ (n, 6)."""
        try:
            L = np.linalg.cholesky(self.mass_matrix)
        except np.linalg.LinAlgError:
            n = self.joint_position.shape[-1]
            q = self.joint_position.reshape(-1, n)
            smallest = np.linalg.eigvalsh(self.mass_matrix.reshape(-1, n, n))[:, 0]
            raise InvalidInputError(
                f'the mass matrix at position {q[int(np.argmin(smallest))].tolist()} is not '
                'positive definite, expected every joint to move some mass or inertia') from None
        return np.asarray(L), np.asarray(np.linalg.solve(L, np.swapaxes(self.jacobian, -1, -2)))

    @cached_property
    def _decomposition(self) -> _Decomposition:
        L, A = self._whitened
        U, s, Wt = np.linalg.svd(np.swapaxes(A, -1, -2))
        inverse = np.divide(
            1.0, s, out=np.zeros_like(s), where=np.arange(s.shape[-1]) < self.rank[..., None])
        return _Decomposition(L, U, inverse, np.swapaxes(Wt, -1, -2)[..., :s.shape[-1]])

    @property
    def _reduced_U(self) -> FloatArray:
        U, inverse = self._decomposition.U, self._decomposition.inverse
        return U[..., :inverse.shape[-1]]


def _three_singular_values(half: FloatArray) -> FloatArray:
    """Return three singular values of (..., 3, n), 0 for those that n < 3 joints lack."""
    s = np.linalg.svd(half, compute_uv=False)
    missing = [(0, 0)] * (s.ndim - 1) + [(0, 3 - s.shape[-1])]
    return np.pad(s, missing)
