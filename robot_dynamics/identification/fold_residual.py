# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0


"""
The residual of models on the cross-validation folds, if no samples are left for a test.

Every fold is predicted by models that are fitted to the other folds, with the structures and the
regularization of all folds. The residual is therefore slightly too small, because these were
selected with the same folds.
"""

from collections.abc import Callable, Mapping

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.identification.consistent_fit import consistent_fit
from robot_dynamics.identification.holdout import ModelTest
from robot_dynamics.identification.model_selection import ModelChoice
from robot_dynamics.identification.qr_information import QrInformation
from robot_dynamics.identification.regularized_fit import (
    Fit,
    grams_of,
    Prior,
    solve,
    solve_bounded,
    URDF_REGULARIZATION,
    without_memory,
)


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
