# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Every quantity of the rigid bodies against MuJoCo and Drake, on real robots at random states.

`engine_cases` builds arm and engine from the same description.
"""

from functools import partial

from engine_cases import assert_same_motion, ENGINES, make_case, plain, with_payloads
import largest_error
import numpy as np
import pytest
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.payload import make_payload, Payload
from robots import robot_urdf

assert_near = partial(largest_error.assert_near, 1e-11)
ROBOTS = ('kinova', 'panda', 'talos_left_arm', 'tiago_pro')
"""Revolute, continuous and prismatic joints, along and against the axes, with mimic joints."""


pytestmark = [
    pytest.mark.parametrize('engine', ENGINES), pytest.mark.parametrize('robot', ROBOTS)]


@pytest.fixture
def case(engine, robot):
    """Return the case of an unchanged robot."""
    return plain(engine, robot)


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
        assert_near(ours.coriolis_matrix(q, v) @ v, coriolis, 'C v')


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
    urdf = robot_urdf(robot)
    loads = random_payloads(plain(engine, robot).arm, np.random.default_rng(7))
    case = make_case(engine, urdf, theirs=with_payloads(urdf, loads))
    ours, theirs = RigidBody(case.arm.with_payloads(loads)), case.reference
    for state in case.states(5):
        q, v, a, tau = state
        assert_near(ours.inverse_dynamics(q, v, a), theirs.inverse_dynamics(q, v, a), 'tau')
        assert_near(ours.mass_matrix(q), theirs.mass_matrix(q), 'M')
        assert_near(ours.gravity(q), theirs.gravity(q), 'g')
        assert_same_motion(ours.forward_dynamics(q, v, tau), theirs, state)
