# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Derivatives and the discrete model against central differences."""

from collections.abc import Callable
from functools import partial

from engine_cases import with_other_relations
import largest_error
import numpy as np
import numpy.typing as npt
from optional_library import library
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.joints.friction_terms import smooth_sign
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.derivatives import ArmDerivatives
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.payload import make_payload
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robots import robot_urdf

pytestmark = pytest.mark.usefixtures('largest_error')
Array = npt.NDArray[np.float64]
assert_near = partial(largest_error.assert_near, 1e-6)
SMOOTHING_VELOCITY = 0.01
"""Width [rad/s] of the smooth sign of dry friction."""


def loaded_arm(robot: str, rng: np.random.Generator) -> ArmModel:
    """Return an arm with payload, rotors, all terms of friction, and another mimic relation."""
    urdf = robot_urdf(robot)
    if robot == 'panda':
        urdf = with_other_relations(urdf, rng)
    arm = load_arm(urdf)
    n = arm.joint_count
    friction = make_friction(
        arm.joint_names, rng.uniform(0.1, 5.0, n), rng.uniform(0.1, 5.0, n),
        rng.uniform(5.0, 8.0, n), rng.uniform(0.02, 0.2, n), rng.uniform(-0.1, 0.1, n),
        sigmoid=rng.uniform(0.1, 3.0, n), sigmoid_velocity=rng.uniform(0.01, 0.3, n),
        load_coefficient=rng.uniform(0.0, 0.3, n))
    load = make_payload(arm.link_names[-1], 0.9, (0.1, 0.0, 0.05), np.diag([0.01, 0.02, 0.015]))
    return arm.with_friction(friction).with_payloads([load]).with_reflected_inertia(
        rng.uniform(0.0, 0.5, n))


def differences(function: Callable[[Array], Array], x: Array, h: float = 1e-6) -> Array:
    """Return the central differences (m, n) of a function by x (n,), fourth order."""
    columns = []
    for e in np.eye(len(x)) * h:
        one, two = (function(x + k * e) - function(x - k * e) for k in (1, 2))
        columns.append((8.0 * one - two) / (12.0 * h))
    return np.array(columns).T


def random_wrenches(arm: ArmModel, rng: np.random.Generator) -> list[ExternalWrench]:
    return [ExternalWrench(str(link), rng.normal(size=3) * 20.0, rng.normal(size=3) * 5.0)
            for link in rng.choice(arm.link_names, 2)]


def assert_derivatives(
    arm: ArmModel, q: Array, v: Array, a: Array, wrenches: list[ExternalWrench],
) -> None:
    """Compare the derivatives at a state with central differences, with smooth friction."""
    derivatives, body = ArmDerivatives(arm), RigidBody(arm)

    def effort(q: Array, v: Array, a: Array) -> Array:
        load = body.inverse_dynamics(q, v, a, wrenches)
        return load + arm.friction.smooth_effort(v, load)

    def motion(q: Array, v: Array, tau: Array) -> Array:
        load = arm.friction.load_behind(v, tau, smooth_sign(v, SMOOTHING_VELOCITY))
        return body.forward_dynamics(q, v, load, wrenches)

    by = derivatives.inverse_dynamics(q, v, a, wrenches)
    np.testing.assert_allclose(by.effort, effort(q, v, a), rtol=1e-9, atol=1e-9)
    assert_near(by.position, differences(lambda x: effort(x, v, a), q), 'tau by q')
    assert_near(by.velocity, differences(lambda x: effort(q, x, a), v), 'tau by v')
    assert_near(by.acceleration, differences(lambda x: effort(q, v, x), a), 'tau by a')
    tau = by.effort
    found = derivatives.forward_dynamics(q, v, tau, wrenches)
    np.testing.assert_allclose(found.acceleration, a, atol=1e-6)
    assert_near(found.position, differences(lambda x: motion(x, v, tau), q), 'a by q')
    assert_near(found.velocity, differences(lambda x: motion(q, x, tau), v), 'a by v')
    assert_near(found.effort, differences(lambda x: motion(q, v, x), tau, 1e-4), 'a by tau')


@pytest.mark.parametrize('robot', ['default', 'panda'])
def test_derivatives_are_those_of_central_differences(robot):
    rng = np.random.default_rng(8)
    arm = loaded_arm(robot, rng)
    n = arm.joint_count
    for speed in (1.0, SMOOTHING_VELOCITY):
        for wrenches in ([], random_wrenches(arm, rng)):
            assert_derivatives(
                arm, rng.uniform(-2.0, 2.0, n), rng.normal(size=n) * speed, rng.normal(size=n),
                wrenches)


@pytest.mark.parametrize('robot', ['default', pytest.param('xarm7', marks=pytest.mark.soak)])
def test_discrete_model_against_differences_of_the_simulation(robot):
    library('scipy')
    rng, T = np.random.default_rng(9), 0.004
    arm = load_arm(robot_urdf(robot))
    n = arm.joint_count
    arm = arm.with_friction(make_friction(arm.joint_names, rng.uniform(0.1, 1.0, n)))
    arm = arm.with_reflected_inertia(0.1)
    x, tau = rng.normal(size=2 * n), rng.normal(size=n) * 5.0

    def simulated(x: Array, tau: Array) -> Array:
        simulation = ArmSimulation(arm, x[:n], x[n:], max_step=T / 8.0)
        simulation.release()
        return np.concatenate(simulation.step(tau, T))

    model = ArmDerivatives(arm).discrete(x[:n], x[n:], tau, T)
    np.testing.assert_allclose(model.state, simulated(x, tau), atol=1e-9)
    assert_near(model.A, differences(lambda at: simulated(at, tau), x, 1e-4), 'A')
    assert_near(model.B, differences(lambda at: simulated(x, at), tau, 1e-2), 'B')


def test_invalid_input_is_named():
    arm = load_arm(robot_urdf('default'))
    derivatives, rest = ArmDerivatives(arm), (0.0, 0.0)
    for call, words in (
            (lambda: ArmDerivatives(arm, 0.0), 'smoothing_velocity is 0, expected a number > 0'),
            (lambda: derivatives.inverse_dynamics((0.0,), rest, rest), 'q has 1 values'),
            (lambda: derivatives.forward_dynamics(rest, rest, (0.0, float('nan'))), r'tau\[1\]'),
            (lambda: derivatives.discrete(rest, rest, rest, -1.0), 'period is -1')):
        with pytest.raises(InvalidInputError, match=words):
            call()
