# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Selection of the friction structures and of the regularization weight κ by cross-validation.

Every block of the training samples is a fold: it is omitted once, together with the adjacent gaps,
and predicted from the others. Blocks are contiguous in time, because neighbouring samples are
nearly equal, so that the prediction of a single omitted sample would prove nothing. (P. Burman,
E. Chow, D. Nolan, "A cross-validatory method for dependent data", Biometrika 81(2), 1994.) Of the
friction structures whose prediction is as good as the best, to within the standard error between
the folds, the simplest one is used, and of the regularizations the strongest one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics_tools.identification import friction_regressor, regularized_fit
from robot_dynamics_tools.identification.qr_information import QrInformation

REGULARIZATIONS = tuple(10.0**exponent for exponent in range(-3, 7))
"""Candidates of κ; the last one leaves the bodies of the URDF unchanged."""
SWEEPS = 2
LARGEST_LOSS = 0.05
"""Relative increase of the residual that is accepted for a simpler structure."""
EXACT = 1e-24
"""Sum of squares, by the largest of all candidates, that counts as no residual."""
_FIRST_REGULARIZATION = 1.0
_FIRST_SIGMA = 0.1


@dataclass(frozen=True, eq=False)
class FittedModels:
    """
    Models of one arm, fitted to the same samples, and the problem that was chosen for them.

    `validated` (n,) is the RMS of the residual on the omitted blocks, relative to that of the
    effort. `by_name` are the models: 'urdf' has the bodies of the URDF and no friction, 'urdf and
    friction' has the bodies of the URDF and fitted friction, 'base' the regularized base
    parameters, 'consistent' the physically consistent set. 'unbounded' is like 'base', but
    friction and rotors may be negative.
    """

    problem: regularized_fit.Problem
    validated: FloatArray
    by_name: dict[str, regularized_fit.Fit]

    @property
    def consistent(self) -> regularized_fit.Fit:
        """The physically consistent set, which is written to the files."""
        return self.by_name['consistent']


class CrossValidation:
    """Sums of squares on the omitted blocks (folds, f of them), for any model."""

    def __init__(self, information: QrInformation, prior: regularized_fit.Prior) -> None:
        self.information, self.prior = information, prior.for_effort(information)
        self._train = [regularized_fit.grams_of(information.all_but(i)) for i in information.folds]
        self._block = [regularized_fit.grams_of(information.block(i)) for i in information.folds]
        self.all = regularized_fit.grams_of(information.together())
        self.effort_power = np.sum([grams[:, -1, -1] for grams in self._block], axis=0)
        self.rows = max(float(information.rows[::2].sum()), 1.0)

    def squares(self, problem: regularized_fit.Problem) -> FloatArray:
        """Return the sum of squared residuals on each omitted block, (f, n)."""
        return np.stack([
            regularized_fit.solve(train, problem).squares(block)
            for train, block in zip(self._train, self._block)])

    def relative(self, squares: FloatArray) -> FloatArray:
        """Return RMS of residual over RMS of effort, (n,), of squares (f, n)."""
        power = np.where(self.effort_power > 0.0, self.effort_power, 1.0)
        return np.asarray(np.sqrt(squares.sum(axis=0) / power))

    def weights(self, squares: FloatArray) -> FloatArray:
        """Return w = 1 / (σ² × samples per independent sample), (n,); 0 without any effort."""
        variance = squares.sum(axis=0) / self.rows
        least = 1e-12 * max(float(self.effort_power.max()) / self.rows, 1e-30)
        weight = 1.0 / (
            np.maximum(variance, least) * self.information.samples_per_independent_sample)
        return np.asarray(np.where(self.information.is_measured, weight, 0.0))


