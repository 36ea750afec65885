# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The model that all estimators fit: effort = scale · (known + X θ) + Y θ + noise.

θ are all unknowns: parameters of bodies, friction, offsets, and the scales. A row z of a
regression has the effort and everything that multiplies unknowns. Rows with a common variance,
such as those of one joint, form a group. The variances are estimated with θ, from the residuals
(iteratively estimated weights: G. A. F. Seber, C. J. Wild, *Nonlinear Regression*, Wiley 1989,
sections 2.1 and 2.8.8), by Gauss–Newton steps. A prior is further rows W (θ − m).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, column_scale, FloatArray, IntArray
from robot_dynamics.dependencies import optional

LOST = 1e-5
"""Smallest part of a parameter in an undetermined combination that makes it undetermined."""
CONFIDENCE = 0.95
NORMAL = 1.959964
"""Half width of the 95 % interval of a normal distribution, in standard deviations."""
_MOST_ROUNDS = 30
_CONVERGED = 1e-3
"""Step relative to the deviation, and relative change of a variance, that end the rounds."""
_ROUNDING = 1e-12
"""Size of a column, relative to the largest one, below which it consists of rounding errors."""
_UNLIMITED = 1e9
"""Degrees of freedom of what is not estimated from residuals."""


class Decomposition(NamedTuple):
    """
    The determined part of A (m, p), of rank r, with columns scaled to the same size.

    x = `back` @ `basis`.T @ b is the smallest least-squares solution; `basis` is (m, r), `back` is
    (p, r). `is_lost` (p,) marks the parameters that A does not determine. `condition` is the
    condition number of the determined part, infinite without one.
    """

    basis: FloatArray
    back: FloatArray
    is_lost: BoolArray
    condition: float

    @property
    def inverse(self) -> FloatArray:
        """The matrix (p, m) from b to x."""
        return np.asarray(self.back @ self.basis.T)


def decomposed(A: FloatArray, rcond: float = 1e-9) -> Decomposition:
    """Return the decomposition; a relative singular value below `rcond` counts as 0."""
    scale = column_scale(A)
    scale[scale * _ROUNDING > scale[scale > 0.0].min(initial=np.inf)] = 0.0
    U, singular, Vt = np.linalg.svd(A * scale, full_matrices=False)
    kept = singular > rcond * singular.max(initial=0.0)
    V, s = Vt[kept].T, singular[kept]
    return Decomposition(
        U[:, kept], scale[:, np.newaxis] * V / s,
        np.asarray((scale == 0.0) | (1.0 - (V**2).sum(axis=1) > LOST**2)),
        float(s[0] / s[-1]) if len(s) else np.inf)


def inverse_root(A: FloatArray, rounding: float = 1e-15) -> FloatArray:
    """
    Return W (..., k, k) with WᵀW = A⁻¹ of symmetric positive definite matrices A.

    Eigenvalues below `rounding`, relative to a unit diagonal, count as this: WᵀW is positive
    definite also if rounding errors exceed the smallest eigenvalue.
    """
    scale = 1.0 / np.sqrt(np.diagonal(A, axis1=-2, axis2=-1))
    values, vectors = np.linalg.eigh(A * scale[..., :, None] * scale[..., None, :])
    return np.asarray(np.swapaxes(vectors, -1, -2) * scale[..., None, :] / np.sqrt(
        np.maximum(values, rounding))[..., :, None])


def inverse_of(A: FloatArray) -> FloatArray:
    """Return the inverse (..., k, k) of symmetric positive definite matrices, which is such."""
    W = inverse_root(A)
    return np.asarray(np.swapaxes(W, -1, -2) @ W)


class Rows(NamedTuple):
    """
    A group of rows z (c,), reduced to R (k, c) with RᵀR = Σ w z zᵀ, and their model.

    `size` is the number of independent rows. The effort is z·`effort`, its model is
    z·(`linear` @ θ), with `linear` (c, u). With a `scale`, the number of an unknown, the model has
    θ_scale z·(`known` + `scaled` @ θ) in addition.
    """

    factor: FloatArray
    size: float
    effort: FloatArray
    linear: FloatArray
    scale: int | None = None
    known: FloatArray = np.zeros(0)
    scaled: FloatArray = np.zeros(0)

    def residual(self, theta: FloatArray) -> FloatArray:
        """Return u (c,), with which z·u is the residual of a row."""
        model = self.linear @ theta
        if self.scale is not None:
            model = model + theta[self.scale] * (self.known + self.scaled @ theta)
        return np.asarray(self.effort - model)

    def jacobian(self, theta: FloatArray) -> FloatArray:
        """Return the derivative (k, u) of the model of the reduced rows."""
        slope = self.linear
        if self.scale is not None:
            slope = slope + theta[self.scale] * self.scaled
            slope[:, self.scale] += self.known + self.scaled @ theta
        return np.asarray(self.factor @ slope)

    def squares(self, theta: FloatArray) -> float:
        """Return the sum of the squared residuals."""
        return float(np.sum((self.factor @ self.residual(theta))**2))


class Spread(NamedTuple):
    """Standard deviations and half widths of the 95 % intervals; infinite if not determined."""

    deviation: FloatArray
    interval: FloatArray


