# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The Newton-Euler recursion: its properties, the closed form, and incorrect recursions."""

import dataclasses
import math
import re

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import numpy.testing as npt
from planar_chains import A, ARM, assert_close, PRINTED, Q, V
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.planar import chain as planar_chain
from robot_dynamics.planar import two_link as planar
from robot_dynamics.planar.chain import newton_euler, PlanarChain
from robot_dynamics.planar.two_link import PlanarTwoLink

CHAIN = PlanarChain.from_two_link(ARM)
EXAMPLE = np.array([-48.74713301, -10.95795578])

law = settings(deadline=None, derandomize=True, max_examples=50)


def vectors(count, limit):
    return st.lists(st.floats(-limit, limit), min_size=count, max_size=count).map(np.array)


@st.composite
def motions(draw, least=1, most=8):
    """Draw a chain and a state q, v, a of it."""
    n = draw(st.integers(least, most))

    def numbers(low, high):
        return draw(st.lists(st.floats(low, high), min_size=n, max_size=n))

    lengths = numbers(0.1, 2.0)
    coms = [length * part for length, part in zip(lengths, numbers(0.0, 1.0))]
    chain = PlanarChain(numbers(0.05, 10.0), lengths, coms, numbers(0.001, 1.0), 9.81)
    return chain, draw(vectors(n, 7.0)), draw(vectors(n, 2.0)), draw(vectors(n, 10.0))


def size(chain):
    """Return a torque from the reach and mass of the chain, as the unit of errors."""
    reach = sum(chain.lengths)
    return (sum(chain.masses) * reach * (reach + chain.gravity) + sum(chain.inertias))


# --- properties -------------------------------------------------------------------------------

@law
@given(motion=motions(least=2, most=2))
def test_recursion_is_the_closed_form(motion):
    chain, q, v, a = motion
    (m1, m2), (l1, l2) = chain.masses, chain.lengths
    (r1, r2), (I1, I2) = chain.com_distances, chain.inertias
    arm = PlanarTwoLink(m1, m2, l1, l2, r1, r2, I1, I2, chain.gravity)
    assert PlanarChain.from_two_link(arm) == chain
    expected = planar.inverse_dynamics(arm, q, v, a)
    scale = max(np.abs(expected).max(), size(chain))
    assert_close(newton_euler(chain, q, v, a).tau, expected, atol=1e-12 * scale)
    ours, theirs = planar_chain.forward_kinematics(chain, q), planar.forward_kinematics(arm, q)
    for one, other in zip(ours, theirs):
        assert_close(one, other, atol=1e-14)


def test_worked_example_with_its_vectors():
    result = newton_euler(CHAIN, Q, V, A)
    assert_close(result.tau, EXAMPLE, atol=PRINTED)
    npt.assert_allclose(result.omega, [0.5, 0.8], rtol=1e-14)
    npt.assert_allclose(result.omega_dot, [0.1, 0.3], rtol=1e-14)
    # By hand: the elbow is at 45° and 1 m, with acceleration 0.1 tangential and 0.25 inward.
    half = math.sqrt(0.5)
    assert_close(
        result.joint_acceleration[1], [(0.1 - 0.25) * half, (-0.1 - 0.25) * half], atol=1e-15)
    npt.assert_allclose(result.com_acceleration[0], 0.5 * result.joint_acceleration[1])
    npt.assert_array_equal(result.joint_position[0], [0.0, 0.0])
    npt.assert_allclose(result.joint_position[1], [half, half], rtol=1e-14)


# --- common errors: a test for each row of the table in docs/planar_arm.md ------------------

@pytest.mark.parametrize(
    ('is_carried', 'wrong'), [(False, [24.00, -0.15]), (True, [50.28, 11.53])])
def test_correction_scalar_recursions_are_wrong(is_carried, wrong):
    """
    Gravity, tangential and inward terms are added in one direction.

    Joint 2 starts at rest, as if the joint were forgotten, or with the acceleration of COM 1.
    """
    first = 9.81 + 0.1 * 0.5 - 0.5**2 * 0.5
    force2 = 3.0 * (is_carried * first + 0.3 * 0.4 - 0.8**2 * 0.4)
    tau2 = 0.4 * force2 + 0.05 * 0.3
    tau1 = tau2 + 0.5 * (force2 + 5.0 * first) + 0.1 * 0.1
    assert_close([tau1, tau2], wrong, atol=5e-3)
    right = newton_euler(CHAIN, Q, V, A).tau
    assert_close(right, EXAMPLE, atol=PRINTED)
    assert np.abs(np.array([tau1, tau2]) - right).min() > 10.0


