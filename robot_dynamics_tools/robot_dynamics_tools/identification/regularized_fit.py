# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Least squares with regularization towards the prior model, which is the URDF.

The cost function is
½ Σ_j w_j |X_j θ_j − y_j|² + ½ κ Σ_b |W_b (φ_b − φ⁰_b)|² + ½ κ Σ_j (I_j / s_j)²
+ ½ Σ_j |F_j / f_j|². Its terms are the residuals of all joints, each with the weight
w_j = 1 / (σ_j² × samples per independent sample); the entropic divergence of the bodies from the
URDF, to second order (`pseudo_inertia`); the reflected inertia I_j relative to the inertia s_j at
the joint; and the friction parameters F_j relative to f_j, the value with which each of them alone
explains the largest measured effort of the joint. The last term does not depend on κ: it matters
only if the data do not determine a parameter. Dry friction and the offset F_b are at most the
largest measured effort. κ = 1 corresponds to a URDF that is wrong by about 100 %, κ = 10⁴ to one
that is wrong by 1 %. Source of the regularization: T. Lee, F. C. Park, "A geometric algorithm for
robust multibody inertial parameter identification", IEEE Robotics and Automation Letters 3(3),
2018.

`consistent_fit` has the same cost, but with the entropic divergence itself. Its variables are the
relative log-Cholesky coordinates of each body (`pseudo_inertia`), which represent only physically
consistent bodies: every body is a mass distribution. Friction and rotors are non-negative. The
problem is solved by Gauss–Newton steps within a trust region, starting from the URDF.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.dependencies import optional
from robot_dynamics.joints.friction_terms import LARGEST_LOAD_FRACTION
from robot_dynamics.model.regressor import COUNT
from robot_dynamics_tools import pseudo_inertia
from robot_dynamics_tools.estimation.effort_fit import Rows, stacked
from robot_dynamics_tools.estimation.priors import body_prior
from robot_dynamics_tools.identification import friction_regressor
from robot_dynamics_tools.identification.qr_information import QrInformation

URDF_REGULARIZATION = 1e12
"""κ that leaves the bodies of the URDF unchanged."""
MOST_EVALUATIONS = 100
LEAST_REGULARIZATION = 1.0
"""Smallest κ, which keeps the bodies away from the boundary of physical consistency."""
_LEAST_ROTOR = 0.1
"""
Reflected inertia that is expected at every joint, as a fraction of the largest inertia at a joint:
the rotor of a large reduction may have a larger reflected inertia than a wrist.
"""
_RIDGE = 1e-9


@dataclass(frozen=True, eq=False)
class Prior:
    """
    The prior: φ⁰ (p,), one Cholesky factor of P₀ per body (b, 4, 4), and s (n,).

    `rows` (p, p) is W of all bodies; `inertia` s_j [kg·m²] or [kg]; `velocity` (n,) are the limits
    of the velocity [rad/s] or [m/s]. `friction` (n, COLUMN_COUNT)
    is 1 / f_j of each column, 0 without regularization, and `largest` (n, COLUMN_COUNT) its
    upper bound.
    """

    parameters: FloatArray
    roots: FloatArray
    rows: FloatArray
    inertia: FloatArray
    velocity: FloatArray
    friction: FloatArray
    largest: FloatArray

    @property
    def count(self) -> int:
        return len(self.parameters)

    def for_effort(self, information: QrInformation) -> 'Prior':
        """Return the prior with the scale and the bounds of friction from the measured effort."""
        excitation, is_measured = information.excitation, information.is_measured
        largest_effort = np.where(is_measured, excitation.largest_effort, np.inf)
        rms_effort = np.where(is_measured, information.rms_effort, np.inf)
        friction, largest = np.zeros_like(self.friction), np.full_like(self.largest, np.inf)
        efforts = np.concatenate([friction_regressor.OFFSET, friction_regressor.DRY])
        friction[:, efforts] = 1.0 / largest_effort[:, np.newaxis]
        friction[:, friction_regressor.LOAD] = is_measured[:, np.newaxis]
        # if viscous friction is hardly separable, it must stay moderate at other velocities
        is_vague = np.isfinite(self.velocity) & [
            bool(excitation.left_out(joint)) for joint in range(len(self.velocity))]
        friction[:, friction_regressor.VISCOUS] = np.where(
            is_vague, self.velocity / rms_effort, excitation.rms_velocity / largest_effort,
        )[:, np.newaxis]
        largest[:, efforts] = largest_effort[:, np.newaxis]
        largest[:, friction_regressor.LOAD] = LARGEST_LOAD_FRACTION
        return replace(self, friction=friction, largest=largest)


def make_prior(
    parameters: FloatArray, joint_inertia: FloatArray, velocity_limit: FloatArray,
) -> Prior:
    """Return the prior of a URDF's φ⁰ (p,), inertia s and velocity limit (n,) of each joint."""
    shape = len(joint_inertia), friction_regressor.COLUMN_COUNT
    return Prior(
        *body_prior(parameters),
        np.maximum(joint_inertia, max(_LEAST_ROTOR * float(joint_inertia.max()), 1e-6)),
        velocity_limit, np.zeros(shape), np.full(shape, np.inf))