def choose_model(
    information: QrInformation, prior: regularized_fit.Prior,
    first: Sequence[friction_regressor.FrictionStructure] | None = None,
) -> tuple[regularized_fit.Problem, FloatArray]:
    """
    Return the structures and the regularization that predict the omitted samples best.

    The second value is `FittedModels.validated`.
    """
    validation = CrossValidation(information, prior)
    n = len(information.joint_names)
    left_out = [information.excitation.left_out(joint) for joint in range(n)]
    chosen = tuple(
        structure if structure in friction_regressor.structures(left_out[joint]) else
        next(iter(friction_regressor.structures(left_out[joint])))
        for joint, structure in enumerate(first or [friction_regressor.SIMPLEST] * n))
    weights = validation.weights(_FIRST_SIGMA**2 * validation.effort_power[np.newaxis])
    problem = regularized_fit.Problem(chosen, weights, validation.prior, _FIRST_REGULARIZATION)
    for _ in range(SWEEPS):
        for joint in np.flatnonzero(validation.information.is_measured).tolist():
            problem = _with_best_structure(validation, problem, joint, left_out[joint])
        problem = problem._replace(weights=validation.weights(validation.squares(problem)))
        problem, squares = _with_best_regularization(validation, problem)
        problem = problem._replace(weights=validation.weights(squares))
    problem, squares = _with_best_regularization(validation, problem)
    return problem, validation.relative(squares)


def fit_models(
    factors: FloatArray, problem: regularized_fit.Problem, validated: FloatArray, urdf: FloatArray,
) -> FittedModels:
    """Return all models, fitted to factors R (n, k, k); `urdf` (p,) are the bodies of the URDF."""
    base = regularized_fit.solve_bounded(factors, problem)
    return FittedModels(problem, validated, {
        'urdf': regularized_fit.Fit(urdf, np.zeros_like(base.joint_values), problem.structures),
        'urdf and friction': regularized_fit.solve_bounded(factors, problem._replace(
            regularization=regularized_fit.URDF_REGULARIZATION)),
        'base': base,
        'unbounded': regularized_fit.solve(regularized_fit.grams_of(factors), problem),
        'consistent': regularized_fit.consistent_fit(factors, problem, base)})


def _with_best_regularization(
    validation: CrossValidation, problem: regularized_fit.Problem,
) -> tuple[regularized_fit.Problem, FloatArray]:
    """Return the strongest regularization that predicts as well as the best, and its squares."""
    problems = [problem._replace(regularization=k) for k in REGULARIZATIONS]
    every_joint = [validation.squares(each) for each in problems]
    by_regularization = [squares[:, validation.information.is_measured] for squares in every_joint]
    sums = np.array([squares.sum(axis=0) for squares in by_regularization])
    totals = np.maximum(sums, np.maximum(EXACT * sums.max(axis=0), 1e-300))
    # the sum of logarithms over joints, in which relative changes of all joints count equally
    best = int(np.argmin([np.log(total).sum() for total in totals]))
    ratios = [(squares / totals[best]).sum(axis=1) for squares in by_regularization]
    strongest = max(i for i in range(best, len(by_regularization)) if i == best or (
        _is_as_good(ratios[i], ratios[best])))
    return problems[strongest], every_joint[strongest]


def _with_best_structure(
    validation: CrossValidation, problem: regularized_fit.Problem, joint: int,
    left_out: Sequence[str],
) -> regularized_fit.Problem:
    """Return the simplest structure that predicts as well as the best; dry before an offset."""
    offered = []
    for structure in friction_regressor.structures(left_out):
        chosen = problem.structures
        trial = problem._replace(structures=(*chosen[:joint], structure, *chosen[joint + 1:]))
        fit = regularized_fit.solve(validation.all, trial)
        if regularized_fit.is_physical(fit.joint_values[joint], problem.prior.largest[joint]):
            offered.append((structure, trial, validation.squares(trial)[:, joint]))
    if not offered:
        return problem
    *_, best = min(offered, key=lambda each: float(each[2].sum()))
    good = [each for each in offered if _is_as_good(each[2], best)]
    return min(good, key=lambda each: (
        len(each[0].columns), each[0].dry_count == 0, float(each[2].sum())))[1]


def _is_as_good(squares: FloatArray, best: FloatArray) -> bool:
    difference = squares - best
    error = float(difference.std(ddof=1)) / np.sqrt(len(difference))
    return bool(difference.mean() <= error
                and squares.sum() <= (1.0 + LARGEST_LOSS)**2 * best.sum())
