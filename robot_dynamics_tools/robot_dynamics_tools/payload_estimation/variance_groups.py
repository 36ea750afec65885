# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The observations in groups with a common variance, and these variances from the residuals.

A group has the rows of one joint and one kind: blocks of motion, paired rests, or single rests.
Few residuals determine a variance poorly. It is therefore combined with a prior: that of dry
friction within the known band ± F, or the variance of the other joints relative to their effort
limits. Blocks whose residuals are correlated with the next block count less, by
(1 − ρ) / (1 + ρ).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.regressor import COUNT
from robot_dynamics_tools.payload_estimation.pairing import RestRows
from robot_dynamics_tools.payload_estimation.rows import Column, COLUMNS, LoadRows

LEAST_NOISE = 1e-5
"""Smallest deviation of an observation, relative to the effort limit: resolution of efforts."""
ASSUMED_NOISE = 0.01
"""Deviation of an observation relative to the effort limit, if no residual determines it."""
POOLED_PAIRS = 30.0
"""Number of pairs of consecutive rows that the correlation of all joints counts as."""
BAND_VARIANCE = 1.0 / 3.0
"""Variance of dry friction with a uniform distribution within ± F, relative to F²."""
PAIRED_FRACTION = 0.5
"""Part of the friction band that remains in a pair, if no residual determines it."""
BAND_WEIGHT, POOLED_WEIGHT = 12.0, 2.0
"""Number of residuals that the friction band, and the variance of the other joints, count as."""
_ASSUMED_WEIGHT, _PAIRED_WEIGHT = 0.01, 1.0


@dataclass(frozen=True, eq=False)
class Group:
    """Rows of one of n joints: `gram` is Σ w z zᵀ; `prior`, `prior_weight` are of the variance."""

    n: int
    joint: int
    kind: str
    gram: FloatArray
    count: float
    prior: float
    prior_weight: float
    least: float
    band: float = 0.0
    lagged: FloatArray | None = None
    pairs: float = 0.0

    @cached_property
    def _places(self) -> tuple[list[int], list[int]]:
        """The unknowns of the group, and their columns in its rows."""
        n, scale_error = self.n, COUNT + 3 * self.n + 1 + self.joint
        model_errors = range(COLUMNS, len(self.gram))
        unknowns = [*range(COUNT), scale_error, scale_error + n, *(
            unknown_count(n) + i for i in range(len(model_errors)))]
        columns = [*range(COUNT), Column.RIGID, Column.ONE, *model_errors]
        if self.kind == 'motion':
            unknowns += [COUNT + self.joint, COUNT + n + self.joint, COUNT + 3 * n]
            columns += [Column.VELOCITY, Column.SIGN, Column.RATE]
        elif self.kind == 'single':
            unknowns.append(COUNT + 2 * n + self.joint)
            columns.append(Column.SIGN)
        return unknowns, columns

    def _slope(self, theta: FloatArray) -> FloatArray:
        """
        Return M (unknowns, c): M z are the derivatives of the modelled residual of a row z.

        The measured effort is (1 + ε) (τ + Y π) + …, with the effort τ of the URDF.
        """
        unknowns, columns = self._places
        M = np.zeros((unknown_count(self.n, len(self.gram)), len(self.gram)))
        M[unknowns, columns] = 1.0
        error = unknowns[COUNT]
        M[:COUNT] *= 1.0 + theta[error]
        M[error, :COUNT] = theta[:COUNT]
        return M

    def information(self, theta: FloatArray) -> FloatArray:
        """Return the information matrix of all unknowns at `theta`, for a variance of 1."""
        M = self._slope(theta)
        return np.asarray(M @ self.gram @ M.T)

    def right_side(self, theta: FloatArray, column: int | None = None) -> FloatArray:
        """
        Return the right side of the normal equations at `theta`, for a variance of 1.

        They are those of a column, None for the residual of the URDF, for a step of Gauss–Newton.
        """
        target = np.zeros(len(self.gram))
        target[Column.RESIDUAL if column is None else column] = 1.0
        if column is None:
            target[:COUNT] = theta[self._places[0][COUNT]] * theta[:COUNT]
        return np.asarray(self._slope(theta) @ self.gram @ target)

    def residual_form(self, theta: FloatArray) -> FloatArray:
        """Return u (c,) with u·z the residual of a row z."""
        u = -self._slope(theta).T @ theta
        u[:COUNT] += theta[self._places[0][COUNT]] * theta[:COUNT]
        u[Column.RESIDUAL] = 1.0
        return np.asarray(u)

    def squares(self, theta: FloatArray) -> float:
        """Return the sum of the squared residuals."""
        u = self.residual_form(theta)
        return max(float(u @ self.gram @ u), 0.0)