@dataclass(frozen=True, eq=False)
class Fit:
    """
    Parameters of a model: φ (p,) of the bodies, and (n, COLUMN_COUNT) of the joints' own columns.

    Columns that the structure of a joint does not use are 0.
    """

    parameters: FloatArray
    joint_values: FloatArray
    structures: tuple[friction_regressor.FrictionStructure, ...]

    @property
    def theta(self) -> FloatArray:
        """The values of all columns of a regression, bodies first, for each joint, (n, k − 1)."""
        shape = len(self.joint_values), len(self.parameters)
        return np.hstack([np.broadcast_to(self.parameters, shape), self.joint_values])

    def squares(self, grams: FloatArray) -> FloatArray:
        """Return the sum of squared residuals of each joint, (n,); `grams` (n, k, k) is RᵀR."""
        x = np.insert(self.theta, grams.shape[-1] - 1, -1.0, axis=1)
        return np.asarray(np.maximum(np.einsum('ja,jab,jb->j', x, grams, x), 0.0))


def without_memory(fit: Fit) -> Fit:
    """Return the fit with the sign of velocity instead of the state of presliding."""
    values, coulomb = fit.joint_values.copy(), friction_regressor.COULOMB
    values[:, coulomb] = 0.0
    values[:, coulomb[0]] = fit.joint_values[:, coulomb].sum(axis=1)
    return Fit(fit.parameters, values, fit.structures)


class Problem(NamedTuple):
    """The cost function of a fit: structures of n joints, weights w (n,), the prior, and κ."""

    structures: tuple[friction_regressor.FrictionStructure, ...]
    weights: FloatArray
    prior: Prior
    regularization: float

    @property
    def own(self) -> list[tuple[IntArray, slice]]:
        """
        The columns of a factor that belong to each joint, and the place of their variables.

        The variables of the joints follow the p variables of the bodies; the reflected inertia is
        the first one of its joint.
        """
        p = self.prior.count
        ends = p + np.cumsum([0, *(len(structure.columns) for structure in self.structures)])
        return [(np.array(structure.columns) + p, slice(first, last))
                for structure, first, last in zip(self.structures, ends, ends[1:])]

    @property
    def size(self) -> int:
        """The number u of variables."""
        return int(self.own[-1][1].stop)

    def linear(self, joint: int, width: int) -> FloatArray:
        """Return the matrix (width, u) from x to the columns of the factor of a joint."""
        columns, part = self.own[joint]
        linear = np.zeros((width, self.size))
        np.fill_diagonal(linear[:self.prior.count], 1.0)
        linear[columns, part] = np.eye(len(columns))
        return linear

    def prior_rows(self) -> tuple[FloatArray, FloatArray]:
        """Return W (u, u) and m (u,) of the prior, whose cost is ½ |W (x − m)|²."""
        prior, p = self.prior, self.prior.count
        W, mean = np.zeros((self.size, self.size)), np.zeros(self.size)
        W[:p, :p], mean[:p] = np.sqrt(self.regularization) * prior.rows, prior.parameters
        for j, (columns, part) in enumerate(self.own):
            W[part, part] = np.diag(prior.friction[j, columns - p])
            W[part.start, part.start] = np.sqrt(self.regularization) / prior.inertia[j]
        return W, mean

    def fit_of(self, x: FloatArray) -> Fit:
        """Return the fit of the variables x: p of the bodies, then those of `own`."""
        p = self.prior.count
        values = np.zeros((len(self.structures), friction_regressor.COLUMN_COUNT))
        for j, (columns, part) in enumerate(self.own):
            values[j, columns - p] = x[part]
        return Fit(x[:p], values, self.structures)


def grams_of(factors: FloatArray) -> FloatArray:
    """Return RᵀR of factors R (..., k, k)."""
    return np.asarray(np.swapaxes(factors, -1, -2) @ factors)


def solve(grams: FloatArray, problem: Problem) -> Fit:
    """
    Return the fit to RᵀR (n, k, k) of each joint, by the normal equations, without bounds.

    The solution is fast, for selecting models.
    """
    p, (W, mean) = problem.prior.count, problem.prior_rows()
    H = np.diag(np.diag(W)**2)
    H[:p, :p] = W[:p, :p].T @ W[:p, :p]
    g = H @ mean
    for (columns, part), weight, gram in zip(problem.own, problem.weights, grams):
        G = weight * gram
        H[:p, :p] += G[:p, :p]
        H[:p, part] = G[:p, columns]
        H[part, :p] = H[:p, part].T
        H[part, part] += G[np.ix_(columns, columns)]
        g[:p] += G[:p, -1]
        g[part] += G[columns, -1]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(H), 1e-300))
    x = scale * np.linalg.solve(
        scale[:, np.newaxis] * H * scale + _RIDGE * np.eye(len(g)), scale * g)
    return problem.fit_of(x)


