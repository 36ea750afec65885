# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Every quantity of the rigid bodies against MuJoCo and Drake, on real robots at random states.

By default four robots with every kind of joint; `scripts/test -m soak` runs the others.

`engine_cases` builds arm and engine from the same description.
"""

from collections.abc import Sequence

from engine_cases import (
    assert_near,
    assert_same_motion,
    Case,
    description,
    ENGINES,
    IMPLAUSIBLE,
    implausible_links,
    joint_kinds,
    make_case,
    moving_joints,
    plain,
    State,
    with_friction,
    with_payloads,
)
import numpy as np
import pytest
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics, RigidBody
from robot_dynamics.model.payload import make_payload, Payload
from robots import robot_urdf, ROBOTS

DEFAULT = ('kinova', 'panda', 'talos_left_arm', 'pr2')


@pytest.fixture(params=ENGINES)
def engine(request):
    return request.param


@pytest.fixture(params=[
    pytest.param(name, marks=() if name in DEFAULT else pytest.mark.soak) for name in ROBOTS])
def robot(request):
    return request.param


@pytest.fixture
def case(engine, robot):
    """Return the case of an unchanged robot."""
    return plain(engine, robot)


def test_the_default_robots_have_every_kind_of_joint():
    assert set.union(*map(joint_kinds, DEFAULT)) == set.union(*map(joint_kinds, ROBOTS))


def test_the_description_corrects_only_implausible_links(robot):
    assert implausible_links(robot_urdf(robot)) == IMPLAUSIBLE.get(robot, set())
    assert implausible_links(description(robot)) == set()


def test_inverse_dynamics(case):
    ours, theirs = case.body, case.reference
    for q, v, a, _ in case.states(5):
        assert_near(ours.inverse_dynamics(q, v, a), theirs.inverse_dynamics(q, v, a), 'tau')
        wrenches = case.wrenches(3)
        assert_near(
            ours.inverse_dynamics(q, v, a, wrenches),
            theirs.inverse_dynamics(q, v, a, wrenches), 'tau with wrenches')


def test_terms(case):
    ours, theirs = case.body, case.reference
    for q, v, a, _ in case.states(5):
        wrenches = case.wrenches(2)
        terms = ours.terms(q, v, a, wrenches)
        M, coriolis, gravity = theirs.mass_matrix(q), theirs.coriolis(q, v), theirs.gravity(q)
        assert_near(terms.inertial, M @ a, 'inertial')
        assert_near(terms.coriolis, coriolis, 'coriolis')
        assert_near(terms.gravity, gravity, 'gravity')
        assert_near(terms.external, theirs.external(q, wrenches), 'external')
        assert_near(ours.gravity(q), gravity, 'g')
        assert_near(ours.nonlinear(q, v), coriolis + gravity, 'C v + g')
        assert_near(ours.mass_matrix(q), M, 'M')


def assert_same_potential(case: Case, ours: RigidBody, states: Sequence[State]) -> None:
    """Compare differences of the potential energy, as engines measure from other origins."""
    potential = np.array([ours.potential_energy(s.q) for s in states])
    expected = np.array([case.reference.potential_energy(s.q) for s in states])
    assert_near(np.diff(potential), np.diff(expected), 'difference of potential energies')


def test_energies(case):
    ours, theirs = case.body, case.reference
    states = case.states(5)
    for q, v, _, _ in states:
        assert_near(ours.kinetic_energy(q, v), theirs.kinetic_energy(q, v), 'kinetic energy')
    assert_same_potential(case, ours, states)


def test_forward_dynamics(case):
    for state in case.states(5):
        q, v, _, tau = state
        assert_same_motion(case.body.forward_dynamics(q, v, tau), case.reference, state)
        wrenches = case.wrenches(2)
        a = case.body.forward_dynamics(q, v, tau, wrenches)
        assert_same_motion(a, case.reference, state, wrenches)


def test_coriolis_matrix(case):
    """`test_rigid_body.py` compares the Christoffel symbols with M, and C with them."""
    for q, v, _, _ in case.states(1):
        C = case.body.coriolis_matrix(q, v)
        assert_near(C @ v, case.reference.coriolis(q, v), 'C v')


def random_payloads(arm: ArmModel, rng: np.random.Generator) -> list[Payload]:
    """Return payloads on three links, two of them on the last link."""
    first, second, third = rng.choice(arm.link_names, 3, replace=False)
    loads = []
    for link in (first, second, third, third):
        spread = rng.normal(size=(3, 3)) * 0.1
        second_moment = spread @ spread.T
        inertia = np.trace(second_moment) * np.eye(3) - second_moment
        loads.append(
            make_payload(str(link), rng.uniform(0.2, 4.0), rng.normal(size=3) * 0.2, inertia))
    return loads


def test_payloads(engine, robot):
    loads = random_payloads(plain(engine, robot).arm, np.random.default_rng(7))
    urdf = description(robot)
    case = make_case(engine, urdf, theirs=with_payloads(urdf, loads))
    ours, theirs = RigidBody(case.arm.with_payloads(loads)), case.reference
    states = case.states(5)
    for state in states:
        q, v, a, tau = state
        assert_near(ours.inverse_dynamics(q, v, a), theirs.inverse_dynamics(q, v, a), 'tau')
        assert_near(ours.mass_matrix(q), theirs.mass_matrix(q), 'M')
        assert_near(ours.gravity(q), theirs.gravity(q), 'g')
        assert_same_motion(ours.forward_dynamics(q, v, tau), theirs, state)
    assert_same_potential(case, ours, states)


def compare_with_friction(engine: str, urdf: str, joints: Sequence[str] = ()) -> None:
    """Compare damping with the engine's, and Coulomb friction by the power at each joint."""
    tree, rng = list(moving_joints(urdf)), np.random.default_rng(13)
    damping, coulomb = rng.uniform(0.1, 5.0, len(tree)), rng.uniform(0.1, 5.0, len(tree))
    urdf = with_friction(urdf, dict(zip(tree, damping)), dict(zip(tree, coulomb)))
    case = make_case(engine, urdf, joints=joints, damping=True)
    dynamics, theirs = ArmDynamics(case.arm), case.reference
    for state in case.states(5):
        q, v, a, tau = state
        dry = theirs.G.T @ (coulomb * np.sign(theirs.G @ v))
        assert_near(
            dynamics.inverse_dynamics(q, v, a), theirs.inverse_dynamics(q, v, a) + dry, 'tau')
        assert_same_motion(dynamics.forward_dynamics(q, v, tau + dry), theirs, state)


def test_friction(engine, robot):
    compare_with_friction(engine, description(robot))
