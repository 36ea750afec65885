# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Computed torque along several segments, for many joints, and without friction of the robot."""

import math

from controller_bench import update
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

ARM = load_arm(default_arm_urdf())
NAMES = ARM.joint_names
GAINS = make_gains(NAMES)
MS = 1_000_000
START = 1_790_000_000_000 * MS


def feedback_of(
    error: float, speed: float, rate: float, softens: bool = True,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return K_p e and K_d ė of the feedback (2,) [1/s²], as in full, and s."""
    one = Controller(ARM, ControllerOptions(GAINS, effort_rate=rate, scales_gains=softens))
    q, body = np.zeros(2), ArmDynamics(ARM).rigid_body
    for k in range(20):
        update(one, START + 2 * k * MS, q, q)
    one.follow(make_trajectory(NAMES, (0.0,), [[error, -error]], (), (), NAMES), 0)
    v = np.full(2, speed)
    output = update(one, START + 40 * MS, q, v)
    effort, terms = output.computed_torque, output.terms
    assert terms.effort == pytest.approx(effort)
    K_p_e, K_d_e_dot, s = GAINS.kp * [error, -error], -GAINS.kd * v, output.scale
    M, rest = body.mass_matrix(q), body.nonlinear(q, v)
    largest = np.abs(M @ K_p_e).max()
    of_position = min(1.0, 0.06 * rate / max(largest, 1e-300))
    leaves = K_p_e * K_d_e_dot > 0.0
    share = max(s * s, of_position) * np.where(leaves, 1.0, s) if softens else 1.0
    assert effort == pytest.approx(M @ (share * K_p_e + s * K_d_e_dot) + rest)
    return K_p_e, K_d_e_dot, s


@settings(max_examples=60)
@given(error=st.floats(-1.0, 1.0), speed=st.floats(-5.0, 5.0), rate=st.floats(1.0, 1e5))
def test_the_change_or_the_size_of_the_feedback_is_within_the_rate_limit(error, speed, rate):
    """The change is s² M (K_p + K_d²) ė per second, the size s M (K_p e + K_d ė)."""
    proportional, damping, s = feedback_of(error, speed, rate)
    M = ArmDynamics(ARM).rigid_body.mass_matrix(np.zeros(2))
    change = float(np.abs(M @ ((GAINS.kp + GAINS.kd**2) * speed)).max())
    size = float(np.abs(M @ (proportional + damping)).max())
    of_change = 0.3 * rate / max(change, 1e-300)
    of_size = 0.06 * rate / max(size, 1e-300)
    assert s == pytest.approx(min(1.0, max(math.sqrt(of_change), of_size)), rel=1e-6)


@pytest.mark.parametrize('error', [1e-3, 0.5, 3.0])
def test_a_steady_error_is_fed_back_in_full(error):
    """That under a load, for example, of any size."""
    assert feedback_of(error, 0.0, 10.0)[2] == 1.0


def test_without_softening_or_a_rate_limit_nothing_is_limited():
    assert feedback_of(0.5, 5.0, 10.0, softens=False)[2] == 1.0
    assert feedback_of(0.5, 5.0, np.inf)[2] == 1.0
