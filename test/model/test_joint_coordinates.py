# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The map from actuated joints to the joints of the tree, on random maps."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import numpy.testing as npt
import pytest
from robot_dynamics.model.arm import JointCoordinates

laws = settings(deadline=None, derandomize=True, max_examples=50)


@st.composite
def random_maps(draw):
    n = draw(st.integers(1, 5))
    m = draw(st.integers(n, 8))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return JointCoordinates(rng.normal(0, 1, (m, n)), rng.normal(0, 1, m)), rng


@laws
@given(case=random_maps())
def test_position_is_affine_and_rate_is_its_derivative(case):
    x, rng = case
    n = x.G.shape[1]
    q, v = rng.normal(0, 1, (2, n))
    npt.assert_allclose(x.position(np.zeros(n)), x.q0)
    npt.assert_allclose(x.position(q + v) - x.position(q), x.rate(v), rtol=0, atol=1e-13)
    npt.assert_allclose(x.rate(v), [row @ v for row in x.G], rtol=0, atol=1e-13)


@laws
@given(case=random_maps())
def test_power_is_the_same_on_both_sides(case):
    x, rng = case
    m, n = x.G.shape
    v, tau_tree = rng.normal(0, 1, n), rng.normal(0, 1, m)
    assert x.effort(tau_tree) @ v == pytest.approx(tau_tree @ x.rate(v), abs=1e-12)


@laws
@given(case=random_maps())
def test_a_form_has_the_same_value_on_both_sides(case):
    x, rng = case
    m, n = x.G.shape
    A, u, v = rng.normal(0, 1, (m, m)), *rng.normal(0, 1, (2, n))
    assert u @ x.form(A) @ v == pytest.approx(x.rate(u) @ A @ x.rate(v), abs=1e-11)


@laws
@given(case=random_maps(), samples=st.integers(0, 4))
def test_many_samples_are_the_single_ones(case, samples):
    x, rng = case
    m, n = x.G.shape
    q, tau = rng.normal(0, 1, (samples, n)), rng.normal(0, 1, (samples, m))
    for batch, single, rows, width in (
        (x.position(q), x.position, q, m), (x.rate(q), x.rate, q, m),
        (x.effort(tau), x.effort, tau, n),
    ):
        assert batch.shape == (samples, width)
        for row, result in zip(rows, batch):
            npt.assert_allclose(result, single(row), rtol=0, atol=1e-13)


@pytest.mark.parametrize(('G', 'q0', 'identity', 'permutation'), [
    (np.eye(3), (0, 0, 0), True, True),
    (np.eye(3)[[2, 0, 1]], (0, 0, 0), False, True),
    (np.eye(3), (0, 0.5, 0), False, True),
    (np.eye(3)[:, :2], (0, 0, 0), False, False),
    (np.diag([1.0, -1.0, 1.0]), (0, 0, 0), False, False),
    (np.diag([1.0, 2.0, 1.0]), (0, 0, 0), False, False),
    (np.array([[1.0, 0.0], [1.0, 0.0]]), (0, 0), False, False),
    (np.array([[0.6, 0.8], [-0.8, 0.6]]), (0, 0), False, False),
])
def test_identity_and_permutation_are_recognized(G, q0, identity, permutation):
    x = JointCoordinates(G, np.array(q0, dtype=float))
    assert (x.is_identity, x.is_permutation) == (identity, permutation)
