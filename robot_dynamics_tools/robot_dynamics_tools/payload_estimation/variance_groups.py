# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The observations in groups with a common variance, and these variances from the residuals.

A joint that stops while it moves in the positive direction keeps friction of one sign, and one
that stops from the other side keeps friction of the other sign. The average of a pair of such
rests does not depend on dry friction of equal size. A rest without a partner has the whole band of
friction, of the sign of its approach.

A group has the rows of one joint and one kind: blocks of motion, paired rests, or single rests.
Few residuals determine a variance poorly. It is therefore combined with a prior: that of dry
friction within the known band ± F, or the variance of the other joints relative to their effort
limits. Blocks whose residuals are correlated with the next block count less, by
(1 − ρ) / (1 + ρ).
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.regressor import COUNT
from robot_dynamics_tools.estimation.effort_fit import Rows
from robot_dynamics_tools.payload_estimation.rows import Column, COLUMNS, LoadRows, Rest

PAIR_DISTANCE = 0.5
"""Largest distance [rad] or [m] of every joint between the two rests of a pair."""
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


class RestRow(NamedTuple):
    """
    An observation of a joint at rest: the mean of two rests if `is_paired`, otherwise one rest.

    `row` (c,) has as SIGN the direction of approach. Parts of one uninterrupted rest share the
    `weight` of one observation, because friction may be the same. `noise` is the variance of the
    average due to noise between samples.
    """

    joint: int
    row: FloatArray
    is_paired: bool
    weight: float
    noise: float


def pair_rests(rests: Sequence[Rest], independent_interval: float) -> list[RestRow]:
    """
    Return the observations at rest, each rest in at most one pair.

    Samples `independent_interval` [s] apart are independent.
    """
    groups: list[tuple[Rest, ...]] = []
    for joint in sorted({rest.joint for rest in rests}):
        groups += _pairs_and_others([rest for rest in rests if rest.joint == joint])
    stays = Counter((rest.joint, rest.stay) for rest in rests)
    return [RestRow(
        group[0].joint, np.mean([rest.row for rest in group], axis=0), len(group) == 2,
        1.0 / max(stays[rest.joint, rest.stay] for rest in group),
        float(np.mean([rest.variance / max(rest.duration / independent_interval, 1.0)
                       for rest in group])) / len(group)) for group in groups]


def _pairs_and_others(rests: Sequence[Rest]) -> list[tuple[Rest, ...]]:
    """Return pairs of opposite approaches, nearest first, and the rests without a partner."""
    ups, downs = ([i for i, rest in enumerate(rests) if rest.approach == side] for side in (1, -1))
    position = np.array([rest.position for rest in rests])
    distance = np.abs(position[ups, None] - position[None, downs]).max(axis=2)
    near = sorted((float(distance[i, k]), ups[i], downs[k])
                  for i, k in np.argwhere(distance <= PAIR_DISTANCE).tolist())
    used: set[int] = set()
    groups: list[tuple[Rest, ...]] = []
    for _, i, k in near:
        if not {i, k} & used:
            used |= {i, k}
            groups.append((rests[i], rests[k]))
    return groups + [(rest,) for i, rest in enumerate(rests) if i not in used]


@dataclass(frozen=True, eq=False)
class Group:
    """
    Rows of one joint and kind: their model, and a `prior` of the variance of some weight.

    `lagged` (c, c) is Σ z₁ z₂ᵀ of consecutive rows, of which there are `pairs`.
    """

    joint: int
    kind: str
    rows: Rows
    prior: float
    prior_weight: float
    least: float
    band: float = 0.0
    lagged: FloatArray | None = None
    pairs: float = 0.0


def make_groups(
    rows: LoadRows, rests: Sequence[RestRow], band: FloatArray, scale: FloatArray,
) -> list[Group]:
    groups, n = [], len(scale)
    for j in range(n):
        least = (LEAST_NOISE * scale[j])**2
        if rows.count[j]:
            groups.append(Group(
                j, 'motion', _model(rows.gram[j], rows.count[j], n, j, 'motion'), 0.0,
                POOLED_WEIGHT, least, lagged=rows.lagged[j], pairs=rows.pairs[j]))
        for kind, fraction in (('single', 1.0), ('paired', PAIRED_FRACTION)):
            own = [one for one in rests
                   if one.joint == j and one.is_paired == (kind == 'paired')]
            if own:
                z, w = np.array([one.row for one in own]), np.array([one.weight for one in own])
                noise = float(np.average([one.noise for one in own], weights=w))
                prior = BAND_VARIANCE * (fraction * band[j])**2 + noise if band[j] > 0.0 else 0.0
                groups.append(Group(
                    j, kind, _model((z * w[:, None]).T @ z, float(w.sum()), n, j, kind), prior,
                    BAND_WEIGHT if band[j] > 0.0 and kind == 'single' else POOLED_WEIGHT,
                    max(least, 0.25 * noise), band[j]))
    return groups


def _model(gram: FloatArray, count: float, n: int, joint: int, kind: str) -> Rows:
    """Return rows with Σ w z zᵀ, `gram` (c, c), of one of n joints, and their model."""
    size = len(gram)
    effort, known = np.zeros((2, size))
    linear, scaled = np.zeros((2, size, unknown_count(n, size)))
    effort[[Column.RESIDUAL, Column.RIGID]] = known[Column.RIGID] = 1.0
    scaled[:COUNT, :COUNT] = np.eye(COUNT)
    unknown = COUNT + 3 * n + 1 + joint
    linear[Column.ONE, unknown + n] = 1.0
    linear[COLUMNS:, unknown_count(n):] = np.eye(size - COLUMNS)
    if kind == 'motion':
        linear[[Column.VELOCITY, Column.SIGN, Column.RATE],
               [COUNT + joint, COUNT + n + joint, COUNT + 3 * n]] = 1.0
    elif kind == 'single':
        linear[Column.SIGN, COUNT + 2 * n + joint] = 1.0
    return Rows(root_of(gram), count, effort, linear, unknown, known, scaled)


def root_of(A: FloatArray) -> FloatArray:
    """Return R (k, k) with RᵀR = A, symmetric and positive semidefinite."""
    size = np.sqrt(np.diag(A))
    values, vectors = np.linalg.eigh(A / np.outer(*2 * (np.where(size > 0.0, size, 1.0),)))
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * size)


def unknown_count(n: int, columns: int = COLUMNS) -> int:
    """Return the number of unknowns for n joints, which `information` lists, in this order."""
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
            u = group.rows.residual(theta)
            power = max(group.rows.squares(theta), 1e-300) / group.rows.size
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
