# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Weighted least squares in information form, with variances that are estimated from the residuals.

The unknowns are π (10,) of the load, and for each joint an error of the viscous and of the dry
friction of the model. The rows of a joint form up to three groups with a variance each: blocks of
motion, paired rests, and single rests. Λ = Σ_g Λ_g / σ_g², with σ_g² from the residuals of the
group and its degrees of freedom. Few residuals determine a variance poorly. It is therefore
combined with a prior: that of dry friction within the known band ± F, or the variance of the other
joints relative to their effort limits. Blocks whose residuals are correlated with the next block
count less, by (1 − ρ) / (1 + ρ).
"""

from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.pseudo_inertia import COUNT
from robot_dynamics.payload_estimation.pairing import RestRows
from robot_dynamics.payload_estimation.rows import EFFORT, RESIDUAL, Rows, SIGN, VELOCITY

PRIOR_DEVIATION = 100.0
"""Deviation [kg, kg·m, kg·m²] of the parameters without data: no restriction."""
FRICTION_ERROR = 0.5
"""Deviation of the friction of the model, relative to the effort limit, without data."""
LEAST_NOISE = 1e-5
"""Smallest deviation of an observation, relative to the effort limit: resolution of efforts."""
ASSUMED_NOISE = 0.01
"""Deviation of an observation relative to the effort limit, if no residual determines it."""
POOLED_PAIRS = 30.0
"""Number of pairs of consecutive rows that the correlation of all joints counts as."""
EXPECTED_NOISE = 0.003
"""Deviation of an expected observation without friction, relative to the effort limit."""
BAND_VARIANCE = 1.0 / 3.0
"""Variance of dry friction with a uniform distribution within ± F, relative to F²."""
PAIRED_FRACTION = 0.1
"""Part of the friction band that remains in a pair, if no residual determines it."""
BAND_WEIGHT, POOLED_WEIGHT = 12.0, 2.0
"""Number of residuals that the friction band, and the variance of the other joints, count as."""
_ASSUMED_WEIGHT = 0.01
_ITERATIONS = 12
_ROUNDING = 1e-15
_NORMAL = 1.959964


@dataclass(frozen=True, eq=False)
class _Group:
    """Rows of one joint: `gram` is Σ w z zᵀ; `prior` and `prior_weight` are of the variance."""

    joint: int
    kind: str
    gram: FloatArray
    count: float
    prior: float
    prior_weight: float
    least: float
    lagged: FloatArray | None = None
    pairs: float = 0.0


@dataclass(frozen=True, eq=False)
class Solution:
    """
    The estimate π (10,), its covariance (10, 10), and deviations (10,).

    π ± 1.96 deviations covers the true value in 95 % of the cases: deviations are larger than
    those of the covariance if few residuals determine the variances. `per_percent` (10,) is the
    error of π if all measured efforts are 1 % too large. `expected` are the variances (n,) of
    further rows, by their kind: 'motion', 'single' or 'paired'.
    """

    values: FloatArray
    covariance: FloatArray
    deviations: FloatArray
    per_percent: FloatArray
    expected: dict[str, FloatArray]


def solve(rows: Rows, rests: RestRows, band: FloatArray, scale: FloatArray) -> Solution:
    """
    Return the estimate.

    `band` (n,) is the known dry friction at rest, `scale` (n,) the effort limits, all > 0.
    """
    n = len(scale)
    groups = _groups(rows, rests, band, scale)
    size = COUNT + 2 * n
    prior = np.zeros(size)
    prior[:COUNT] = PRIOR_DEVIATION**-2
    prior[COUNT:] = np.tile((FRICTION_ERROR * scale)**-2, 2)
    information = [_embedded(group, n) for group in groups]
    right = [_right_side(group, n, RESIDUAL) for group in groups]
    variances = np.array([max(group.prior, (ASSUMED_NOISE * scale[group.joint])**2)
                          for group in groups])
    freedom = np.ones(len(groups))
    inverse, theta = np.diag(1.0 / prior), np.zeros(size)
    for _ in range(_ITERATIONS if groups else 0):
        whole = np.diag(prior) + sum(A / s for A, s in zip(information, variances))
        inverse = inverse_of(whole)
        theta = inverse @ sum(b / s for b, s in zip(right, variances))
        squares = np.array([_squares(group, theta, n) for group in groups])
        free = np.array([
            max(group.count - float(np.sum(inverse * A)) / s, 0.0)
            for group, A, s in zip(groups, information, variances)])
        variances, freedom = _variances(groups, squares, free, scale)
        variances = variances * _rows_per_independent_row(groups, theta, n)
    covariance = inverse[:COUNT, :COUNT]
    effort = sum((_right_side(group, n, EFFORT) / s for group, s in zip(groups, variances)),
                 np.zeros(size))
    factor = _widening(inverse, information, variances, freedom)
    deviations = np.sqrt(np.diag(covariance)) * factor
    return Solution(theta[:COUNT], covariance, deviations, 0.01 * (inverse @ effort)[:COUNT],
                    _expected(groups, variances, scale, band))


def inverse_of(A: FloatArray) -> FloatArray:
    """
    Return the inverse (..., k, k) of symmetric positive definite matrices.

    The inverse is positive definite also if rounding errors exceed the smallest eigenvalue.
    """
    scale = 1.0 / np.sqrt(np.diagonal(A, axis1=-2, axis2=-1))
    values, vectors = np.linalg.eigh(A * scale[..., :, None] * scale[..., None, :])
    roots = scale[..., :, None] * vectors / np.sqrt(np.maximum(values, _ROUNDING))[..., None, :]
    return np.asarray(roots @ np.swapaxes(roots, -1, -2))


def _groups(
    rows: Rows, rests: RestRows, band: FloatArray, scale: FloatArray,
) -> list[_Group]:
    groups = []
    for j in range(len(scale)):
        least = (LEAST_NOISE * scale[j])**2
        if rows.count[j]:
            groups.append(_Group(
                j, 'motion', rows.gram[j], rows.count[j], 0.0, POOLED_WEIGHT, least,
                rows.lagged[j], rows.pairs[j]))
        for kind, fraction in (('single', 1.0), ('paired', PAIRED_FRACTION)):
            own = (rests.joint == j) & (rests.paired == (kind == 'paired'))
            if own.any():
                z, w = rests.row[own], rests.weight[own]
                noise = float(np.sum(w * rests.noise[own]) / w.sum())
                prior = BAND_VARIANCE * (fraction * band[j])**2 + noise if band[j] > 0.0 else 0.0
                groups.append(_Group(
                    j, kind, (z * w[:, None]).T @ z, float(w.sum()), prior,
                    BAND_WEIGHT if band[j] > 0.0 and kind == 'single' else POOLED_WEIGHT,
                    max(least, 0.25 * noise)))
    return groups


def _columns(group: _Group, n: int) -> tuple[list[int], list[int]]:
    """Return the unknowns of a group, and their columns in its rows."""
    unknowns, columns = list(range(COUNT)), list(range(COUNT))
    if group.kind == 'motion':
        unknowns += [COUNT + group.joint, COUNT + n + group.joint]
        columns += [VELOCITY, SIGN]
    return unknowns, columns


def _embedded(group: _Group, n: int) -> FloatArray:
    unknowns, columns = _columns(group, n)
    A = np.zeros((COUNT + 2 * n, COUNT + 2 * n))
    A[np.ix_(unknowns, unknowns)] = group.gram[np.ix_(columns, columns)]
    return A


def _right_side(group: _Group, n: int, column: int) -> FloatArray:
    unknowns, columns = _columns(group, n)
    b = np.zeros(COUNT + 2 * n)
    b[unknowns] = group.gram[columns, column]
    return b


def _residual_form(group: _Group, theta: FloatArray, n: int) -> FloatArray:
    """Return u (COLUMNS,) with u·z the residual of a row z."""
    unknowns, columns = _columns(group, n)
    u = np.zeros(len(group.gram))
    u[columns], u[RESIDUAL] = -theta[unknowns], 1.0
    return u


def _squares(group: _Group, theta: FloatArray, n: int) -> float:
    u = _residual_form(group, theta, n)
    return max(float(u @ group.gram @ u), 0.0)


def _rows_per_independent_row(
    groups: list[_Group], theta: FloatArray, n: int,
) -> FloatArray:
    """
    Return the number of rows (groups,) that count as one, from consecutive residuals.

    The filter causes most of the correlation, and is the same for all joints. The correlation of
    one joint is therefore combined with that of all joints.
    """
    sums, pairs = np.zeros(len(groups)), np.zeros(len(groups))
    for i, group in enumerate(groups):
        if group.lagged is not None:
            u = _residual_form(group, theta, n)
            power = max(float(u @ group.gram @ u), 1e-300) / group.count
            sums[i], pairs[i] = float(u @ group.lagged @ u) / power, group.pairs
    pooled = sums.sum() / max(pairs.sum(), 1.0)
    rho = np.clip((sums + POOLED_PAIRS * pooled) / (pairs + POOLED_PAIRS), 0.0, 0.95)
    is_motion = np.array([group.lagged is not None for group in groups])
    return np.where(is_motion, (1.0 + rho) / (1.0 - rho), 1.0)


def _variances(
    groups: list[_Group], squares: FloatArray, free: FloatArray, scale: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the variances of the groups and their degrees of freedom."""
    relative = np.array([scale[group.joint]**2 for group in groups])
    variances, freedom = np.zeros(len(groups)), np.zeros(len(groups))
    for kinds in (('motion',), ('single', 'paired')):
        own = np.array([group.kind in kinds for group in groups])
        pooled = (float(np.sum(squares[own] / relative[own]))
                  + _ASSUMED_WEIGHT * ASSUMED_NOISE**2) / (
                      float(free[own].sum()) + _ASSUMED_WEIGHT)
        for i in np.flatnonzero(own).tolist():
            group = groups[i]
            prior = group.prior if group.prior > 0.0 else pooled * relative[i]
            freedom[i] = free[i] + group.prior_weight
            variances[i] = max(
                (squares[i] + group.prior_weight * prior) / freedom[i], group.least)
    return variances, freedom


