# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Whole turns, new results, wrenches and rejected input of the rigid bodies."""

import numpy as np
import numpy.testing as npt
import pytest
from random_trees import case_of, random_case, random_inertial
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.external_wrench import ExternalWrench
from robots import robot_urdf


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
