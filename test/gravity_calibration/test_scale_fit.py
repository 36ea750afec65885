# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Least squares with parameters that have no effect: their columns are rounding errors."""

import numpy as np
import pytest
from robot_dynamics.gravity_calibration.scale_fit import fit_scales, linear_fit, Observations

ROUNDING = pytest.mark.parametrize('rounding', [0.0, 1e-17, -3e-16])


@ROUNDING
def test_a_parameter_without_effect_is_not_determined(rounding):
    A = np.array([[1.0, rounding, 0.5], [0.2, -rounding, 1.0], [0.3, rounding, 0.0]])
    x = np.array([1.5, 0.0, -0.7])
    G, is_lost = linear_fit(A, np.diag([1.0, 1e-3, 1e-12]))
    assert is_lost.tolist() == [False, True, False]
    np.testing.assert_allclose(G @ (A @ x), x, rtol=0.0, atol=1e-9)


@ROUNDING
def test_gravity_parameters_without_effect_leave_the_scales_exact(rounding):
    rng = np.random.default_rng(3)
    known, column = rng.uniform(-20.0, 20.0, (2, 12, 2))
    s, o, beta = np.array([0.8, 1.2]), np.array([1.0, -2.0]), 0.7
    columns = np.stack([column, rounding * rng.uniform(-1.0, 1.0, (12, 2))], axis=-1)
    effort = (known + column * beta) / s + o
    fit = fit_scales(
        Observations(effort, known, columns, np.ones((12, 2), dtype=np.bool_)), np.full(2, np.nan))
    assert fit.is_lost.tolist() == [False, False, False, False, False, True]
    np.testing.assert_allclose(
        [*fit.inverse, *fit.offset, *fit.beta], [*(1.0 / s), *o, beta, 0.0], rtol=0.0, atol=1e-9)
