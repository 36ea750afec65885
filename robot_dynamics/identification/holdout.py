# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The residual of models on samples that were not used for training.

A residual is given relative to the effort, RMS to RMS. It is computed twice: along the motion,
with presliding hysteresis, and sample by sample, like an answer of the node to a single state.

If no samples are left for a test, every cross-validation fold is predicted by models that are
fitted to the other folds, with the structures and the regularization of all folds. The residual is
then slightly too small, because these were selected with the same folds.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from robot_dynamics.analysis.motion_filter import FilteredMotion
from robot_dynamics.arrays import FloatArray
from robot_dynamics.identification.consistent_fit import consistent_fit
from robot_dynamics.identification.model_selection import ModelChoice
from robot_dynamics.identification.qr_information import QrInformation
from robot_dynamics.identification.regression import model_effort, parts_of
from robot_dynamics.identification.regularized_fit import (
    Fit,
    grams_of,
    Prior,
    solve,
    solve_bounded,
    URDF_REGULARIZATION,
    without_memory,
)
from robot_dynamics.model.arm import ArmModel


@dataclass(frozen=True, eq=False)
class ModelTest:
    """
    Sums of squares over samples, each (n,): of a model's residual, and of the effort itself.

    `train` and `test` are along the motion, `test_by_sample` is sample by sample; `train_effort`
    and `test_effort` are those of the measured effort; `samples` are the counts (training, test).
    """

    train: FloatArray
    test: FloatArray
    test_by_sample: FloatArray
    train_effort: FloatArray
    test_effort: FloatArray
    samples: tuple[int, int]

    def relative(self, which: str = 'test') -> FloatArray:
        """Return RMS of residual / RMS of effort, (n,), for 'train', 'test', …; NaN if empty."""
        effort = self.train_effort if which == 'train' else self.test_effort
        squares: FloatArray = getattr(self, which)
        return np.sqrt(np.divide(
            squares, effort, out=np.full_like(squares, np.nan), where=effort > 0.0))

    def rms(self, which: str = 'test') -> FloatArray:
        """Return the RMS of the residual, (n,) [N·m] or [N]."""
        count = max(self.samples[0 if which == 'train' else 1], 1)
        return np.asarray(np.sqrt(getattr(self, which) / count))


def evaluate_motion(
    arm: ArmModel, motion: FilteredMotion, train_fraction: float, models: Mapping[str, Fit],
) -> dict[str, ModelTest]:
    """Return the test of each model on the samples of one recording."""
    parts = parts_of(motion, train_fraction)
    tests = {}
    for name, fit in models.items():
        along, single = model_effort(arm, motion, fit)
        effort = np.zeros_like(along) if motion.effort is None else motion.effort
        residual, by_sample = effort - along, (effort - single)[parts.test]
        tests[name] = ModelTest(
            _squares(residual[parts.train]), _squares(residual[parts.test]), _squares(by_sample),
            _squares(effort[parts.train]), _squares(effort[parts.test]),
            (len(residual[parts.train]), len(residual[parts.test])))
    return tests


def merge_tests(tests: Sequence[Mapping[str, ModelTest]]) -> dict[str, ModelTest]:
    """Return the combined tests of several recordings, for each model."""
    return {name: _sum([of_one[name] for of_one in tests]) for name in tests[0]}


def _sum(tests: Sequence[ModelTest]) -> ModelTest:
    def total(field: str) -> FloatArray:
        return np.asarray(np.sum([getattr(test, field) for test in tests], axis=0))

    return ModelTest(
        total('train'), total('test'), total('test_by_sample'), total('train_effort'),
        total('test_effort'), (
            sum(test.samples[0] for test in tests), sum(test.samples[1] for test in tests)))


def _squares(values: FloatArray) -> FloatArray:
    return np.asarray(np.sum(values**2, axis=0))


def cross_validated_tests(
    information: QrInformation, prior: Prior, choice: ModelChoice, urdf: Fit,
    trained: Mapping[str, ModelTest],
) -> dict[str, ModelTest]:
    """Return the tests with the residual of the folds; `trained` are those of the training."""
    args = (choice.structures, choice.weights, prior)
    kappa = choice.regularization

    def consistent(factors: FloatArray) -> Fit:
        return consistent_fit(factors, *args, kappa, solve_bounded(factors, *args, kappa))

    fits: dict[str, Callable[[FloatArray], Fit]] = {
        'urdf': lambda factors: urdf,
        'urdf and friction': lambda factors: solve_bounded(factors, *args, URDF_REGULARIZATION),
        'base': lambda factors: solve_bounded(factors, *args, kappa),
        'unbounded': lambda factors: solve(grams_of(factors), *args, kappa),
        'consistent': consistent}
    blocks = [grams_of(information.block(i)) for i in information.folds]
    effort = np.sum([grams[:, -1, -1] for grams in blocks], axis=0)
    count = int(information.rows[::2].sum())
    tests = {}
    for name, test in trained.items():
        found = [fits[name](information.all_but(i)) for i in information.folds]
        along, single = (
            np.sum([fit.squares(grams) for fit, grams in zip(each, blocks)], axis=0)
            for each in (found, [without_memory(fit) for fit in found]))
        tests[name] = ModelTest(
            test.train, along, single, test.train_effort, effort, (test.samples[0], count))
    return tests
