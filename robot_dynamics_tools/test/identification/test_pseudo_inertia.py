# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Pseudo-inertias: consistency, coordinates that preserve it, and divergence from a prior."""

import numpy as np
import pinocchio as pin
import pytest
from robot_dynamics_tools.pseudo_inertia import (
    divergence_residuals,
    from_coordinates,
    is_consistent,
    jacobian,
    parameters_of,
    pseudo_inertia_matrix,
    relative_rows,
)


def some_body(seed):
    """Return φ of some point masses: a real mass distribution."""
    rng = np.random.default_rng(seed)
    body = pin.Inertia.Zero()
    for _ in range(6):
        body += pin.Inertia(rng.uniform(0.1, 1.0), rng.normal(size=3), np.zeros((3, 3)))
    return body.toDynamicParameters()


@pytest.mark.parametrize('seed', range(2))
def test_a_mass_distribution_is_consistent_and_comes_back(seed):
    phi = some_body(seed)
    assert is_consistent(phi)
    for change in (np.eye(10)[0] * -2.0 * phi[0], np.eye(10)[4] * 100.0):
        assert not is_consistent(phi + change)  # negative mass; a moment above the others' sum
    assert parameters_of(pseudo_inertia_matrix(phi)) == pytest.approx(phi, rel=1e-12)


@pytest.mark.parametrize('seed', range(2))
def test_coordinates_reach_consistent_bodies_alone(seed):
    L0 = np.linalg.cholesky(pseudo_inertia_matrix(some_body(seed)))
    rng = np.random.default_rng(seed)
    assert from_coordinates(L0, np.zeros(10)) == pytest.approx(some_body(seed), rel=1e-10)
    for _ in range(50):
        assert is_consistent(from_coordinates(L0, rng.normal(scale=1.5, size=10)))


def test_the_jacobian_against_differences():
    L0 = np.linalg.cholesky(pseudo_inertia_matrix(some_body(3)))
    x = np.random.default_rng(3).normal(scale=0.3, size=10)
    step = 1e-6
    differences = np.array([
        (from_coordinates(L0, x + step * e) - from_coordinates(L0, x - step * e)) / (2.0 * step)
        for e in np.eye(10)]).T
    assert jacobian(L0, x) == pytest.approx(differences, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize('size', [0.0, 1e-7, 1e-3, 0.5, 2.0])
def test_the_residuals_are_the_entropic_divergence(size):
    P0 = pseudo_inertia_matrix(some_body(4))
    L0 = np.linalg.cholesky(P0)
    x = size * np.random.default_rng(4).normal(size=10)
    ratio = np.linalg.solve(P0, pseudo_inertia_matrix(from_coordinates(L0, x)))
    divergence = np.trace(ratio) - np.log(np.linalg.det(ratio)) - 4.0
    r, slope = divergence_residuals(x)
    assert r @ r == pytest.approx(divergence, rel=1e-6, abs=1e-12)
    step = 1e-7
    differences = (divergence_residuals(x + step)[0] - divergence_residuals(x - step)[0]) / (
        2.0 * step)
    assert slope == pytest.approx(differences, rel=1e-4, abs=1e-4)


def test_near_the_prior_the_rows_measure_twice_the_divergence_in_any_frame():
    phi = some_body(5)
    L0 = np.linalg.cholesky(pseudo_inertia_matrix(phi))
    x = 1e-4 * np.random.default_rng(5).normal(size=10)
    near = from_coordinates(L0, x)
    distance = float(np.sum((relative_rows(L0) @ (near - phi))**2))
    r, _ = divergence_residuals(x)
    assert distance == pytest.approx(2.0 * float(r @ r), rel=1e-3)
    # in another frame, it is the same
    move = pin.SE3.Random()

    def moved(parameters):
        return move.act(pin.Inertia.FromDynamicParameters(parameters)).toDynamicParameters()

    M0 = np.linalg.cholesky(pseudo_inertia_matrix(moved(phi)))
    assert float(np.sum((relative_rows(M0) @ (moved(near) - moved(phi)))**2)) == pytest.approx(
        distance, rel=1e-4)
