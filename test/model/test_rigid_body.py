# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Properties of the manipulator equation, on random trees and on real robots.

The reference is the engine Drake; `test_engines.py` compares more quantities of real robots.
"""

from functools import cache
from typing import Any

import numpy as np
import numpy.testing as npt
import pytest
from random_trees import Case, case_of, random_case, random_inertial
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics, RigidBody
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.unchecked_rigid_body import UncheckedRigidBody
from robot_dynamics.planar.urdf import default_arm_urdf
from robots import robot_urdf


@pytest.fixture(params=['kinova', 'panda', 'tiago_pro'])
def real(request):
    return case_of(robot_urdf(request.param), np.random.default_rng(7), some_locked=False)


random_tree = cache(random_case)


def directions(case: Case) -> np.ndarray:
    return case.rng.normal(0, 1, (4, case.arm.joint_count))


def slope(function: Any, x: np.ndarray, along: np.ndarray, h: float) -> Any:
    """Return the derivative of a function along a direction, with an error of order h⁴."""
    near = function(x + h * along) - function(x - h * along)
    far = function(x + 2 * h * along) - function(x - 2 * h * along)
    return (8 * near - far) / (12 * h)


# --- properties, each stated once and tested on random trees and real robots ---------------------

def mass_matrix_is_symmetric_and_positive(case):
    M = case.body.mass_matrix(case.q)
    assert M.shape == (case.arm.joint_count,) * 2
    npt.assert_allclose(M, M.T, rtol=0, atol=1e-12 * abs(M).max())
    assert np.linalg.eigvalsh(M)[0] > 0.0


def mass_matrix_is_of_the_kinetic_energy(case):
    mechanics, M = case.mechanics(), case.body.mass_matrix(case.q)
    for v in directions(case):
        expected = mechanics.kinetic_energy(case.q, v)
        assert 0.5 * v @ M @ v == pytest.approx(expected, rel=1e-7)
        assert case.body.kinetic_energy(case.q, v) == pytest.approx(expected, rel=1e-7)


def potential_energy_is_of_the_masses(case):
    """All masses contribute, including those fixed to the base."""
    expected = case.mechanics().potential_energy(case.q)
    ours = (
        case.body.potential_energy(case.q),
        case.body.terms(case.q, case.v, case.a).potential_energy)
    assert ours == pytest.approx(np.full(2, expected), rel=1e-9, abs=1e-9)


def rotors_have_their_share_of_the_kinetic_energy(case):
    """Kinetic energy: that of the links and ½ N² J_r v² per joint of any type and axis."""
    arm, n = case.arm, case.arm.joint_count
    geared = ArmDynamics(arm.with_actuators(make_actuators(
        arm.joint_names, [0.1], case.rng.uniform(-120, 120, n),
        rotor_inertia=case.rng.uniform(1e-6, 1e-4, n))))
    inertia = geared.arm.actuators.reflected_inertia
    for v in directions(case):
        expected = case.mechanics().kinetic_energy(case.q, v) + 0.5 * inertia @ v**2
        ours = (
            geared.rigid_body.kinetic_energy(case.q, v),
            geared.rigid_body.terms(case.q, v, case.a).kinetic_energy)
        assert ours == pytest.approx(np.full(2, expected), rel=1e-7)


def gravity_is_the_slope_of_the_potential_energy(case):
    mechanics, g = case.mechanics(), case.body.gravity(case.q)
    for along in directions(case):
        expected = slope(mechanics.potential_energy, case.q, along, 1e-3)
        assert g @ along == pytest.approx(expected, rel=1e-6, abs=1e-6)


def christoffel_symbols_are_of_the_mass_matrix(case):
    c, n = case.body.christoffel_symbols(case.q), case.arm.joint_count
    assert c.shape == (n, n, n)
    npt.assert_allclose(c, c.transpose(0, 2, 1), rtol=0, atol=1e-13 * max(1.0, abs(c).max()))
    dM = np.stack([slope(case.body.mass_matrix, case.q, e, 1e-3) for e in np.eye(n)], axis=-1)
    # c_ijk = ½ (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_jk/∂q_i), dM[i, j, k] = ∂M_ij/∂q_k
    expected = 0.5 * (dM + dM.transpose(0, 2, 1) - dM.transpose(2, 0, 1))
    npt.assert_allclose(c, expected, rtol=0, atol=1e-8 * max(1.0, abs(c).max()))


def coriolis_matrix_is_of_the_christoffel_symbols(case):
    C = case.body.coriolis_matrix(case.q, case.v)
    c = case.body.christoffel_symbols(case.q)
    scale = max(1.0, abs(C).max())
    npt.assert_allclose(C, np.einsum('ijk,k->ij', c, case.v), rtol=0, atol=1e-12 * scale)
    nonlinear = case.body.nonlinear(case.q, case.v) - case.body.gravity(case.q)
    npt.assert_allclose(
        C @ case.v, nonlinear, rtol=0, atol=1e-11 * max(scale, abs(nonlinear).max(), 100.0))


def forward_dynamics_undoes_inverse_dynamics(case):
    dynamics = ArmDynamics(case.arm)
    for wrenches in ((), case.wrenches()):
        tau = dynamics.inverse_dynamics(case.q, case.v, case.a, wrenches)
        a = dynamics.forward_dynamics(case.q, case.v, tau, wrenches)
        M = case.body.mass_matrix(case.q)
        # The acceleration is as exact as the effort, multiplied by the condition of M.
        npt.assert_allclose(M @ (a - case.a), 0.0, rtol=0, atol=1e-10 * max(1.0, abs(tau).max()))
        npt.assert_allclose(a, case.a, rtol=0, atol=1e-12 * np.linalg.cond(M) * abs(tau).max())


def wrenches_act_on_their_links(case):
    wrenches = case.wrenches()
    expected = case.mechanics().external(case.q, wrenches)
    npt.assert_allclose(
        case.body.external(case.q, wrenches), expected, rtol=0, atol=1e-9 * abs(expected).max())


def terms_add_up(case):
    wrenches = case.wrenches()
    terms = ArmDynamics(case.arm).terms(case.q, case.v, case.a, wrenches)
    total = terms.inertial + terms.coriolis + terms.gravity + terms.friction + terms.external
    npt.assert_allclose(
        total, ArmDynamics(case.arm).inverse_dynamics(case.q, case.v, case.a, wrenches),
        rtol=0, atol=1e-11 * max(1.0, abs(terms.effort).max(), abs(terms.external).max()))
    near = {'rtol': 1e-9, 'atol': 1e-9 * max(1.0, abs(terms.effort).max())}
    M = case.body.mass_matrix(case.q)
    npt.assert_allclose(terms.inertial, M @ case.a, **near)
    npt.assert_allclose(terms.coriolis, case.body.coriolis_matrix(case.q, case.v) @ case.v, **near)
    npt.assert_allclose(terms.gravity, case.body.gravity(case.q), **near)
    npt.assert_array_equal(terms.friction, case.arm.friction.effort(case.v))
    npt.assert_array_equal(terms.external, case.body.external(case.q, wrenches))
    assert terms.kinetic_energy == pytest.approx(
        case.body.kinetic_energy(case.q, case.v), rel=1e-9)


def batch_is_the_single_ones(case):
    dynamics, n = ArmDynamics(case.arm), case.arm.joint_count
    q, v, a = case.rng.normal(0, 2, (3, 5, n))
    expected = np.array([dynamics.inverse_dynamics(*state) for state in zip(q, v, a)])
    npt.assert_allclose(
        dynamics.gravity_batch(q), [dynamics.gravity(row) for row in q], rtol=0,
        atol=1e-11 * max(1.0, abs(expected).max()))
    batch = dynamics.inverse_dynamics_batch(q, v, a)
    npt.assert_allclose(batch, expected, rtol=0, atol=1e-11 * max(1.0, abs(expected).max()))
    assert dynamics.inverse_dynamics_batch(q[:0], v[:0], a[:0]).shape == (0, n)


@pytest.mark.parametrize('samples', [1, 1203])
def test_a_batch_of_any_size_is_the_single_ones(samples):
    body = UncheckedRigidBody(load_arm(default_arm_urdf()))
    q, v, a = np.random.default_rng(samples).normal(0, 2, (3, samples, 2))
    # as computed by a Pinocchio without OpenMP
    one_by_one = body._rnea_one_by_one(q, v, a)
    assert one_by_one.shape == (samples, 2)
    npt.assert_array_equal(one_by_one[-1], body.inverse_dynamics(q[-1], v[-1], a[-1]))
    npt.assert_allclose(body.inverse_dynamics_batch(q, v, a), one_by_one, rtol=0, atol=1e-11)


def order_of_joints_is_the_order_of_everything(case):
    p = case.rng.permutation(case.arm.joint_count)
    arm = load_arm(case.urdf, [case.arm.joint_names[i] for i in p])
    assert arm.locked_joints == case.arm.locked_joints
    q, v, a, wrenches = case.q, case.v, case.a, case.wrenches()
    ours, other = ArmDynamics(case.arm), ArmDynamics(arm)
    close = {'rtol': 1e-10, 'atol': 1e-9}
    npt.assert_allclose(
        other.inverse_dynamics(q[p], v[p], a[p], wrenches),
        ours.inverse_dynamics(q, v, a, wrenches)[p], **close)
    npt.assert_allclose(
        other.rigid_body.mass_matrix(q[p]), case.body.mass_matrix(q)[np.ix_(p, p)], **close)
    npt.assert_allclose(
        other.rigid_body.christoffel_symbols(q[p]),
        case.body.christoffel_symbols(q)[np.ix_(p, p, p)], **close)
    for name in ('lower', 'upper', 'velocity', 'effort'):
        npt.assert_array_equal(getattr(arm.limits, name), getattr(case.arm.limits, name)[p])
    npt.assert_array_equal(arm.friction.viscous, case.arm.friction.viscous[p])
    npt.assert_array_equal(arm.friction.coulomb, case.arm.friction.coulomb[p])
    assert arm.joint_kinds == tuple(case.arm.joint_kinds[i] for i in p)


LAWS = (
    mass_matrix_is_symmetric_and_positive,
    mass_matrix_is_of_the_kinetic_energy,
    rotors_have_their_share_of_the_kinetic_energy,
    potential_energy_is_of_the_masses,
    gravity_is_the_slope_of_the_potential_energy,
    christoffel_symbols_are_of_the_mass_matrix,
    coriolis_matrix_is_of_the_christoffel_symbols,
    forward_dynamics_undoes_inverse_dynamics,
    wrenches_act_on_their_links,
    terms_add_up,
    batch_is_the_single_ones,
    order_of_joints_is_the_order_of_everything,
)


@pytest.mark.parametrize('law', LAWS, ids=lambda law: law.__name__)
def test_law_on_random_trees(law):
    for seed in range(30):  # trees of every kind of joint, mimic relation and lock
        law(random_tree(seed)._replace(rng=np.random.default_rng(seed)))


@pytest.mark.parametrize('law', LAWS, ids=lambda law: law.__name__)
def test_law_on_real_robots(law, real):
    law(real)


# --- single cases --------------------------------------------------------------------------------

def test_continuous_joints_turn_round_and_round():
    case = case_of(robot_urdf('kinova'), np.random.default_rng(1), some_locked=False)
    turns = np.array([2 * np.pi if kind == 'continuous' else 0.0 for kind in case.arm.joint_kinds])
    assert turns.any()
    npt.assert_allclose(
        case.body.inverse_dynamics(case.q + 3 * turns, case.v, case.a),
        case.body.inverse_dynamics(case.q, case.v, case.a), rtol=0, atol=1e-10)


def test_results_are_new_and_inputs_are_left_alone():
    case = random_case(5)
    body, q, v, a, wrenches = case.body, case.q, case.v, case.a, case.wrenches()
    before = [array.copy() for array in (q, v, a)]
    functions = (
        body.gravity, body.mass_matrix, body.christoffel_symbols,
        lambda q: body.nonlinear(q, v), lambda q: body.coriolis_matrix(q, v),
        lambda q: body.external(q, wrenches),
        lambda q: body.inverse_dynamics(q, v, a, wrenches),
        lambda q: body.forward_dynamics(q, v, a, wrenches))
    for function in functions:
        first = function(q)
        kept = first.copy()
        function(q + 1.0)
        npt.assert_array_equal(first, kept)
    for array, copy in zip((q, v, a), before):
        npt.assert_array_equal(array, copy)


def test_a_wrench_at_an_unknown_link_is_refused():
    case = random_case(13)
    wrench = ExternalWrench('gripper', np.zeros(3), np.zeros(3))
    with pytest.raises(InvalidInputError, match="frame_id is 'gripper', expected .*'link0'"):
        case.body.inverse_dynamics(case.q, case.v, case.a, [wrench])


@pytest.mark.parametrize('joints', [('b', 'a'), ('b',)])
def test_forward_dynamics_of_a_joint_that_moves_no_mass_is_refused(joints):
    urdf = (
        '<robot name="light"><link name="base"/>'
        f'<link name="arm">{random_inertial(np.random.default_rng(0))}</link><link name="tip"/>'
        '<joint name="a" type="continuous"><parent link="base"/><child link="arm"/></joint>'
        '<joint name="b" type="continuous"><parent link="arm"/><child link="tip"/></joint>'
        '</robot>')
    body = RigidBody(load_arm(urdf, joints))
    x = np.ones(body.arm.joint_count)
    assert np.isfinite(body.inverse_dynamics(x, x, x)).all()
    with pytest.raises(InvalidInputError, match='mass matrix is singular, expected every joint'):
        body.forward_dynamics(x, x, x)
