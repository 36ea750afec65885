# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The joint impedance: its closed loop in any pose, its stiffness, and motions without error."""

from collections.abc import Mapping

from hypothesis import given, settings
from hypothesis import strategies as st
from lock_step_loop import FIRST_STAMP, middle, MS, smooth_arm
import numpy as np
import pytest
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics

SLOW_ROTORS = 5.0
"""[kg·m²]: no mode of 400 N·m/rad exceeds 9 rad/s."""
SMALL = 1e-4
"""[rad] and [rad/s] of the errors with which the gains are measured."""


def impedance_of(
    arm: ArmModel, parameters: Mapping[str, object], **options: object,
) -> ControlLoop:
    return ControlLoop.of_arm(arm, command='joint_impedance', parameters=parameters, **options)


def measured_gains(loop: ControlLoop, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return K and D (n, n) of the law at rest at q, from its efforts for small errors."""
    n, controller = len(q), loop.controller
    loop.answer(FIRST_STAMP, q, np.zeros(n))
    loop.answer(FIRST_STAMP + 2 * MS, q, np.zeros(n))
    stamp = FIRST_STAMP + 2 * MS

    def effort(shift: np.ndarray, v: np.ndarray) -> np.ndarray:
        effort = controller.answer(stamp, q + shift, v).law.effort
        return effort - ArmDynamics(loop.controller.arm).rigid_body.nonlinear(q + shift, v)

    K, D = np.zeros((n, n)), np.zeros((n, n))
    for j, one in enumerate(SMALL * np.eye(n)):
        K[:, j] = (effort(-one, 0.0 * q) - effort(one, 0.0 * q)) / (2.0 * SMALL)
        D[:, j] = (effort(0.0 * q, -one) - effort(0.0 * q, one)) / (2.0 * SMALL)
    return K, D


@pytest.mark.parametrize('name', ['ur5', 'panda'])
@settings(max_examples=15)
@given(seed=st.integers(0, 10_000), stiffness=st.floats(1.0, 2000.0))
def test_every_mode_is_critically_damped_and_none_is_too_fast(name, seed, stiffness):
    """The law is a spring and a damper whose modes are those of the closed loop with M(q)."""
    arm = smooth_arm(name)
    q = middle(arm) + np.random.default_rng(seed).uniform(-1.0, 1.0, arm.joint_count)
    loop = impedance_of(arm, {'impedance.stiffness': stiffness}, scales_gains=False)
    K, D = measured_gains(loop, q)
    M = ArmDynamics(arm).rigid_body.mass_matrix(q)
    wanted = np.linalg.eigvals(np.linalg.solve(M, stiffness * np.eye(len(q)))).real
    squares, modes = np.linalg.eig(np.linalg.solve(M, K))
    omega = np.sqrt(squares.real)
    assert np.sort(omega) == pytest.approx(np.sort(np.minimum(np.sqrt(wanted), 30.369)), rel=1e-3)
    assert (np.linalg.eigvalsh(K) <= stiffness * (1.0 + 1e-4)).all()
    assert pytest.approx(K.T, abs=1e-4 * stiffness) == K
    assert np.linalg.solve(M, D) @ modes == pytest.approx(
        modes * (2.0 * omega), abs=1e-3 * omega.max())


def test_the_default_stiffness_takes_the_effort_limit_at_an_error_of_a_quarter():
    arm = load_arm(
        '<robot name="r"><link name="a"/>' + ''.join(
            f'<link name="{child}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" '
            f'ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="{child}" type="continuous">'
            f'<parent link="{parent}"/><child link="{child}"/>{limit}</joint>'
            for parent, child, limit in (
                ('a', 'b', '<limit effort="50" velocity="1"/>'), ('b', 'c', ''))) + '</robot>')
    arm = arm.with_reflected_inertia([SLOW_ROTORS])
    K, D = measured_gains(impedance_of(arm, {}, scales_gains=False), np.array([0.8, 0.5]))
    assert pytest.approx(np.diag([200.0, 100.0]), abs=1e-3) == K
    M = ArmDynamics(arm).rigid_body.mass_matrix(np.array([0.8, 0.5]))
    rates = np.linalg.eigvals(np.linalg.solve(M, D)).real
    assert np.sort(rates)**2 == pytest.approx(
        4.0 * np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real), rel=1e-3)


@pytest.mark.parametrize('value', [[1.0, 2.0, 3.0], -1.0, [float('nan')]])
def test_a_wrong_impedance_is_named(value):
    with pytest.raises(InvalidInputError, match='impedance.stiffness'):
        impedance_of(smooth_arm('default'), {'impedance.stiffness': value})
