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
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics_tools.identification.friction_regressor import (
    FrictionStructure,
    SIMPLEST,
    structures,
)
from robot_dynamics_tools.identification.qr_information import QrInformation
from robot_dynamics_tools.identification.regularized_fit import (
    consistent_fit,
    Fit,
    grams_of,
    is_physical,
    Prior,
    solve,
    solve_bounded,
    URDF_REGULARIZATION,
)

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
class ModelChoice:
    """
    The result of cross-validation.

    `structures` are those of the n joints, `regularization` is κ, `weights` (n,) are those of the
    residuals. `validated` (n,) is the RMS of the residual on the omitted blocks, relative to that
    of the effort.
    """

    structures: tuple[FrictionStructure, ...]
    regularization: float
    weights: FloatArray
    validated: FloatArray


@dataclass(frozen=True, eq=False)
class FittedModels:
    """
    Models of one arm, fitted to the same samples, and how they were chosen.

    `urdf` has the bodies of the URDF and no friction, `friction` has the bodies of the URDF and
    fitted friction, `base` the regularized base parameters, `consistent` the physically consistent
    set. `unbounded` is like `base`, but friction and rotors may be negative.
    """

    choice: ModelChoice
    urdf: Fit
    friction: Fit
    base: Fit
    consistent: Fit
    unbounded: Fit

    @property
    def by_name(self) -> dict[str, Fit]:
        return {'urdf': self.urdf, 'urdf and friction': self.friction, 'base': self.base,
                'unbounded': self.unbounded, 'consistent': self.consistent}


class CrossValidation:
    """Sums of squares on the omitted blocks (folds, f of them), for any model."""

    def __init__(self, information: QrInformation, prior: Prior) -> None:
        self.information, self.prior = information, prior.for_effort(information)
        self._train = [grams_of(information.all_but(i)) for i in information.folds]
        self._block = [grams_of(information.block(i)) for i in information.folds]
        self.all = grams_of(information.together())
        rows = information.rows[::2].sum()
        self.effort_power = np.sum([grams[:, -1, -1] for grams in self._block], axis=0)
        self.is_measured = information.is_measured
        self.rows = max(float(rows), 1.0)

    def squares(
        self, chosen: Sequence[FrictionStructure], weights: FloatArray, regularization: float,
    ) -> FloatArray:
        """Return the sum of squared residuals on each omitted block, (f, n)."""
        return np.stack([
            solve(train, chosen, weights, self.prior, regularization).squares(block)
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
        return np.asarray(np.where(self.is_measured, weight, 0.0))


def choose_model(
    information: QrInformation, prior: Prior,
    first: Sequence[FrictionStructure] | None = None,
) -> ModelChoice:
    """Return the structures and the regularization that predict the omitted samples best."""
    validation = CrossValidation(information, prior)
    n = len(information.joint_names)
    left_out = [information.excitation.left_out(joint) for joint in range(n)]
    chosen = [
        structure if structure in structures(left_out[joint]) else
        next(iter(structures(left_out[joint])))
        for joint, structure in enumerate(first or [SIMPLEST] * n)]
    regularization = _FIRST_REGULARIZATION
    weights = validation.weights(_FIRST_SIGMA**2 * validation.effort_power[np.newaxis])
    for _ in range(SWEEPS):
        for joint in np.flatnonzero(validation.is_measured).tolist():
            chosen[joint] = _best_structure(
                validation, chosen, joint, weights, regularization, left_out[joint])
        weights = validation.weights(validation.squares(chosen, weights, regularization))
        by_regularization = [validation.squares(chosen, weights, k) for k in REGULARIZATIONS]
        best = _best_regularization(by_regularization, validation.is_measured)
        regularization = REGULARIZATIONS[best]
        weights = validation.weights(by_regularization[best])
    by_regularization = [validation.squares(chosen, weights, k) for k in REGULARIZATIONS]
    best = _best_regularization(by_regularization, validation.is_measured)
    return ModelChoice(
        tuple(chosen), REGULARIZATIONS[best], weights,
        validation.relative(by_regularization[best]))


def fit_models(
    factors: FloatArray, choice: ModelChoice, prior: Prior, urdf: FloatArray,
) -> FittedModels:
    """Return all models, fitted to factors R (n, k, k); `urdf` (p,) are the bodies of the URDF."""
    problem, regularization = (choice.structures, choice.weights, prior), choice.regularization
    base = solve_bounded(factors, *problem, regularization)
    return FittedModels(
        choice, urdf=Fit(urdf, np.zeros_like(base.joint_values), choice.structures),
        friction=solve_bounded(factors, *problem, URDF_REGULARIZATION), base=base,
        consistent=consistent_fit(factors, *problem, regularization, base),
        unbounded=solve(grams_of(factors), *problem, regularization))


def _best_regularization(every_joint: Sequence[FloatArray], is_measured: BoolArray) -> int:
    """Return the number of the strongest regularization that predicts as well as the best."""
    by_regularization = [squares[:, is_measured] for squares in every_joint]
    sums = np.array([squares.sum(axis=0) for squares in by_regularization])
    totals = np.maximum(sums, np.maximum(EXACT * sums.max(axis=0), 1e-300))
    # the sum of logarithms over joints, in which relative changes of all joints count equally
    best = int(np.argmin([np.log(total).sum() for total in totals]))
    ratios = [(squares / totals[best]).sum(axis=1) for squares in by_regularization]
    return max(i for i in range(best, len(by_regularization)) if i == best or (
        _is_as_good(ratios[i], ratios[best])))


def _best_structure(
    validation: CrossValidation, chosen: Sequence[FrictionStructure], joint: int,
    weights: FloatArray, regularization: float, left_out: Sequence[str],
) -> FrictionStructure:
    """Return the simplest structure that predicts as well as the best; dry before an offset."""
    offered: list[tuple[FrictionStructure, FloatArray]] = []
    for structure in structures(left_out):
        trial = [*chosen[:joint], structure, *chosen[joint + 1:]]
        fit = solve(validation.all, trial, weights, validation.prior, regularization)
        if is_physical(fit.joint_values[joint], validation.prior.largest[joint]):
            squares = validation.squares(trial, weights, regularization)
            offered.append((structure, squares[:, joint]))
    if not offered:
        return chosen[joint]
    _, best = min(offered, key=lambda pair: float(pair[1].sum()))
    good = [pair for pair in offered if _is_as_good(pair[1], best)]
    return min(good, key=lambda pair: (
        len(pair[0].columns), pair[0].dry_count == 0, float(pair[1].sum())))[0]


def _is_as_good(squares: FloatArray, best: FloatArray) -> bool:
    difference = squares - best
    error = float(difference.std(ddof=1)) / np.sqrt(len(difference))
    return bool(difference.mean() <= error
                and squares.sum() <= (1.0 + LARGEST_LOSS)**2 * best.sum())
