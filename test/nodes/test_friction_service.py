# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Friction in the services of a running node: a joint at rest stays at rest."""

from collections.abc import Iterator

import numpy as np
import pytest
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_interfaces.srv import ForwardDynamics, InverseDynamics
from ros_harness import DYNAMICS, NodeProcess, RosClient

FRICTION = {'coulomb': [4.0, 1.5], 'static': [6.0, 2.0]}
Q = [0.8, 0.5]


@pytest.fixture(scope='module', autouse=True)
def node() -> Iterator[None]:
    parameters = {f'friction.{name}': value for name, value in FRICTION.items()}
    with NodeProcess(DYNAMICS, {'joints': ['joint1', 'joint2'], **parameters}):
        yield


@pytest.fixture(scope='module')
def dynamics() -> ArmDynamics:
    arm = load_arm(default_arm_urdf())
    return ArmDynamics(arm.with_friction(make_friction(arm.joint_names, **FRICTION)))


@pytest.mark.parametrize(('surplus', 'moves'), [((5.9, -1.9), False), ((7.0, 0.0), True)])
def test_a_joint_at_rest_breaks_away_beyond_its_static_friction(
    client: RosClient, dynamics: ArmDynamics, surplus: tuple[float, float], moves: bool,
) -> None:
    q, rest = np.array(Q), np.zeros(2)
    tau = dynamics.rigid_body.gravity(q) + surplus
    answer = client.call(ForwardDynamics, '/dynamics/forward_dynamics', ForwardDynamics.Request(
        position=Q, effort=tau.tolist()))
    assert answer.success, answer.message
    assert any(answer.acceleration) is moves
    assert list(answer.acceleration) == pytest.approx(dynamics.forward_dynamics(q, rest, tau))


def test_inverse_dynamics_at_rest_leaves_dry_friction_out(
    client: RosClient, dynamics: ArmDynamics,
) -> None:
    answer = client.call(
        InverseDynamics, '/dynamics/inverse_dynamics', InverseDynamics.Request(position=Q))
    assert list(answer.effort) == pytest.approx(dynamics.rigid_body.gravity(np.array(Q)))
    assert list(answer.terms.friction) == [0.0, 0.0]
