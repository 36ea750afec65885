# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Friction: its curve, its checks, and its effect on a moving arm.

Static friction within its bound holds a joint; otherwise the joint slides.
"""

import pickle

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.friction import FRICTION_FIELDS, JointFriction, make_friction
from robot_dynamics.joints.friction_terms import smooth_sign
from robot_dynamics.joints.stiction import choose_modes, constrained_motion

laws = settings(deadline=None, derandomize=True, max_examples=50)

NAMES = ('joint1', 'joint2')


# --- the curve -----------------------------------------------------------------------------------

def example() -> JointFriction:
    return make_friction(
        NAMES, viscous=[0.5, 0.0], coulomb=[2.0, 1.0], static=[3.0, 1.0],
        stribeck_velocity=[0.1, 0.2], offset=[0.3, -0.2])


def test_the_curve_by_hand():
    friction = example()
    v = np.array([0.2, -0.4])
    by_hand = [0.5 * 0.2 + 2.0 + np.exp(-4.0) + 0.3, -1.0 - 0.2]
    assert friction.effort(v) == pytest.approx(np.array(by_hand), rel=1e-14)
    assert friction.dry(np.zeros(2)).tolist() == [3.0, 1.0]
    assert friction.effort(np.zeros(2)).tolist() == [0.3, -0.2]


@laws
@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
def test_friction_takes_power_and_never_gives_any(v1, v2):
    v = np.array([v1, v2])
    assert (example().effort(v) * v >= 0.0).all()


@laws
@given(st.floats(0.05, 5.0), st.sampled_from([-1.0, 1.0]))
def test_the_smooth_curve_is_the_curve_away_from_rest(speed, sign):
    v = np.full(2, sign * speed)
    assert example().smooth_effort(v) == pytest.approx(example().effort(v), rel=1e-3)


def test_the_smooth_signs():
    v = np.linspace(-0.1, 0.1, 41)
    assert smooth_sign(v, 0.02) == pytest.approx(2.0 / (1.0 + np.exp(-100.0 * v)) - 1.0, abs=1e-14)
    coulomb = make_friction(NAMES, coulomb=[2.0, 1.0])  # the width of a measured sign is 0.01
    expected = np.tanh(1.0) * np.array([2.0, 1.0])
    assert coulomb.smooth_effort(np.full(2, 0.01)) == pytest.approx(expected)


@pytest.mark.parametrize(('field', 'value', 'words'), [
    ('viscous', [-0.1], "friction.viscous of 'joint1' is -0.1, expected a number >= 0"),

    ('static', [0.5], "friction.static of 'joint1' is 0.5, expected at least friction.coulomb"),
    ('stribeck_velocity', [0.0], "friction.stribeck_velocity of 'joint1' is 0, expected a number"),
    ('offset', [0.0, -1.5], "friction.offset of 'joint2' is -1.5, expected at most"),
    ('viscous', [1.0, 2.0, 3.0], 'friction.viscous has 3 values, expected 2'),

    ('sigmoid_velocity', [0.1, 0.0], "friction.sigmoid_velocity of 'joint2' is 0, expected"),
    ('load_coefficient', [0.96],
     r"friction.load_coefficient of 'joint1' is 0.96, expected a number in \[0, 0.95\]"),
    ('presliding_distance', [-0.1], "friction.presliding_distance of 'joint1' is -0.1"),
    ('presliding_distance', [0.0, 1e-9],
     "friction.presliding_distance of 'joint2' is 1e-09, expected 0 or at least 1e-06"),
    ('stribek', [1.0], 'friction.stribek is unknown, expected one of'),
])
def test_invalid_values_are_rejected_by_name(field, value, words):
    parameters = {'coulomb': [1.0], field: value}
    with pytest.raises(InvalidInputError, match=words):
        make_friction(NAMES, **parameters)


def test_what_is_left_out_is_as_in_the_description():
    default = example()
    assert make_friction(NAMES, default=default).static.tolist() == [3.0, 1.0]
    changed = make_friction(NAMES, coulomb=[4.0], default=default)
    assert changed.static.tolist() == [4.0, 4.0]  # raised to the new Coulomb friction
    assert changed.viscous.tolist() == [0.5, 0.0]


def test_an_empty_parameter_has_the_default_of_its_field():
    friction = make_friction(NAMES)
    assert friction.is_zero
    defaults = {'stribeck_velocity': 0.05, 'sigmoid_velocity': 0.03}
    for field in FRICTION_FIELDS:
        default = defaults.get(field.name, 0.0)
        assert getattr(friction, field.name).tolist() == [default] * len(NAMES)
        assert field.name not in defaults or f'If empty, {default}.' in field.description


# --- the forms of the law ------------------------------------------------------------------------

EVERY_TERM = make_friction(
    NAMES, [0.5, 0.2], [2.0, 1.0], [3.0, 1.5], [0.1, 0.2], [0.3, -0.2], sigmoid=[1.5, 0.5],
    sigmoid_velocity=[0.05, 0.1], load_coefficient=[0.1, 0.3])
signed = st.floats(1e-3, 3.0).flatmap(lambda x: st.sampled_from([-x, x]))


@laws
@given(signed, signed, st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_a_sliding_joint_leaves_the_load_whose_friction_it_has(v1, v2, load1, load2):
    v, load = np.array([v1, v2]), np.array([load1, load2])
    effort = load + EVERY_TERM.effort(v, load)
    assert EVERY_TERM.load_behind(v, effort) == pytest.approx(load, rel=1e-12, abs=1e-12)
    assert EVERY_TERM.load_behind(np.array([v, v]), effort, np.sign(v)) == pytest.approx(
        np.array([load, load]), rel=1e-12, abs=1e-12)
    without_dry = EVERY_TERM.without_dry(v, effort)
    assert without_dry - EVERY_TERM.dry(v) * np.sign(v) == pytest.approx(
        load, rel=1e-12, abs=1e-12)


@laws
@given(signed, signed, st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_the_damping_is_the_slope_of_the_smooth_terms(v1, v2, load1, load2):
    v, load = np.array([v1, v2]), np.array([load1, load2])
    smooth = EVERY_TERM.effort(v, load, np.zeros(2)) - EVERY_TERM.offset
    assert EVERY_TERM.damping(v, load) * v == pytest.approx(smooth, rel=1e-9, abs=1e-12)


def test_friction_at_rest_holds_with_all_its_terms():
    assert EVERY_TERM.at_rest.static.tolist() == [4.5, 2.0]


def test_other_processes_get_the_same_friction():
    v, load = np.array([0.3, -0.02]), np.array([4.0, -7.0])
    copied = pickle.loads(pickle.dumps(EVERY_TERM))
    assert copied.effort(v, load).tolist() == EVERY_TERM.effort(v, load).tolist()


sixty = settings(deadline=None, derandomize=True, max_examples=60)


def random_case(seed: int, n: int) -> tuple[np.ndarray, ...]:
    random = np.random.default_rng(seed)
    A = random.standard_normal((n, n))
    M = A @ A.T + 0.3 * np.eye(n)
    v = random.standard_normal(n) * random.integers(0, 2, n)
    coulomb = random.uniform(0.0, 2.0, n) * random.integers(0, 2, n)
    return M, v, random.standard_normal(n), coulomb


@sixty
@given(st.integers(0, 2**32 - 1), st.integers(1, 7))
def test_the_modes_fit_the_friction_that_they_need(seed, n):
    M, v, effort, coulomb = random_case(seed, n)
    modes = choose_modes(M, v, effort, coulomb, coulomb)
    sliding = effort - modes.direction * coulomb
    a, friction = constrained_motion(M, sliding, modes.stuck)
    assert M @ a == pytest.approx(sliding - friction, abs=1e-9)
    assert (a[modes.stuck] == 0.0).all()
    assert (friction[~modes.stuck] == 0.0).all()
    assert (np.abs(friction) <= coulomb * (1.0 + 1e-9)).all()
    dry = coulomb > 0.0
    assert (modes.direction[dry & (v != 0.0)] == np.sign(v[dry & (v != 0.0)])).all()
    assert (modes.direction[~dry] == 0.0).all()
    assert not (modes.stuck & (v != 0.0)).any()
    # a dry joint at rest either sticks or has a direction of sliding
    assert (modes.stuck | (modes.direction != 0.0))[dry].all()


@sixty
@given(st.integers(0, 2**32 - 1), st.integers(2, 7))
def test_a_joint_starts_to_slide_against_friction(seed, n):
    M, _, effort, coulomb = random_case(seed, n)
    modes = choose_modes(M, np.zeros(n), 2.0 * effort, coulomb, coulomb)
    sliding = 2.0 * effort - modes.direction * coulomb
    a, _ = constrained_motion(M, sliding, modes.stuck)
    assert (a * modes.direction >= -1e-12 * np.abs(a).max()).all()
    # Of all accelerations, the result minimises Gauss's principle with dry friction.
    rest = 2.0 * effort - M @ a
    bound = np.where(a == 0.0, np.abs(rest) - coulomb, np.abs(rest - coulomb * np.sign(a)))
    assert bound.max() <= 1e-9
