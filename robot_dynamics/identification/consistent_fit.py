# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A full, physically consistent set of parameters: every body is a mass distribution.

The cost function is that of `regularized_fit`, but with the entropic divergence itself instead of
its second-order approximation. The variables are the relative log-Cholesky coordinates of each
body (`pseudo_inertia`), which represent only physically consistent bodies; friction and rotors are
non-negative. Parameters that the efforts do not excite keep the values of the URDF. The problem is
solved by Gauss–Newton steps within a trust region, starting from the URDF.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.dependencies import optional
from robot_dynamics.identification.friction_regressor import FrictionStructure
from robot_dynamics.identification.regularized_fit import (
    bounded_problem,
    Fit,
    fit_of,
    own_variables,
    Prior,
)
from robot_dynamics.model.pseudo_inertia import (
    COUNT,
    divergence_residuals,
    from_coordinates,
    jacobian,
)

MOST_EVALUATIONS = 100
LEAST_REGULARIZATION = 1.0
"""Smallest κ, which keeps the bodies away from the boundary of physical consistency."""


def consistent_fit(
    factors: FloatArray, structures: Sequence[FrictionStructure], weights: FloatArray,
    prior: Prior, regularization: float, start: Fit,
) -> Fit:
    """
    Return the physically consistent fit to factors R (n, k, k), with weights w (n,).

    `regularization` is κ, `start` has the initial friction and rotors. Needs scipy.
    """
    least_squares = optional('scipy.optimize', 'identification').least_squares
    p = prior.count
    parts = [slice(i, i + COUNT) for i in range(0, p, COUNT)]
    regularization = max(regularization, LEAST_REGULARIZATION)
    A, b, low, high = bounded_problem(factors, structures, weights, prior, regularization)
    n, k, _ = factors.shape
    # the divergence replaces the regularization of φ itself
    A[n * k:n * k + p], b[n * k:n * k + p] = 0.0, 0.0
    R: FloatArray = np.asarray(np.linalg.qr(np.column_stack([A, b]), mode='r'))
    A, b = np.vstack([R[:, :-1], np.zeros((p, len(low)))]), np.append(R[:, -1], np.zeros(p))
    data = len(R)
    root = np.sqrt(2.0 * regularization)

    def bodies_of(x: FloatArray) -> FloatArray:
        return np.concatenate([
            from_coordinates(L0, x[part]) for L0, part in zip(prior.roots, parts)])

    def residuals(x: FloatArray) -> FloatArray:
        r = A @ np.concatenate([bodies_of(x), x[p:]]) - b
        for part in parts:
            r[data:][part] = root * divergence_residuals(x[part])[0]
        return np.asarray(r)

    def derivative(x: FloatArray) -> FloatArray:
        J = A.copy()
        for L0, part in zip(prior.roots, parts):
            J[:, part] = A[:, part] @ jacobian(L0, x[part])
            J[data:][part, part] = root * np.diag(divergence_residuals(x[part])[1])
        return J

    x0 = np.concatenate([np.zeros(p), *(
        start.joint_values[j, columns - p]
        for j, (columns, _) in enumerate(own_variables(structures, p)))])
    low[:p], high[:p] = -np.inf, np.inf
    x0 = np.clip(x0, low + 1e-9 * (low == 0.0), high)
    found = least_squares(
        residuals, x0, derivative, bounds=(low, high), x_scale='jac', method='trf',
        max_nfev=MOST_EVALUATIONS, xtol=1e-9, ftol=1e-9, gtol=1e-9)
    x = np.asarray(found.x)
    fit = fit_of(x, structures, p)
    # the solver stops just inside its bounds; without effort, parameters are undetermined
    is_zero = (np.abs(fit.joint_values) < 1e-8) | (weights <= 0.0)[:, np.newaxis]
    values = np.where(is_zero, 0.0, fit.joint_values)
    return replace(fit, parameters=bodies_of(x), joint_values=values)