def solve_bounded(factors: FloatArray, problem: Problem) -> Fit:
    """
    Return the same fit to factors R (n, k, k), with non-negative friction and rotors.

    The method is least squares with bounds, which does not square the condition number.
    """
    lsq_linear = optional('scipy.optimize', 'identification').lsq_linear
    A, b, low, high = bounded_problem(factors, problem)
    scale = 1.0 / np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    found = lsq_linear(
        A * scale, b, (low / scale, high / scale), method='bvls', tol=1e-12, max_iter=1000)
    return problem.fit_of(scale * found.x)


def bounded_problem(
    factors: FloatArray, problem: Problem,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return A, b of |A x − b|², and the bounds of x (`Problem.own`)."""
    prior, weights, p = problem.prior, problem.weights, problem.prior.count
    W, mean = problem.prior_rows()
    z = np.eye(factors.shape[-1])
    low, high = np.full_like(mean, -np.inf), np.full_like(mean, np.inf)
    for j, (columns, part) in enumerate(problem.own):
        # a joint may have two columns of dry friction, which together have the bound
        count = max(problem.structures[j].dry_count, 1)
        high[part] = prior.largest[j, columns - p] / np.where(
            np.isin(columns - p, friction_regressor.DRY), count, 1)
        low[part] = np.where(np.isin(columns - p, friction_regressor.OFFSET), -high[part], 0.0)
    variances = np.divide(1.0, weights, out=np.full_like(weights, np.inf), where=weights > 0.0)
    groups = [Rows(R, 1.0, z[-1], problem.linear(j, len(z))) for j, R in enumerate(factors)]
    A, b, _ = stacked(groups, np.zeros(len(mean)), variances, W, mean)
    return A, b, low, high


def is_physical(joint_values: FloatArray, largest: FloatArray) -> bool:
    """
    Return whether friction is not below 0, and dry friction and F_b are within `largest`.

    Both are of one joint, (COLUMN_COUNT,), `largest` as in `Prior`; the rotor is not checked.
    """
    values = joint_values.copy()
    values[friction_regressor.INERTIA] = 0.0
    values[friction_regressor.OFFSET] = np.abs(values[friction_regressor.OFFSET])
    return bool((values >= 0.0).all() and (values <= largest).all()
                and values[friction_regressor.DRY].sum() <= largest[friction_regressor.DRY[0]])


def consistent_fit(factors: FloatArray, problem: Problem, start: Fit) -> Fit:
    """
    Return the physically consistent fit to factors R (n, k, k).

    `start` has the initial friction and rotors. Needs scipy.
    """
    least_squares = optional('scipy.optimize', 'identification').least_squares
    prior, p = problem.prior, problem.prior.count
    parts = [slice(i, i + COUNT) for i in range(0, p, COUNT)]
    regularization = max(problem.regularization, LEAST_REGULARIZATION)
    A, b, low, high = bounded_problem(factors, problem._replace(regularization=regularization))
    n, k, _ = factors.shape
    # the divergence replaces the regularization of φ itself
    A[n * k:n * k + p], b[n * k:n * k + p] = 0.0, 0.0
    R: FloatArray = np.asarray(np.linalg.qr(np.column_stack([A, b]), mode='r'))
    A, b = np.vstack([R[:, :-1], np.zeros((p, len(low)))]), np.append(R[:, -1], np.zeros(p))
    data = len(R)
    root = np.sqrt(2.0 * regularization)

    def bodies_of(x: FloatArray) -> FloatArray:
        return np.concatenate([
            pseudo_inertia.from_coordinates(L0, x[part]) for L0, part in zip(prior.roots, parts)])

    def residuals(x: FloatArray) -> FloatArray:
        r = A @ np.concatenate([bodies_of(x), x[p:]]) - b
        for part in parts:
            r[data:][part] = root * pseudo_inertia.divergence_residuals(x[part])[0]
        return np.asarray(r)

    def derivative(x: FloatArray) -> FloatArray:
        J = A.copy()
        for L0, part in zip(prior.roots, parts):
            J[:, part] = A[:, part] @ pseudo_inertia.jacobian(L0, x[part])
            J[data:][part, part] = root * np.diag(pseudo_inertia.divergence_residuals(x[part])[1])
        return J

    x0 = np.concatenate([np.zeros(p), *(
        values[columns - p] for values, (columns, _) in zip(start.joint_values, problem.own))])
    low[:p], high[:p] = -np.inf, np.inf
    x0 = np.clip(x0, low + 1e-9 * (low == 0.0), high)
    found = least_squares(
        residuals, x0, derivative, bounds=(low, high), x_scale='jac', method='trf',
        max_nfev=MOST_EVALUATIONS, xtol=1e-9, ftol=1e-9, gtol=1e-9)
    x = np.asarray(found.x)
    fit = problem.fit_of(x)
    # the solver stops just inside its bounds; without effort, parameters are undetermined
    is_zero = (np.abs(fit.joint_values) < 1e-8) | (problem.weights <= 0.0)[:, np.newaxis]
    values = np.where(is_zero, 0.0, fit.joint_values)
    return replace(fit, parameters=bodies_of(x), joint_values=values)
