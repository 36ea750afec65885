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
from robot_dynamics.arrays import FloatArray, IntArray
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
    width = information.factors.shape[-1]
    _, places, own = base_variables(base, problem)
    names = *base.labels, *(
        f'{COLUMN_NAMES[column]}({information.joint_names[j]})' for j, column in own)
    models = [problem.linear(j, width)[:, places] for j in range(n)]

    def groups(factors: FloatArray) -> list[effort_fit.Rows]:
        return [effort_fit.Rows(factors[j], counts[j], np.eye(width)[-1], models[j])
                for j in joints]

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
    of_base = effort_fit.decomposed(A[:, :r], 0.0)
    size = _scale_of(base, prior, n)
    before = np.concatenate([
        base.matrix @ np.concatenate([prior.parameters, np.zeros(n)]), np.zeros(len(x) - r)])
    excited = np.concatenate([deviations[:r] < UNEXCITED * size, np.isfinite(deviations[r:])])
    condition = np.inf if of_base.is_lost.any() else of_base.condition
    return ParameterEstimate(names, x, deviations, before, r, condition, excited)


def base_variables(base: BaseParameters, problem: Problem) -> tuple[
        FloatArray, IntArray, list[tuple[int, int]]]:
    """
    Return how the variables of a problem depend on base parameters and joints' own parameters.

    The matrix (k, u) is from the variables to both; the places (k,) are those of variables with
    which it is the unit matrix; the pairs are joint and column of each own parameter.
    """
    starts = [part.start for _, part in problem.own]
    of_base = np.concatenate([np.arange(problem.prior.count), starts])
    own = np.setdiff1d(np.arange(problem.size), of_base)
    places = np.concatenate([of_base[list(base.columns)], own]).astype(np.intp)
    T = np.eye(problem.size)[places]
    T[:base.rank, of_base] = base.matrix
    return T, places, [(j, column) for j, structure in enumerate(problem.structures)
                       for column in structure.columns if column != INERTIA]


def _scale_of(base: BaseParameters, prior: Prior, n: int) -> FloatArray:
    """Return the deviations (r,) that correspond to a URDF that is wrong by about 100 %."""
    p = prior.count
    spread = np.zeros((p + n, p + n))
    spread[:p, :p] = np.linalg.inv(prior.rows)
    spread[p:, p:] = np.diag(prior.inertia)
    return np.asarray(np.linalg.norm(base.matrix @ spread, axis=1))
