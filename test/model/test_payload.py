# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Payloads on links: validation, and their effect on an arm."""

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import numpy.testing as npt
from one_joint_arm import arm_of, inertial
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.payload import describe_change, make_payload, with_payload_on
from robot_dynamics.model.payload_check import check_payloads, holdable_mass, reach
from robot_dynamics.planar.urdf import default_arm_urdf
from robots import robot_urdf

laws = settings(deadline=None, derandomize=True, max_examples=30)
seeds = st.integers(0, 2**32 - 1)
ARM = load_arm(default_arm_urdf())

def random_payload(rng, link):
    """Return a solid box in a random orientation."""
    mass, com = rng.uniform(0.01, 20.0), rng.normal(0, 0.2, 3)
    a, b, c = rng.uniform(0.01, 0.5, 3)
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    moments = mass / 12 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    return make_payload(link, mass, com, Q @ np.diag(moments) @ Q.T)


def everything(arm, seed):
    """Return quantities of an arm at one random state: efforts, matrix, energies, acceleration."""
    q, v, a = np.random.default_rng(seed).normal(0, 1, (3, arm.joint_count))
    body = RigidBody(arm)
    tau = body.inverse_dynamics(q, v, a)
    return (
        tau, body.gravity(q), body.mass_matrix(q).ravel(), body.forward_dynamics(q, v, 0 * tau),
        [body.kinetic_energy(q, v)], [body.potential_energy(q)])


def assert_identical(ours, expected):
    for value, wanted in zip(ours, expected):
        npt.assert_array_equal(value, wanted)


# --- on an arm -----------------------------------------------------------------------------------

@laws
@given(seed=seeds)
def test_new_loads_take_the_place_of_old_ones(seed):
    rng = np.random.default_rng(seed)
    old = [random_payload(rng, 'tool0'), random_payload(rng, 'link1')]
    new = (random_payload(rng, 'link1'),)
    untouched = everything(ARM, seed)
    ours = ARM.with_payloads(old).with_payloads(new)
    assert ours.payloads == new
    assert_identical(everything(ours, seed), everything(ARM.with_payloads(new), seed))
    for unloaded in (ARM, ours.with_payloads([]), ARM.with_payloads([make_payload('tool0', 0.0)])):
        assert unloaded.payloads == ()
        assert_identical(everything(unloaded, seed), untouched)


def test_payloads_on_the_base_and_on_unknown_links():
    """The base carries its load without an effort; only the potential energy changes."""
    on_base = make_payload('base_link', 50.0, (1, 2, 3))
    *ours, potential = everything(ARM.with_payloads([on_base]), 0)
    *expected, without = everything(ARM, 0)
    assert_identical(ours, expected)
    npt.assert_allclose(potential[0] - without[0], 50.0 * 9.81 * 3.0, rtol=1e-12)
    with pytest.raises(InvalidInputError) as caught:
        ARM.with_payloads([make_payload('hand', 1.0)])
    assert str(caught.value) == (
        "payload.header.frame_id is 'hand', expected one of the links "
        "['base_link', 'link1', 'link2', 'tool0']")


# --- without an arm ------------------------------------------------------------------------------

def test_the_replaced_payload_is_named():
    changes = [('tool0', 1.0, "1 kg on 'tool0'"),
               ('link2', 3.0, "1 kg on 'tool0', 3 kg on 'link2'"),
               ('tool0', 2.0, "3 kg on 'link2', 2 kg on 'tool0' (replaces 1 kg on 'tool0')"),
               ('tool0', None, "3 kg on 'link2'"), ('link1', None, "3 kg on 'link2'"),
               ('', None, 'no payload')]
    loads = ()
    for link, mass, words in changes:
        new = None if mass is None else make_payload(link, mass)
        before, loads = loads, with_payload_on(loads, link, new)
        assert describe_change(before, loads) == words


@pytest.mark.parametrize('size', [1e-300, 1e9])
def test_no_inertia_is_too_small_to_be_judged_nor_the_largest_too_large(size):
    for tensor in (size * np.eye(3), size * np.diag([0.1, 0.2, 0.3 + 2.9e-7])):  # a flat plate
        npt.assert_array_equal(make_payload('hand', 1.0, inertia=tensor).inertia, tensor)
    with pytest.raises(InvalidInputError, match='triangle inequality'):
        make_payload('hand', 1.0, inertia=size * np.diag([0.1, 0.2, 0.3 + 3.1e-7]))
    off_diagonal = size * np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    with pytest.raises(InvalidInputError, match='expected none below 0'):
        make_payload('hand', 1.0, inertia=off_diagonal)