def _widening(
    inverse: FloatArray, information: list[FloatArray], variances: FloatArray,
    freedom: FloatArray,
) -> FloatArray:
    """
    Return the factors (10,) by which few residuals enlarge the deviations.

    Weights from estimated variances make the result appear too precise: P. Meier, "Variance of a
    weighted mean", Biometrics 9(1), 1953. The rest is t / 1.96, t of Student's distribution with
    the degrees of freedom of Welch and Satterthwaite.
    """
    if not information:
        return np.ones(COUNT)
    total = np.diag(inverse)[:COUNT]
    parts = np.clip([
        np.diag(inverse @ (A / s) @ inverse)[:COUNT] for A, s in zip(information, variances)],
        0.0, total)  # the rest is that of the prior
    effective = total**2 / np.maximum((parts**2 / freedom[:, None]).sum(axis=0), 1e-300)
    share = parts / total
    weighting = 1.0 + 4.0 * np.sum(share * (1.0 - share) / freedom[:, None], axis=0)
    return np.asarray(np.sqrt(weighting) * student_factor(effective))


def student_factor(freedom: FloatArray) -> FloatArray:
    """Return t / 1.96, t the 97.5 % quantile of Student's distribution, for freedom >= 2."""
    f, z = np.clip(freedom, 2.0, 1e6), _NORMAL
    t = (z + (z**3 + z) / (4 * f) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * f**2)
         + (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / (384 * f**3))
    return np.asarray(t / z)


def _expected(
    groups: list[_Group], variances: FloatArray, scale: FloatArray, band: FloatArray,
) -> dict[str, FloatArray]:
    """Return the variances (n,) of further rows by kind, at joints without any from friction."""
    noise, friction = (EXPECTED_NOISE * scale)**2, BAND_VARIANCE * band**2
    expected = {
        'motion': noise + PAIRED_FRACTION**2 * friction, 'single': noise + friction,
        'paired': noise + PAIRED_FRACTION**2 * friction}
    for group, variance in zip(groups, variances):
        expected[group.kind][group.joint] = variance
    return expected
