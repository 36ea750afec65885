# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Deviations and intervals of estimates whose weights were estimated from few residuals."""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.dependencies import optional

CONFIDENCE = 0.95
NORMAL = 1.959964
"""Half width of the 95 % interval of a normal distribution, in standard deviations."""


def estimated_weights(share: FloatArray, freedom: FloatArray) -> tuple[FloatArray, FloatArray]:
    """
    Return by which factor estimated weights increase deviations, and the factor of intervals.

    `share` (g, c) are the fractions f of c variances due to g groups, whose variances were
    estimated with ν degrees of `freedom` (g,). The weights increase a variance by
    1 + 4 Σ f (1 − f) / ν, and the half width of a 95 % interval is the quantile of Student's t
    with 1 / Σ (f² / ν) degrees of freedom: P. Meier, *Variance of a weighted mean*,
    Biometrics 9(1), 1953. Needs scipy.
    """
    of_group = freedom[:, None]
    factor = np.sqrt(1.0 + 4.0 * (share * (1.0 - share) / of_group).sum(axis=0))
    effective = 1.0 / np.maximum((share**2 / of_group).sum(axis=0), 1e-9)
    quantile = optional('scipy.special', 'an interval of confidence').stdtrit
    return factor, np.asarray(quantile(effective, 0.5 + 0.5 * CONFIDENCE))
