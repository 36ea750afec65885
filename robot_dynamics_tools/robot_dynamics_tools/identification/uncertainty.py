# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The uncertainty of each base parameter: its standard deviation, and whether it is excited.

The method is weighted least squares over the base parameters and the joints' own columns, without
regularization: the covariance is (Σ_j w_j X_jᵀ X_j)⁻¹ with w_j = 1 / (σ_j² s_j). Filtered samples
are not independent: s_j samples count as one (`regression`). This is exact for noise that is white
over the band of the regressor. For other errors, such as those of friction, deviations are at
least those of the jackknife over the folds (B. Efron, The Annals of Statistics 7(1), 1979), and
all are enlarged by the median of their ratios to it.
"""

from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import column_scale, FloatArray
from robot_dynamics_tools.base_parameters import BaseParameters
from robot_dynamics_tools.estimation import effort_fit
from robot_dynamics_tools.identification.friction_regressor import COLUMN_NAMES, INERTIA
from robot_dynamics_tools.identification.qr_information import QrInformation
from robot_dynamics_tools.identification.regularized_fit import Prior, Problem

UNEXCITED = 1.0
"""
A base parameter is not excited if its deviation is above this fraction of the deviation that
corresponds to a URDF that is wrong by about 100 %.
"""


@dataclass(frozen=True, eq=False)
class ParameterEstimate:
    """
    Base parameters β and the joints' own parameters, k of them, by unregularized least squares.

    `names`, `values`, `deviations` (standard), `prior` (of the URDF; own parameters 0) are (k,).
    `base_count` of them are base parameters; `condition` is the condition number of their columns,
    scaled to the same size; `excited` (k,) marks the parameters that the data determine better
    than the scale of the URDF.
    """

    names: tuple[str, ...]
    values: FloatArray
    deviations: FloatArray
    prior: FloatArray
    base_count: int
    condition: float
    excited: FloatArray

    @property
    def relative_deviations(self) -> FloatArray:
        """Return deviation / |value|, (k,), infinite if the value is 0."""
        with np.errstate(divide='ignore'):
            return np.asarray(self.deviations / np.abs(self.values))

    @property
    def unexcited(self) -> tuple[str, ...]:
        return tuple(name for name, good in zip(self.names, self.excited) if not good)


def estimate_parameters(
    information: QrInformation, base: BaseParameters, problem: Problem,
) -> ParameterEstimate:
    """
    Return the base parameters of all samples, weighted by joint, with their deviations.

    `base` are the base parameters of φ and the rotors' reflected inertia, which follow φ.
    """
    n, prior, r = len(information.joint_names), problem.prior, base.rank
    joints = np.flatnonzero(information.is_measured).tolist()
    counts = float(information.rows.sum()) / information.samples_per_independent_sample
    blocks, names = _columns(information, base, problem)
    effort = np.eye(len(blocks[0]))[-1]

    def groups(factors: FloatArray) -> list[effort_fit.Rows]:
        return [effort_fit.Rows(factors[j], counts[j], effort, blocks[j]) for j in joints]

    fit = effort_fit.fit_effort(groups(information.together()), np.zeros(len(names)))
    x, is_lost = fit.values, fit.solution.is_lost
    noise = np.linalg.norm(fit.solution.back, axis=1)
    parts = [effort_fit.stacked(groups(information.all_but(i)), x, fit.variances)
             for i in information.folds]
    changes = np.array([effort_fit.decomposed(A).inverse @ b for A, b, _ in parts])
    jackknife = np.sqrt((changes**2).sum(axis=0) * (1.0 - 1.0 / len(parts)))
    known = ~is_lost & (noise > 0.0)
    widening = max(float(np.median(jackknife[known] / noise[known])), 1.0) if known.any() else 1.0
    deviations = np.where(is_lost, np.inf, np.maximum(widening * noise, jackknife))
    A, _, _ = effort_fit.stacked(groups(information.together()), x, fit.variances)
    s_base = np.linalg.svd(A[:, :r] * column_scale(A[:, :r]), compute_uv=False)
    size = _scale_of(base, prior, n)
    before = np.concatenate([
        base.matrix @ np.concatenate([prior.parameters, np.zeros(n)]), np.zeros(len(x) - r)])
    excited = np.concatenate([deviations[:r] < UNEXCITED * size, np.isfinite(deviations[r:])])
    condition = float(s_base[0] / s_base[-1]) if s_base.all() and joints else np.inf
    return ParameterEstimate(names, x, deviations, before, r, condition, excited)


def _columns(
    information: QrInformation, base: BaseParameters, problem: Problem,
) -> tuple[list[FloatArray], tuple[str, ...]]:
    """Return for each joint the matrix that maps the estimate to the columns of its factor."""
    r, p = base.rank, problem.prior.count
    own = [[c for c in structure.columns if c != INERTIA] for structure in problem.structures]
    total = r + sum(len(columns) for columns in own)
    names = list(base.labels)
    blocks = []
    first = r
    for j, columns in enumerate(own):
        block = np.zeros((len(information.columns) + 1, total))
        for k, column in enumerate(base.columns):
            if column < p:
                block[column, k] = 1.0
            elif column == p + j:
                block[p + INERTIA, k] = 1.0
        for i, column in enumerate(columns):
            block[p + column, first + i] = 1.0
            names.append(f'{COLUMN_NAMES[column]}({information.joint_names[j]})')
        blocks.append(block)
        first += len(columns)
    return blocks, tuple(names)


def _scale_of(base: BaseParameters, prior: Prior, n: int) -> FloatArray:
    """Return the deviations (r,) that correspond to a URDF that is wrong by about 100 %."""
    p = prior.count
    spread = np.zeros((p + n, p + n))
    spread[:p, :p] = np.linalg.inv(prior.rows)
    spread[p:, p:] = np.diag(prior.inertia)
    return np.asarray(np.linalg.norm(base.matrix @ spread, axis=1))
