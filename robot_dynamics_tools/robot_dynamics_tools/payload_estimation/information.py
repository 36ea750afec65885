# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The unknowns of a payload estimate, their prior, and the fit (`effort_fit`).

The unknowns are π (10,) of the load; for each joint an error of the viscous and of the dry
friction of the model, and the mean dry friction of its single rests in the direction of approach;
a delay of all measured efforts, because drives hold an effort during a period; and for each joint
an error of the effort scale and of the effort offset, with the covariance of their calibration,
or of drives that were not calibrated (the scale multiplies the modelled effort, because with the
measured effort, noise would favour small scales);
the errors of the model, as independent unknowns with the deviation 1 (`ModelUncertainty.root`).

The rows form groups with a variance each (`variance_groups`), from the residuals of
the group and its degrees of freedom.

The mean friction at rest has the prior deviation F. Without this unknown, friction that supports
the load in every hold, as in an arm that sags, would count as independent errors.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.regressor import COUNT
from robot_dynamics_tools.estimation.effort_fit import fit_effort, inverse_of, inverse_root, NORMAL
from robot_dynamics_tools.payload_estimation import variance_groups
from robot_dynamics_tools.payload_estimation.rows import Column, LoadRows
from robot_dynamics_tools.payload_estimation.variance_groups import Group, RestRow

PRIOR_DEVIATION = 100.0
"""Deviation [kg, kg·m, kg·m²] of the parameters without data: no restriction."""
LARGEST_DELAY = 0.005
"""Deviation [s] of the delay of the measured effort without data."""
FRICTION_ERROR = 0.5
"""Deviation of the friction of the model, relative to the effort limit, without data."""
EXPECTED_NOISE = 0.003
"""Deviation of an expected observation without friction, relative to the effort limit."""
EXPECTED_FRICTION = 0.1
"""Expected error of the friction in motion, relative to dry friction."""
_EXACT = 1e-7
"""Relative deviation of an effort scale and offset that count as exact."""


@dataclass(frozen=True, eq=False)
class Solution:
    """
    The estimate π (10,), its covariance (10, 10), and deviations (10,).

    π ± 1.96 deviations covers the true value in 95 % of the cases: deviations are larger than
    those of the covariance if few residuals determine the variances. `per_percent` (10,) is the
    error of π if all measured efforts are 1 % too large. `expected` are the variances (n,) of
    further rows, by their kind: 'motion', 'single' or 'paired'. `residual` (n,) is the RMS of the
    residuals of each joint by that of its effort, NaN without effort. `of_drives` (10,) are
    the parts of the variances that unknown effort scales and offsets cause.
    """

    values: FloatArray
    covariance: FloatArray
    deviations: FloatArray
    per_percent: FloatArray
    expected: dict[str, FloatArray]
    residual: FloatArray
    of_drives: FloatArray


def solve(
    rows: LoadRows, rests: Sequence[RestRow], band: FloatArray, scale: FloatArray,
    drive_covariance: FloatArray,
) -> Solution:
    """
    Return the estimate.

    `band` (n,) is the known dry friction at rest, `scale` (n,) the effort limits, all > 0.
    `drive_covariance` (2n, 2n) is `EffortCalibration.torque_error_covariance`.
    """
    n = len(scale)
    groups = variance_groups.make_groups(rows, rests, band, scale)
    count = variance_groups.unknown_count(n, rows.gram.shape[1])
    drives = slice(COUNT + 3 * n + 1, COUNT + 5 * n + 1)
    start = np.zeros(count)
    start[drives.start:drives.start + n] = 1.0
    exact = np.concatenate([np.full_like(scale, _EXACT), _EXACT * scale])
    root = inverse_root(np.diag(exact**2) + drive_covariance)
    friction = np.maximum(band, variance_groups.LEAST_NOISE * scale)

    def prior(variances: FloatArray) -> FloatArray:
        at_rest = friction.copy()
        for group, variance in zip(groups, variances):
            if group.kind == 'single' and band[group.joint] == 0.0:
                # from the scatter of its rests
                at_rest[group.joint] = np.sqrt(variance / variance_groups.BAND_VARIANCE)
        W = np.diag(1.0 / np.concatenate([
            np.full(COUNT, PRIOR_DEVIATION), np.tile(FRICTION_ERROR * scale, 2), at_rest,
            [LARGEST_DELAY], np.ones(count - COUNT - 3 * n - 1)]))
        W[drives, drives] = root
        return np.asarray(W)

    def variances(
        theta: FloatArray, squares: FloatArray, free: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        found, freedom = variance_groups.estimated_variances(groups, squares, free, scale)
        return found * variance_groups.rows_per_independent_row(groups, theta), freedom

    first = np.array([
        max(group.prior, (variance_groups.ASSUMED_NOISE * scale[group.joint])**2)
        for group in groups])
    fit = fit_effort([group.rows for group in groups], start, first, prior, variances)
    effort = np.zeros(len(fit.group))
    power, squares = np.zeros((2, n))
    for i, (group, variance) in enumerate(zip(groups, fit.variances)):
        column = group.rows.factor[:, Column.EFFORT]
        effort[fit.group == i] = column / np.sqrt(variance)
        power[group.joint] += column @ column
        squares[group.joint] += group.rows.squares(fit.values)
    covariance = fit.covariance
    A = covariance[:COUNT, drives]
    of_drives = np.einsum('ij,jk,ik->i', A, inverse_of(covariance[drives, drives]), A)
    return Solution(
        fit.values[:COUNT], covariance[:COUNT, :COUNT],
        fit.spread(np.eye(COUNT, count)).interval / NORMAL,
        0.01 * (fit.solution.inverse @ effort)[:COUNT],
        _expected(groups, fit.variances, scale, band,
                  np.diag(covariance)[COUNT + 2 * n:COUNT + 3 * n]),
        np.sqrt(np.divide(squares, power, out=np.full(n, np.nan), where=power > 0.0)),
        of_drives / np.diag(covariance)[:COUNT])


def _expected(
    groups: list[Group], variances: FloatArray, scale: FloatArray, band: FloatArray,
    mean_friction: FloatArray,
) -> dict[str, FloatArray]:
    """
    Return the variances (n,) of further rows by kind, at joints without any from friction.

    `mean_friction` (n,) is the present variance of the mean friction at rest.
    """
    noise, friction = (EXPECTED_NOISE * scale)**2, variance_groups.BAND_VARIANCE * band**2
    expected = {
        'motion': noise + EXPECTED_FRICTION**2 * friction, 'single': noise + friction,
        'paired': noise + variance_groups.PAIRED_FRACTION**2 * friction}
    for group, variance in zip(groups, variances):
        expected[group.kind][group.joint] = variance
    expected['single'] = expected['single'] + mean_friction
    return expected
