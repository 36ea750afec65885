# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A linear-quadratic regulator from the discrete model holds `simulated_arm` upright."""

from disturbances import push, ZERO
from lock_stepped_arm import lock_stepped, LockStepped
import numpy as np
import pytest
from robot_dynamics.model import ArmDerivatives, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf

RATE = 200.0
FORCE = 5.0
"""[N]"""


def lqr_gain() -> np.ndarray:
    solve = pytest.importorskip('scipy.linalg').solve_discrete_are
    rest = np.zeros(2)
    _, A, B = ArmDerivatives(load_arm(default_arm_urdf())).discrete(rest, rest, rest, 1.0 / RATE)
    Q, R = np.diag([100.0, 100.0, 1.0, 1.0]), 0.01 * np.eye(2)
    P = solve(A, B, Q, R)
    return np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)


def step(arm: LockStepped, K: np.ndarray) -> float:
    """Make one step with the feedback; return the largest angle [rad]."""
    x = np.concatenate([arm.state.position, arm.state.velocity])
    return float(np.abs(arm.step((-K @ x).tolist()).position).max())


def steps_until(arm: LockStepped, K: np.ndarray, least: float, most: float) -> float:
    """Make steps until the largest angle is in an interval; return the largest of all steps."""
    angles = []
    for _ in range(3000):
        angles.append(step(arm, K))
        if least <= angles[-1] <= most:
            return max(angles)
    pytest.fail(f'the largest angle is {angles[-1]} after 3000 steps')


def test_the_arm_returns_upright_after_a_push(client):
    K = lqr_gain()
    with lock_stepped(client, '/upright', initial_position=[0.2, -0.1], rate=RATE) as arm:
        steps_until(arm, K, 0.0, 1e-4)
        push(client, '/upright/simulated_arm', (FORCE, 0.0, 0.0))
        steps_until(arm, K, 0.005, 0.2)
        held = max(step(arm, K) for _ in range(200))  # under the constant force
        push(client, '/upright/simulated_arm', ZERO)
        assert held < 0.2
        assert steps_until(arm, K, 0.0, 1e-4) < 0.2