def make_groups(
    rows: LoadRows, rests: RestRows, band: FloatArray, scale: FloatArray,
) -> list[Group]:
    groups, n = [], len(scale)
    for j in range(n):
        least = (LEAST_NOISE * scale[j])**2
        if rows.count[j]:
            groups.append(Group(
                n, j, 'motion', rows.gram[j], rows.count[j], 0.0, POOLED_WEIGHT, least,
                lagged=rows.lagged[j], pairs=rows.pairs[j]))
        for kind, fraction in (('single', 1.0), ('paired', PAIRED_FRACTION)):
            own = (rests.joint == j) & (rests.paired == (kind == 'paired'))
            if own.any():
                z, w = rests.row[own], rests.weight[own]
                noise = float(np.sum(w * rests.noise[own]) / w.sum())
                prior = BAND_VARIANCE * (fraction * band[j])**2 + noise if band[j] > 0.0 else 0.0
                groups.append(Group(
                    n, j, kind, (z * w[:, None]).T @ z, float(w.sum()), prior,
                    BAND_WEIGHT if band[j] > 0.0 and kind == 'single' else POOLED_WEIGHT,
                    max(least, 0.25 * noise), band[j]))
    return groups


def unknown_count(n: int, columns: int = COLUMNS) -> int:
    """Return the number of unknowns for n joints, which `information` lists."""
    return COUNT + 5 * n + 1 + columns - COLUMNS


def rows_per_independent_row(groups: list[Group], theta: FloatArray) -> FloatArray:
    """
    Return the number of rows (groups,) that count as one, from consecutive residuals.

    The filter causes most of the correlation, and is the same for all joints. The correlation of
    one joint is therefore combined with that of all joints.
    """
    sums, pairs = np.zeros(len(groups)), np.zeros(len(groups))
    for i, group in enumerate(groups):
        if group.lagged is not None:
            u = group.residual_form(theta)
            power = max(float(u @ group.gram @ u), 1e-300) / group.count
            sums[i], pairs[i] = float(u @ group.lagged @ u) / power, group.pairs
    pooled = sums.sum() / max(pairs.sum(), 1.0)
    rho = np.clip((sums + POOLED_PAIRS * pooled) / (pairs + POOLED_PAIRS), 0.0, 0.95)
    is_motion = np.array([group.lagged is not None for group in groups])
    return np.where(is_motion, (1.0 + rho) / (1.0 - rho), 1.0)


def estimated_variances(
    groups: list[Group], squares: FloatArray, free: FloatArray, scale: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the variances of the groups and their degrees of freedom."""
    relative = np.array([scale[group.joint]**2 for group in groups])
    variances, freedom = np.zeros(len(groups)), np.zeros(len(groups))
    # The friction of pairs relative to F², of all joints, because it depends on the controller:
    # friction at rest is any part of F in the direction of approach.
    pairs = [i for i, group in enumerate(groups) if group.kind == 'paired' and group.band > 0.0]
    remainder = (sum(squares[i] / groups[i].band**2 for i in pairs)
                 + _PAIRED_WEIGHT * BAND_VARIANCE * PAIRED_FRACTION**2) / (
                     float(free[pairs].sum()) + _PAIRED_WEIGHT)
    for kinds in (('motion',), ('single', 'paired')):
        own = np.array([group.kind in kinds for group in groups])
        pooled = (float(np.sum(squares[own] / relative[own]))
                  + _ASSUMED_WEIGHT * ASSUMED_NOISE**2) / (
                      float(free[own].sum()) + _ASSUMED_WEIGHT)
        for i in np.flatnonzero(own).tolist():
            group = groups[i]
            prior = remainder * group.band**2 if i in pairs else (
                group.prior if group.prior > 0.0 else pooled * relative[i])
            freedom[i] = free[i] + group.prior_weight
            variances[i] = max((squares[i] + group.prior_weight * prior) / freedom[i], group.least)
    return variances, freedom