@pytest.mark.parametrize(('arguments', 'message'), [
    ({'mass': -0.5}, 'payload.inertia.m is -0.5, expected a number in [0, 1e+09]'),
    ({'mass': 1e154}, 'payload.inertia.m is 1e+154, expected a number in [0, 1e+09]'),
    ({'mass': 1, 'com': (0, -1e10, 0)},
     'payload.inertia.com[1] (y) is -1e+10, expected a number in [-1e+09, 1e+09]'),
    ({'mass': 1, 'com': (0, 0)},
     "payload.inertia.com has 2 values, expected 3, one for each of ['x', 'y', 'z']"),
    ({'mass': 1, 'inertia': np.diag([1.0, np.nan, 1.0])},
     'payload.inertia is [[1.0, 0.0, 0.0], [0.0, nan, 0.0], [0.0, 0.0, 1.0]], '
     'expected a finite 3 × 3 tensor'),
    ({'mass': 1, 'inertia': [[1, 0, 0], [0.1, 1, 0], [0, 0, 1]]},
     'payload.inertia is [[1.0, 0.0, 0.0], [0.1, 1.0, 0.0], [0.0, 0.0, 1.0]], '
     'expected a symmetric tensor'),
    ({'mass': 1, 'inertia': np.diag([1.0, 1.0, -0.5])},
     'payload.inertia has the principal moments [-0.5, 1.0, 1.0] kg·m², expected none below 0'),
    ({'mass': 1, 'inertia': np.diag([1.0, 2.0, 4.0])},
     'payload.inertia has the principal moments [1.0, 2.0, 4.0] kg·m², '
     'expected each to be at most the sum of the other two (triangle inequality)'),
    ({'mass': 0, 'inertia': np.eye(3)},
     'payload.inertia.m is 0 with a moment of inertia, expected a mass > 0, '
     'or all zeros to clear the payload'),
])
def test_message_on_what_is_no_body(arguments, message):
    with pytest.raises(InvalidInputError) as caught:
        make_payload('hand', **arguments)
    assert str(caught.value) == message


# --- payloads that the arm cannot hold -----------------------------------------------------------

def slide(axis: str) -> ArmModel:
    limit = '<origin xyz="0.5 0 0"/><limit lower="-1" upper="2" velocity="1" effort="50"/>'
    return load_arm(arm_of(
        inertial(1.0, (0.1, 0.1, 0.1)), limit, 'prismatic', axis=axis, geometry=''))


def with_effort_limits(effort: float) -> ArmModel:
    return replace(ARM, limits=replace(ARM.limits, effort=np.full(2, effort)))


@pytest.mark.parametrize('mass', [100.0, 1e6])
def test_a_mass_that_is_held_nowhere_is_rejected_with_the_numbers(mass):
    load = make_payload('tool0', mass)
    most = holdable_mass(ARM, load)
    with pytest.raises(InvalidInputError) as raised:
        check_payloads(ARM, [load], ' (remedy)')
    message = str(raised.value)
    assert f"is {mass:g} kg on 'tool0', expected at most {most:.3g} kg" in message
    assert message.endswith('(remedy)')


def test_the_largest_mass_is_held_and_little_more_is_not():
    most = holdable_mass(ARM, make_payload('tool0', 1.0))
    check_payloads(ARM, [make_payload('tool0', most)])
    with pytest.raises(InvalidInputError, match='expected at most'):
        check_payloads(ARM, [make_payload('tool0', 1.01 * most)])
    # the reported share of random poses, compared with an independent count
    rng = np.random.default_rng(1)
    body = RigidBody(ARM.with_payloads([make_payload('tool0', most)]))
    held = [bool((np.abs(body.gravity(q)) <= ARM.limits.effort).all())
            for q in rng.uniform(-np.pi, np.pi, (20_000, 2))]
    assert np.mean(held) == pytest.approx(0.01, rel=0.3)


def test_a_slide_holds_what_its_effort_limit_lifts():
    lift, load = slide('0 0 1'), make_payload('arm', 1.0)
    assert holdable_mass(lift, load) == pytest.approx(50.0 / 9.81 - 1.0)
    assert reach(lift) == pytest.approx(2.5)  # with its travel
    sideways = slide('1 0 0')  # no joint feels gravity
    check_payloads(sideways, [make_payload('arm', 1e6)])
    assert holdable_mass(sideways, load) == np.inf


def test_without_effort_limits_any_mass_is_held():
    unlimited = with_effort_limits(np.inf)
    check_payloads(unlimited, [make_payload('tool0', 1e6)])
    assert holdable_mass(unlimited, make_payload('tool0', 1.0)) == np.inf


def test_an_arm_that_cannot_hold_itself_holds_nothing():
    weak = with_effort_limits(1e-3)
    assert holdable_mass(weak, make_payload('tool0', 1.0)) == 0.0
    with pytest.raises(InvalidInputError, match='expected at most 0 kg'):
        check_payloads(weak, [make_payload('tool0', 0.1)])


def test_loads_are_judged_together():
    most = holdable_mass(ARM, make_payload('tool0', 1.0))
    one, other = make_payload('tool0', 0.7 * most), make_payload('link2', 0.7 * most, (0, 0, 0.8))
    check_payloads(ARM, [one])
    check_payloads(ARM, [other])
    with pytest.raises(InvalidInputError, match="on 'link2', expected at most"):
        check_payloads(ARM, [one, other])


def test_a_centre_of_mass_is_within_a_multiple_of_the_reach():
    """Twice the reach of 1.8 m; a metre for a link without extent."""
    turntable = load_arm(arm_of())
    for model, link, limit in ((ARM, 'tool0', 3.6), (turntable, 'arm', 1.0)):
        for angle in np.linspace(0.0, 6.0, 7):
            com = limit * np.array([np.cos(angle), 0.0, np.sin(angle)])
            check_payloads(model, [make_payload(link, 1e-3, 0.99 * com)])
            with pytest.raises(InvalidInputError, match=f"m from the origin of '{link}'"):
                check_payloads(model, [make_payload(link, 1e-3, 1.01 * com)])


@pytest.mark.parametrize('name', ['kinova', 'panda', 'so100', 'talos_left_arm', 'ur5'])
def test_arms_carry_a_kilogram_at_most_a_reach_away(name):
    arm = load_arm(robot_urdf(name))
    assert 0.2 < reach(arm) < 3.0
    link = arm.link_names[-1]
    most = holdable_mass(arm, make_payload(link, 1.0))
    assert most > 0.1
    check_payloads(arm, [make_payload(link, min(0.5 * most, 1.0))])