def vector_recursion(start='end', carry_moment=True, up=1.0):
    """Return the torques of the example by a recursion with at most one incorrect step."""
    result = newton_euler(CHAIN, Q, V, A)
    levers = result.com_position - result.joint_position
    ends = np.array([result.joint_position[1], result.tip_position]) - result.joint_position
    relative = [result.com_acceleration[i] - result.joint_acceleration[i] for i in range(2)]
    second_joint = result.joint_acceleration[1] if start == 'end' else relative[0]
    accelerations = [relative[0], second_joint + relative[1]]
    tau, force, moment = np.zeros(2), np.zeros(2), 0.0
    for i in (1, 0):
        own = CHAIN.masses[i] * (accelerations[i] + [0.0, up * CHAIN.gravity])
        lever_of_next = ends[i] if carry_moment else np.zeros(2)
        moment += CHAIN.inertias[i] * result.omega_dot[i]
        for lever, f in ((levers[i], own), (lever_of_next, force)):
            moment += lever[1] * f[0] - lever[0] * f[1]
        force, tau[i] = force + own, moment
    return tau


def test_correction_next_joint_starts_from_the_end_of_the_link():
    spoilt = vector_recursion(start='com')
    right = newton_euler(CHAIN, Q, V, A).tau
    npt.assert_allclose(vector_recursion(), right, rtol=1e-13)  # before it is spoilt
    assert np.abs(spoilt - right).min() > 0.05


def test_correction_force_of_the_next_link_has_a_moment():
    spoilt = vector_recursion(carry_moment=False)
    right = newton_euler(CHAIN, Q, V, A)
    assert spoilt[1] == pytest.approx(right.tau[1], rel=1e-13)
    x, y = right.joint_position[1]
    missing = y * right.force[1, 0] - x * right.force[1, 1]
    assert right.tau[0] - spoilt[0] == pytest.approx(missing, rel=1e-12)
    assert abs(missing) > 20.0


def test_correction_force_acts_at_the_joint_and_not_at_the_centre_of_mass():
    # "Lever to the COM times the whole force" applies the next link's force at the COM as well.
    result = newton_euler(CHAIN, Q, V, A)
    (x, y), (fx, fy) = result.com_position[0], result.force[0]
    written = result.tau[1] + CHAIN.inertias[0] * result.omega_dot[0] + y * fx - x * fy
    assert abs(written - result.tau[0]) > 5.0


def test_correction_weight_is_carried_upwards():
    flipped = vector_recursion(up=-1.0)
    assert_close(EXAMPLE - flipped, 2.0 * planar.gravity_vector(ARM, Q), atol=2.0 * PRINTED)


# --- input ------------------------------------------------------------------------------------

@pytest.mark.parametrize(('change', 'message'), [
    ({'masses': []}, 'masses has 0 values, expected at least 1'),
    ({'masses': 5.0}, 'masses is 5.0, expected one number for each link'),
    ({'masses': [5.0, -3.0]}, 'masses[1] (link2) is -3, expected a number > 0'),
    ({'lengths': [1.0]},
     "lengths has 1 values, expected 2, one for each of ['link1', 'link2']"),

    ({'com_distances': [0.5, 0.9]},
     'com_distances[1] (link2) is 0.9, expected a number in [0, 0.8]'),
    ({'inertias': [0.0, 0.05]}, 'inertias[0] (link1) is 0, expected a number > 0'),
    ({'gravity': -1.0}, 'gravity is -1, expected a number >= 0'),
])
def test_parameters_out_of_range_are_named(change, message):
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        dataclasses.replace(CHAIN, **change)


@pytest.mark.parametrize(('q', 'v', 'a', 'message'), [
    ([0.0], V, A, "q has 1 values, expected 2, one for each of ['joint1', 'joint2']"),
    (Q, [0.0, math.nan], A, 'v[1] (joint2) is nan, expected a finite number'),

])
def test_states_of_another_shape_are_named(q, v, a, message):
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        newton_euler(CHAIN, q, v, a)
