# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The two-link arm in closed form: the worked example, the properties, and common errors."""

import ast
import dataclasses
import math
from pathlib import Path
import re

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import numpy.testing as npt
from planar_chains import A, ARM, assert_close, first_derivative, PRINTED, Q, V
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.planar import two_link as planar
from robot_dynamics.planar.two_link import PlanarTwoLink

PROJECT = Path(__file__).resolve().parents[2]
PAGE = PROJECT / 'docs' / 'planar_arm.md'



def pairs(limit):
    number = st.floats(-limit, limit)
    return st.tuples(number, number).map(np.array)


@st.composite
def arms(draw):
    positive, part = st.floats(0.05, 20.0), st.floats(0.0, 1.0)
    l1, l2 = draw(st.floats(0.1, 3.0)), draw(st.floats(0.1, 3.0))
    return PlanarTwoLink(
        draw(positive), draw(positive), l1, l2, l1 * draw(part), l2 * draw(part),
        draw(st.floats(0.001, 2.0)), draw(st.floats(0.001, 2.0)), draw(st.floats(0.0, 30.0)))


states = {'arm': arms(), 'q': pairs(7.0), 'v': pairs(5.0), 'a': pairs(20.0)}
law = settings(deadline=None, derandomize=True, max_examples=50)


def partial_derivatives(function, q, step=1e-5):
    """Return the central differences along each coordinate, on the last axis."""
    columns = []
    for unit in np.eye(len(q)):
        ahead, behind = function(q + step * unit), function(q - step * unit)
        columns.append((np.asarray(ahead) - np.asarray(behind)) / (2.0 * step))
    return np.stack(columns, axis=-1)


def mass_scale(arm):
    return arm.I1 + arm.I2 + arm.m1 * arm.l1**2 + arm.m2 * (arm.l1 + arm.l2)**2


def weight_scale(arm):
    return arm.g * (arm.m1 * arm.l1 + arm.m2 * (arm.l1 + arm.l2))


# --- the worked example -----------------------------------------------------------------------

def test_worked_example_has_the_published_numbers():
    assert_close(
        planar.mass_matrix(ARM, Q), [[6.95846097, 1.56923048], [1.56923048, 0.53]], atol=PRINTED)
    assert_close(planar.coriolis_vector(ARM, Q, V), [-0.234, 0.15], atol=1e-15)
    assert_close(planar.gravity_vector(ARM, Q), [-49.52282521, -11.37087883], atol=PRINTED)
    assert_close(planar.inverse_dynamics(ARM, Q, V, A), [-48.74713301, -10.95795578], atol=PRINTED)


