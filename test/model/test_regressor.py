# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The torque regressor and inverse dynamics."""

import numpy as np
import pytest
from robot_dynamics.model import regressor
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics, RigidBody
from robot_dynamics.model.payload import make_payload
from robots import robot_urdf


@pytest.mark.parametrize('name', ['kinova', 'tiago_pro'])
def test_the_regressor_times_the_parameters_is_inverse_dynamics(name):
    # among them continuous, prismatic and mimic joints
    arm = load_arm(robot_urdf(name))
    q, v, a = regressor.random_states(arm, 20)
    Y = regressor.TorqueRegressor(arm)(q, v, a)
    expected = RigidBody(arm).inverse_dynamics_batch(q, v, a)
    assert Y @ regressor.inertial_parameters(arm) == pytest.approx(
        expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(('name', 'link'), [
    ('panda', 'panda_leftfinger'), ('kinova', 'j2s6s200_end_effector')])
def test_the_regressor_of_a_load_times_its_parameters_is_its_effort(name, link):
    """Among them continuous, prismatic and mimic joints."""
    arm = load_arm(robot_urdf(name))
    load = make_payload(link, 2.5, (0.1, -0.05, 0.2), np.diag([0.02, 0.03, 0.04]))
    states = regressor.random_states(arm, 20)
    expected = ArmDynamics(arm.with_payloads([load])).inverse_dynamics_batch(*states) - (
        ArmDynamics(arm).inverse_dynamics_batch(*states))
    effort = regressor.LoadRegressor(arm, link)(*states) @ load.body.toDynamicParameters()
    assert effort == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())
