# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Base parameters of bodies and rotors; information of recordings by QR, merged and in blocks.

Pseudo-inertias: consistency, coordinates that preserve it, and divergence from a prior.
"""

import numpy as np
import pinocchio as pin
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.regressor import (
    LoadRegressor,
    parameter_names,
    random_states,
    TorqueRegressor,
)
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.base_parameters import find_base_parameters
from robot_dynamics_tools.identification.friction_regressor import JointExcitation
from robot_dynamics_tools.identification.pipeline import base_parameters_of
from robot_dynamics_tools.identification.qr_information import merge, reduce_rows
from robot_dynamics_tools.pseudo_inertia import (
    divergence_residuals,
    from_coordinates,
    is_consistent,
    jacobian,
    parameters_of,
    pseudo_inertia_matrix,
    relative_rows,
)
from robots import robot_urdf

# --- base parameters -----------------------------------------------------------------------------


def test_dependent_columns_are_regrouped():
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(2, 50))
    base = find_base_parameters(
        np.column_stack([a, np.zeros(50), 2.0 * a, b, a - 3.0 * b]), ['p', 'q', 'r', 's', 't'])
    assert base.rank == 2
    assert base.expressions == ('p + 2·r + t', 's - 3·t')
    assert base.labels == ('p*', 's*')


def test_base_parameters_of_a_real_arm():
    # 36 of a 6R arm with a vertical first axis, 40 with the rotors of joints 3 to 6
    arm = load_arm(robot_urdf('ur10'))
    base = base_parameters_of(arm)
    assert base.rank == 40
    q, v, a = random_states(arm, 30, seed=1)
    Y = TorqueRegressor(arm)(q, v, a)
    n = arm.joint_count
    rotors = a[:, :, np.newaxis] * np.eye(n)
    X = np.concatenate([Y, rotors], axis=2).reshape(30 * n, -1)
    phi = np.random.default_rng(0).normal(size=X.shape[1])
    assert X[:, base.columns] @ (base.matrix @ phi) == pytest.approx(X @ phi, abs=1e-6)


def test_base_parameters_of_two_links_by_hand():
    arm = load_arm(default_arm_urdf())
    base = base_parameters_of(arm)
    assert base.labels[-1] == 'Ia(joint2)'
    assert parameter_names(arm)[:2] == ('m(link1)', 'mx(link1)')
    assert not LoadRegressor(arm, 'base_link')(*random_states(arm, 2)).any()
    by_name = dict(zip(base.labels, base.expressions))
    # the length l1 = 1 of the first link carries the mass of the second: Huygens–Steiner
    assert by_name['mz(link1)*'] == 'mz(link1) + m(link2)'
    assert by_name['Iyy(link1)*'] == 'Iyy(link1) + m(link2) + Ia(joint1)'


# --- information ---------------------------------------------------------------------------------

def some_rows(seed, m=400, n=3, p=5):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(m, n, p)), rng.normal(size=(m, n))


def reduced(X, y):
    n, p = X.shape[1:]
    return reduce_rows(
        [f'j{i}' for i in range(n)], [f'c{i}' for i in range(p)], X, y, 6, np.full(n, 4.0),
        JointExcitation(np.zeros((n, 3, 3)), np.zeros(n), np.abs(y).max(axis=0, initial=0.0)))


def squares(factors, theta):
    return np.array([float(np.sum((R @ np.append(theta, -1.0))**2)) for R in factors])


def test_merged_factors_hold_what_all_samples_hold():
    parts = [some_rows(seed, m) for seed, m in ((0, 400), (1, 300), (2, 777))]
    both = merge([reduced(*part) for part in parts])
    X, y = np.concatenate([X for X, _ in parts]), np.concatenate([y for _, y in parts])
    assert both.rows.sum() == len(y)
    assert both.samples_per_independent_sample == pytest.approx(np.full(3, 4.0))
    for seed in range(3):
        theta = np.random.default_rng(seed).normal(size=5)
        expected = np.sum((X @ theta - y)**2, axis=0)
        assert squares(both.together(), theta) == pytest.approx(expected, rel=1e-12)
    swapped = merge([reduced(*part) for part in parts[::-1]])
    grams = [np.swapaxes(each.factors, -1, -2) @ each.factors for each in (both, swapped)]
    assert grams[0] == pytest.approx(grams[1], rel=1e-10, abs=1e-9)


def test_a_block_left_out_shares_no_sample_and_no_neighbour_with_the_others():
    X, y = some_rows(3)
    information = reduced(X, y)
    theta = np.ones(5)
    r2 = (X @ theta - y)**2
    edges = np.concatenate([[0], np.cumsum(information.rows).astype(int)])
    assert edges[-1] == len(y)
    assert len(information.rows) == 12  # six blocks, and a gap behind each
    for block in range(6):
        first, last = edges[2 * block], edges[2 * block + 1]
        assert squares(information.block(block), theta) == pytest.approx(
            r2[first:last].sum(axis=0), rel=1e-10)
        left = edges[max(2 * block - 1, 0)]
        right = edges[min(2 * block + 2, len(edges) - 1)]
        assert squares(information.all_but(block), theta) == pytest.approx(
            r2.sum(axis=0) - r2[left:right].sum(axis=0), rel=1e-10)


def test_mismatched_inputs_are_rejected():
    with pytest.raises(InvalidInputError, match='there is no recording to combine'):
        merge([])
    with pytest.raises(InvalidInputError, match='cannot be combined, expected the same joints'):
        merge([reduced(*some_rows(0)), reduced(*some_rows(0, n=2))])
    with pytest.raises(InvalidInputError, match='has no samples for training'):
        reduced(*some_rows(0, m=0))
    with pytest.raises(InvalidInputError, match='have 40 samples .* expected at least 42'):
        merge([reduced(*some_rows(seed, m=20)) for seed in range(2)])


def test_blocks_of_short_recordings_share_the_folds():
    parts = [some_rows(seed, m) for seed, m in enumerate([30, 30, 20, 45, 60])]
    both = merge([reduced(*part) for part in parts])
    assert both.folds == (0, 1, 2, 3, 4, 5)
    assert both.rows.sum() == both.recorded == 185
    theta = np.ones(5)
    r2 = [(X @ theta - y)**2 for X, y in parts]
    # recordings 0 and 1 have two blocks each, recording 2 one: its fold is number 4
    everything = sum(each.sum(axis=0) for each in r2)
    without = squares(both.all_but(4), theta)
    assert (without < everything - 0.999 * r2[2].sum(axis=0)).all()
    inside = squares(both.block(4), theta)
    assert (inside > 0.999 * r2[2].sum(axis=0)).all()
    # a recording of three blocks, and one of four, begin in fold 5 and continue in fold 0
    assert both.rows[11] > 0.0


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