@dataclass(frozen=True, eq=False)
class EffortFit:
    """
    The unknowns θ (u,), and the variances (g,) of the groups with their degrees of `freedom`.

    `solution` is the decomposition of the weighted rows of all groups (`group` numbers them), and
    of the prior, whose number is g.
    """

    values: FloatArray
    variances: FloatArray
    freedom: FloatArray
    solution: Decomposition
    group: IntArray

    @property
    def covariance(self) -> FloatArray:
        """The covariance (u, u), without what is not determined."""
        return np.asarray(self.solution.back @ self.solution.back.T)

    def spread(self, combinations: FloatArray) -> Spread:
        """Return the spread of combinations (c, u) of θ."""
        own = (combinations @ self.solution.back).T
        parts = np.array([((self.solution.basis[self.group == g] @ own)**2).sum(axis=0)
                          for g in range(len(self.variances) + 1)])
        total = parts.sum(axis=0)
        share = np.divide(parts, total, out=np.zeros_like(parts), where=total > 0.0)
        factor, quantile = estimated_weights(share, np.append(self.freedom, _UNLIMITED))
        lost = (np.abs(combinations[:, self.solution.is_lost]) > LOST).any(axis=1)
        deviation = np.where(lost, np.inf, np.sqrt(total) * factor)
        return Spread(deviation, deviation * quantile)


Variances = Callable[[FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""From θ, the squares (g,) and the free rows (g,) of groups to `variances` and `freedom`."""


def residual_variances(
    _: FloatArray, squares: FloatArray, free: FloatArray, least: float = 1e-30,
) -> tuple[FloatArray, FloatArray]:
    """Return the mean squares of residuals, relative to the free rows, at least 1."""
    freedom = np.maximum(free, 1.0)
    return np.maximum(squares / freedom, least), freedom


def fit_effort(
    groups: Sequence[Rows], start: FloatArray, variances: FloatArray | None = None,
    prior: Callable[[FloatArray], FloatArray] | None = None,
    rule: Variances = residual_variances,
) -> EffortFit:
    """
    Return the fit of the unknowns, from θ = `start` (u,), which is also the mean of the prior.

    `prior` returns W (r, u) at the variances (g,) of the groups, which begin with `variances`, by
    default 1, and are those of the `rule` then.
    """
    theta, freedom = start.copy(), np.ones(len(groups))
    variances = freedom if variances is None else variances
    prior = prior or (lambda _: np.zeros((0, len(start))))
    counts = np.array([rows.size for rows in groups])
    for _ in range(_MOST_ROUNDS if groups else 0):
        A, b, group = stacked(groups, theta, variances, prior(variances), start)
        found = decomposed(A)
        step = found.inverse @ b
        theta = theta + step
        squares = np.array([rows.squares(theta) for rows in groups])
        leverage = np.bincount(group, (found.basis**2).sum(axis=1), len(groups) + 1)[:-1]
        before = variances
        variances, freedom = rule(theta, squares, np.maximum(counts - leverage, 0.0))
        deviation = np.linalg.norm(found.back, axis=1)
        if (np.abs(step) <= _CONVERGED * deviation).all() and (
                np.abs(variances / before - 1.0) <= _CONVERGED).all():
            break
    A, b, group = stacked(groups, theta, variances, prior(variances), start)
    return EffortFit(theta, variances, freedom, decomposed(A), group)


def stacked(
    groups: Sequence[Rows], theta: FloatArray, variances: FloatArray,
    W: FloatArray | None = None, mean: FloatArray | float = 0.0,
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return A (m, u) and b (m,) of a step from θ, weighted, and the group of each row (m,)."""
    sizes, W = np.sqrt(variances), np.zeros((0, len(theta))) if W is None else W
    A = [*(rows.jacobian(theta) / size for rows, size in zip(groups, sizes)), W]
    b = [*(rows.factor @ rows.residual(theta) / size for rows, size in zip(groups, sizes)),
         W @ (mean - theta)]
    return np.concatenate(A), np.concatenate(b), np.repeat(
        np.arange(len(A)), [len(part) for part in A])


def estimated_weights(share: FloatArray, freedom: FloatArray) -> tuple[FloatArray, FloatArray]:
    """
    Return by which factor estimated weights increase deviations, and the factor of intervals.

    `share` (g, c) are the fractions f of c variances due to g groups, whose variances were
    estimated with ν degrees of `freedom` (g,). The weights increase a variance by
    1 + 4 Σ f (1 − f) / ν, and the half width of a 95 % interval is the quantile of Student's t
    with 1 / Σ (f² / ν) degrees of freedom: P. Meier, *Variance of a weighted mean*,
    Biometrics 9(1), 1953. Needs scipy.
    """
    of_group = freedom[:, None]
    factor = np.sqrt(1.0 + 4.0 * (share * (1.0 - share) / of_group).sum(axis=0))
    effective = 1.0 / np.maximum((share**2 / of_group).sum(axis=0), 1e-9)
    quantile = optional('scipy.special', 'an interval of confidence').stdtrit
    return factor, np.asarray(quantile(effective, 0.5 + 0.5 * CONFIDENCE))