def test_page_names_only_tests_that_exist():
    named = set(re.findall(r'`(test_\w+)`', PAGE.read_text(encoding='utf-8')))
    defined = set()
    for path in Path(__file__).parent.glob('*.py'):
        tree = ast.parse(path.read_text(encoding='utf-8'))
        defined |= {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    assert len(named) >= 10
    assert named <= defined, f'not found: {sorted(named - defined)}'


# --- properties -------------------------------------------------------------------------------

@law
@given(**states)
def test_power_of_the_torques_is_the_rate_of_the_energy(arm, q, v, a):
    def total_energy(t):
        return planar.energies(arm, q + t * v + 0.5 * t**2 * a, v + t * a).total

    power = planar.inverse_dynamics(arm, q, v, a) @ v
    assert_close(
        first_derivative(total_energy), power,
        atol=1e-7 * (1.0 + mass_scale(arm) + weight_scale(arm)))


@law
@given(**states)
def test_forward_dynamics_inverts_inverse_dynamics(arm, q, v, a):
    tau = planar.inverse_dynamics(arm, q, v, a)
    M = planar.mass_matrix(arm, q)
    found = planar.forward_dynamics(arm, q, v, tau)
    torque_scale = mass_scale(arm) * (1.0 + np.abs(a).max() + v @ v) + weight_scale(arm)
    assert_close(found, a, atol=1e-13 * torque_scale * np.linalg.norm(np.linalg.inv(M)))


# --- common errors: a test for each row of the table in docs/planar_arm.md --------------------

def test_correction_mass_matrix_has_the_term_of_link_1():
    short = ARM.I1 + ARM.I2 + ARM.m2 * (
        ARM.l1**2 + ARM.r2**2 + 2.0 * ARM.l1 * ARM.r2 * math.cos(Q[1]))
    M11 = planar.mass_matrix(ARM, Q)[0, 0]
    assert M11 - short == pytest.approx(ARM.m1 * ARM.r1**2, rel=1e-13)
    # Link 1 with a negligible mass behind it is a compound pendulum: I_1 + m_1 r_1².
    alone = dataclasses.replace(ARM, m2=1e-12, I2=1e-12)
    assert planar.mass_matrix(alone, Q)[0, 0] == pytest.approx(0.1 + 5.0 * 0.5**2, rel=1e-10)


def test_correction_example_torque_and_energy():
    tau = planar.inverse_dynamics(ARM, Q, V, A)
    energies = planar.energies(ARM, Q, V)
    assert tau[0] == pytest.approx(-48.74713301, abs=PRINTED)
    assert energies.kinetic == pytest.approx(1.12904219, abs=PRINTED)
    assert energies.potential == pytest.approx(41.19876418, abs=PRINTED)
    assert energies.total == energies.kinetic + energies.potential
    # The wrong numbers are those without m_1 r_1² in M_11, in all decimals.
    missing = ARM.m1 * ARM.r1**2
    assert tau[0] - missing * A[0] == pytest.approx(-48.872, abs=5e-4)
    assert energies.kinetic - 0.5 * missing * V[0]**2 == pytest.approx(0.973, abs=5e-4)
    assert abs(tau[0] + 48.872) > 0.12
    assert abs(energies.kinetic - 0.973) > 0.15


def test_correction_zero_is_upright():
    heights = [planar.potential_energy(ARM, (angle, 0.0)) for angle in np.linspace(-3.1, 3.1, 63)]
    assert np.argmax(heights) == 31  # the middle position, q_1 = 0
    assert planar.forward_kinematics(ARM, (0.0, 0.0)).tip[1] == ARM.l1 + ARM.l2
    # A horizontal link would need the largest holding torque; at q = 0 none is needed.
    npt.assert_array_equal(planar.gravity_vector(ARM, (0.0, 0.0)), [0.0, 0.0])
    most = abs(planar.gravity_vector(ARM, (math.pi / 2, 0.0))[0])
    assert most == pytest.approx(9.81 * (5.0 * 0.5 + 3.0 * 1.4), rel=1e-14)


def test_correction_gravity_acts_at_joint_1_even_with_link_1_upright():
    g = planar.gravity_vector(ARM, (0.0, math.pi / 2))
    expected = -3.0 * 0.4 * 9.81
    npt.assert_allclose(g, [expected, expected], rtol=1e-14)


def test_correction_link_2_pulls_at_the_elbow():
    light = dataclasses.replace(ARM, m1=1e-12, I1=1e-12)
    assert planar.gravity_vector(light, (math.pi / 2, 0.0))[0] == pytest.approx(
        -9.81 * 3.0 * (1.0 + 0.4), rel=1e-10)


def test_correction_gravity_is_largest_elsewhere():
    largest = max(np.linspace(0.0, math.pi, 3142), key=lambda angle: abs(
        planar.gravity_vector(ARM, (angle, math.pi / 2))[0]))
    assert largest == pytest.approx(1.356, abs=2e-3)


def test_correction_upright_is_unstable():
    tilt = np.array([1e-3, 0.0])
    falling = planar.forward_dynamics(ARM, tilt, (0.0, 0.0), (0.0, 0.0))
    assert falling[0] > 0.0  # away from upright: no restoring torque
    stiffness = partial_derivatives(lambda x: planar.gravity_vector(ARM, x), np.zeros(2))
    assert np.linalg.eigvalsh(stiffness).max() < 0.0
    hanging = np.array([math.pi, 0.0])
    stiffness = partial_derivatives(lambda x: planar.gravity_vector(ARM, x), hanging)
    assert np.linalg.eigvalsh(stiffness).min() > 0.0


def test_correction_gravity_vector_is_what_the_motors_deliver():
    g = planar.gravity_vector(ARM, Q)
    npt.assert_array_equal(planar.inverse_dynamics(ARM, Q, (0.0, 0.0), (0.0, 0.0)), g)
    assert_close(planar.forward_dynamics(ARM, Q, (0.0, 0.0), g), 0.0, atol=1e-13)
    # With g interpreted as the weight's torque and compensated with -g, the fall would double.
    free = planar.forward_dynamics(ARM, Q, (0.0, 0.0), (0.0, 0.0))
    npt.assert_allclose(planar.forward_dynamics(ARM, Q, (0.0, 0.0), -g), 2.0 * free, rtol=1e-13)


def test_correction_eight_christoffel_symbols():
    h = 3.0 * 1.0 * 0.4 * 0.5
    c = planar.christoffel_symbols(ARM, Q)
    npt.assert_allclose(c[0], [[0.0, -h], [-h, -h]], rtol=1e-14)
    npt.assert_allclose(c[1], [[h, 0.0], [0.0, 0.0]], rtol=1e-14)
    # With only the four symbols of the first row, joint 2 would be independent of joint 1's speed.
    four = np.stack([c[0], np.zeros((2, 2))])
    assert np.einsum('ijk,j,k->i', four, V, V)[1] == 0.0
    assert planar.coriolis_vector(ARM, Q, V)[1] == pytest.approx(0.15, abs=1e-15)
    # Nor would C be the matrix for which dM/dt - 2C is skew.
    rate = partial_derivatives(lambda x: planar.mass_matrix(ARM, x), Q) @ V
    S = rate - 2.0 * four @ V
    assert np.abs(S + S.T).max() > 0.1


def test_correction_coriolis_is_a_matrix_times_the_velocity():
    C = planar.coriolis_matrix(ARM, Q, V)
    assert C.shape == (2, 2)
    assert_close(C, [[-0.18, -0.48], [0.3, 0.0]], atol=1e-15)
    assert_close(C @ V, [-0.234, 0.15], atol=1e-15)


def test_correction_coriolis_does_not_brake():
    mirrored = Q * (1.0, -1.0)
    npt.assert_allclose(
        planar.coriolis_vector(ARM, mirrored, V), -planar.coriolis_vector(ARM, Q, V), rtol=1e-14)
    # Its power is half of v·(dM/dt)v, of either sign: it transfers and does not dissipate energy.
    powers = [planar.coriolis_vector(ARM, q, V) @ V for q in (Q, mirrored)]
    assert min(powers) < 0.0 < max(powers)
    for q, power in zip((Q, mirrored), powers):
        rate = partial_derivatives(lambda x: planar.mass_matrix(ARM, x), q) @ V
        assert power == pytest.approx(0.5 * V @ rate @ V, abs=1e-9)


def test_correction_coupling_inertia_can_be_the_smallest_entry():
    M = planar.mass_matrix(ARM, (0.0, math.pi))
    assert M[0, 1] == pytest.approx(0.05 + 3.0 * 0.4 * (0.4 - 1.0), rel=1e-14)
    assert M[0, 1] < 0.0 < M[1, 1]
    # And M_11 is not always the largest: here the mass of the folded arm is near joint 1.
    folded = PlanarTwoLink(m1=0.1, m2=3.0, l1=0.5, l2=1.0, r1=0.25, r2=0.5, I1=0.01, I2=0.05)
    M = planar.mass_matrix(folded, (0.0, math.pi))
    assert M[0, 0] < M[1, 1]


# --- input ------------------------------------------------------------------------------------

@pytest.mark.parametrize(('field', 'value', 'message'), [
    ('m1', 0.0, 'm1 is 0, expected a number > 0'),
    ('l2', math.inf, 'l2 is inf, expected a number > 0'),
    ('r1', 1.5, 'r1 is 1.5, expected a number in [0, 1]'),


    ('g', -9.81, 'g is -9.81, expected a number >= 0'),

])
def test_parameters_out_of_range_are_named(field, value, message):
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        PlanarTwoLink(**{field: value})


@pytest.mark.parametrize(('call', 'message'), [
    (lambda: planar.mass_matrix(ARM, (1.0, 2.0, 3.0)),
     "q has 3 values, expected 2, one for each of ['joint1', 'joint2']"),
    (lambda: planar.coriolis_matrix(ARM, Q, (0.0, math.nan)), 'v[1] (joint2) is nan'),
    (lambda: planar.forward_dynamics(ARM, Q, V, (math.inf, 0.0)), 'tau[0] (joint1) is inf'),
])
def test_states_of_another_shape_are_named(call, message):
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        call()
