# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The pseudo-inertia of a body, and coordinates of it that are always physically consistent.

A body has the parameters φ = (m, m c, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz), the tensor about the
origin of its frame, as Pinocchio orders them. There is a mass distribution with them if and only
if P = [[Σ, m c], [m cᵀ, m]], Σ = ½ tr(I) 1 − I, is positive definite: P. M. Wensing, S. Kim,
J.-J. E. Slotine, "Linear matrix inequalities for physically consistent inertial parameter
identification", IEEE Robotics and Automation Letters 3(1), 2018.

P = L₀ U Uᵀ L₀ᵀ with P₀ = L₀ L₀ᵀ a prior and U upper triangular with the diagonal exp d reaches all
such P, and no others, from any d and u: the log-Cholesky coordinates of C. Rucker, P. M. Wensing,
"Smooth parameterization of rigid-body inertia", IEEE Robotics and Automation Letters 7(2), 2022,
taken relative to the prior. The entropic divergence of T. Lee, P. M. Wensing, F. C. Park,
"Geometric robot dynamic identification: a convex programming approach", IEEE Trans. Robotics
36(2), 2020, tr(P₀⁻¹ P) − log |P₀⁻¹ P| − 4, then is a sum of squares of functions of one
coordinate each: Σ (exp 2d_i − 2 d_i − 1) + Σ u_ij².
"""

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.regressor import COUNT

_LEAST_MASS = 0.01
"""Fraction of the arm's mass that is the smallest assumed error of the mass of a body."""
_LEAST_RADIUS = 0.03
"""Smallest radius of gyration [m] that the regularization assumes."""
_UPPER = np.triu_indices(4, 1)
_DIAGONAL = np.diag_indices(4)


def pseudo_inertia_matrix(parameters: FloatArray) -> FloatArray:
    """Return P (4, 4) of the parameters φ (10,)."""
    return np.asarray(pin.PseudoInertia.FromDynamicParameters(parameters).toMatrix())


def parameters_of(P: FloatArray) -> FloatArray:
    """Return the parameters φ (10,) of a pseudo-inertia P (4, 4)."""
    return np.asarray(pin.PseudoInertia.FromMatrix(P).toDynamicParameters())


def is_consistent(parameters: FloatArray) -> bool:
    """Return whether there is a mass distribution with the parameters φ (10,)."""
    return bool(np.linalg.eigvalsh(pseudo_inertia_matrix(parameters)).min() > 0.0)


def relative_rows(L0: FloatArray) -> FloatArray:
    """
    Return W (10, 10) with |W δφ|² = tr((P₀⁻¹ δP)²): the entropic divergence near the prior, twice.

    The divergence does not depend on the units and frames of the parameters. `L0` (4, 4) is the
    Cholesky factor of P₀.
    """
    inverse = np.linalg.inv(L0)
    rows = []
    for unit in np.eye(COUNT):
        relative = inverse @ pseudo_inertia_matrix(unit) @ inverse.T
        rows.append(np.concatenate([relative[_DIAGONAL], np.sqrt(2.0) * relative[_UPPER]]))
    return np.asarray(np.array(rows).T)


def regularizing_roots(parameters: FloatArray) -> FloatArray:
    """
    Return the Cholesky factors of P₀ (bodies, 4, 4), for φ⁰ (10 × bodies,) of a URDF.

    If a body of the URDF is very light, flat or physically inconsistent, a small mass around the
    same centre is added, so that data can still change its parameters.
    """
    bodies = parameters.reshape(-1, COUNT)
    total = max(float(np.maximum(bodies[:, 0], 0.0).sum()), 1e-3)
    return np.stack([np.linalg.cholesky(_regularizing_body(phi, total)) for phi in bodies])


def _regularizing_body(phi: FloatArray, total: float) -> FloatArray:
    P = pseudo_inertia_matrix(phi)
    least_mass = _LEAST_MASS * total
    mass = max(float(P[3, 3]), 0.0)
    centre = P[:3, 3] / mass if mass > 0.0 else np.zeros(3)
    about_centre = P[:3, :3] - mass * np.outer(centre, centre)
    values, vectors = np.linalg.eigh(about_centre)
    mass = max(mass, 1e-3 * least_mass)
    least = max(least_mass, mass) * _LEAST_RADIUS**2 * 0.1
    about_centre = (vectors * np.maximum(values, least)) @ vectors.T
    P = np.empty((4, 4))
    P[:3, :3] = about_centre + mass * np.outer(centre, centre)
    P[:3, 3] = P[3, :3] = mass * centre
    P[3, 3] = mass
    return P


def from_coordinates(L0: FloatArray, coordinates: FloatArray) -> FloatArray:
    """Return φ (10,) of the coordinates (d, u): 4 of the diagonal, 6 above it; 0 is the prior."""
    LU = L0 @ _factor(coordinates)
    return parameters_of(LU @ LU.T)


def jacobian(L0: FloatArray, coordinates: FloatArray) -> FloatArray:
    """Return ∂φ / ∂(d, u), (10, 10)."""
    U = _factor(coordinates)
    columns = []
    for i, j in zip(*(np.concatenate(pair) for pair in zip(_DIAGONAL, _UPPER))):
        dU = np.zeros((4, 4))
        dU[i, j] = U[i, i] if i == j else 1.0
        change = L0 @ (dU @ U.T + U @ dU.T) @ L0.T
        columns.append(parameters_of(change))
    return np.asarray(np.array(columns).T)


def divergence_residuals(coordinates: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return r (10,) with r·r the entropic divergence from the prior, and ∂r_i / ∂x_i (10,)."""
    d, u = coordinates[:4], coordinates[4:]
    square = np.maximum(np.expm1(2.0 * d) - 2.0 * d, 0.0)
    root = np.sign(d) * np.sqrt(square)
    near = np.abs(d) < 1e-5
    with np.errstate(divide='ignore', invalid='ignore'):
        slope = np.where(near, np.sqrt(2.0), np.expm1(2.0 * d) / root)
    return (
        np.concatenate([np.where(near, np.sqrt(2.0) * d, root), u]),
        np.concatenate([slope, np.ones_like(u)]))


def _factor(coordinates: FloatArray) -> FloatArray:
    U = np.diag(np.exp(coordinates[:4]))
    U[_UPPER] = coordinates[4:]
    return U
