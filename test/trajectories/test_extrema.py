# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Extrema of polynomials on [0, 1]: they bound all samples and are attained."""

from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.trajectories.extrema import derivative, extrema

laws = settings(max_examples=100)
DENSE = np.linspace(0.0, 1.0, 2001)

coefficients = st.one_of(
    st.floats(-10.0, 10.0), st.sampled_from([0.0, 1.0, -1.0, 1e-9, -1e-9, 1e-300, 5e-324, 1e9]))
polynomials = st.integers(1, 6).flatmap(
    lambda m: arrays(np.float64, (m, 1), elements=coefficients))


def evaluated(c: FloatArray, s: FloatArray) -> FloatArray:
    """Return the values (k, n) of polynomials c (m, n) at phases (k,)."""
    values: FloatArray = np.vander(s, len(c), increasing=True) @ c
    return values


def assert_exact(c: FloatArray) -> None:
    found, scale = extrema(c), np.abs(c).sum(axis=0)
    samples, rounding = evaluated(c, DENSE), 1e-14 * scale
    assert ((found.phases >= 0.0) & (found.phases <= 1.0)).all()
    assert (samples.min(axis=0) >= found.values[0] - rounding).all()
    assert (samples.max(axis=0) <= found.values[1] + rounding).all()
    for phases, values in zip(found.phases, found.values):
        attained = np.diagonal(evaluated(c, phases))
        assert (np.abs(attained - values) <= rounding).all()


@laws
@given(polynomials)
def test_extrema_bound_the_polynomial_and_are_attained(c):
    assert_exact(c)


@pytest.mark.parametrize('c', [
    [0.0] * 6, [3.0] + [0.0] * 5, [0.0, 1.0] + [0.0] * 4, [1.0, -4.0, 4.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 1.0, 0.0, 0.0], [0.0, 1.0, -3.0, 3.0, -1.0, 1e-300],
    [-1.0 / 32.0, 5.0 / 16.0, -5.0 / 4.0, 5.0 / 2.0, -5.0 / 2.0, 1.0],  # (s − 1/2)⁵
    [1.0 / 16.0, -0.5, 1.5, -2.0, 1.0, 1e-16],  # (s − 1/2)⁴
    [0.0, 0.0, 0.0, 10.0, -15.0, 6.0], [1e9, 1e-6, -1e-6, 0.0, 0.0, 0.0],
])
def test_degenerate_polynomials(c):
    assert_exact(np.array(c)[:, np.newaxis])


@pytest.mark.parametrize('size', [5e-324, 1e-200, 1e200, 1.7e308])
def test_coefficients_of_any_size_give_numbers(size):
    signs = np.random.default_rng(2).choice([-1.0, 0.0, 1.0], (200, 6, 1))
    with np.errstate(all='raise', under='ignore'):
        found = extrema(size * signs)
    assert ((found.phases >= 0.0) & (found.phases <= 1.0)).all()
    assert not np.isnan(found.values).any()


def test_the_derivative_is_the_slope():
    c = np.random.default_rng(3).standard_normal((6, 4))
    step = 1e-6
    slope = (evaluated(c, DENSE + step) - evaluated(c, DENSE - step)) / (2.0 * step)
    assert evaluated(derivative(c), DENSE) == pytest.approx(slope, abs=1e-7)
