# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Stiction: static friction within its bound holds a joint; otherwise the joint slides."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from optional_library import library
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.stiction import choose_modes, constrained_motion
from robot_dynamics.simulation.exponential_step import exponential_step

laws = settings(deadline=None, derandomize=True, max_examples=60)


def random_case(seed: int, n: int) -> tuple[np.ndarray, ...]:
    random = np.random.default_rng(seed)
    A = random.standard_normal((n, n))
    M = A @ A.T + 0.3 * np.eye(n)
    v = random.standard_normal(n) * random.integers(0, 2, n)
    coulomb = random.uniform(0.0, 2.0, n) * random.integers(0, 2, n)
    return M, v, random.standard_normal(n), coulomb


@laws
@given(st.integers(0, 2**32 - 1), st.integers(1, 7))
def test_the_modes_fit_the_friction_that_they_need(seed, n):
    M, v, effort, coulomb = random_case(seed, n)
    modes = choose_modes(M, v, effort, coulomb, coulomb)
    sliding = effort - modes.direction * coulomb
    a, friction = constrained_motion(M, sliding, modes.stuck)
    assert M @ a == pytest.approx(sliding - friction, abs=1e-9)
    assert (a[modes.stuck] == 0.0).all()
    assert (friction[~modes.stuck] == 0.0).all()
    assert (np.abs(friction) <= coulomb * (1.0 + 1e-9)).all()
    dry = coulomb > 0.0
    assert (modes.direction[dry & (v != 0.0)] == np.sign(v[dry & (v != 0.0)])).all()
    assert (modes.direction[~dry] == 0.0).all()
    assert not (modes.stuck & (v != 0.0)).any()
    # a dry joint at rest either sticks or has a direction of sliding
    assert (modes.stuck | (modes.direction != 0.0))[dry].all()


@laws
@given(st.integers(0, 2**32 - 1), st.integers(2, 7))
def test_a_joint_starts_to_slide_against_friction(seed, n):
    M, _, effort, coulomb = random_case(seed, n)
    modes = choose_modes(M, np.zeros(n), 2.0 * effort, coulomb, coulomb)
    sliding = 2.0 * effort - modes.direction * coulomb
    a, _ = constrained_motion(M, sliding, modes.stuck)
    assert (a * modes.direction >= -1e-12 * np.abs(a).max()).all()
    # Of all accelerations, the result minimises Gauss's principle with dry friction.
    rest = 2.0 * effort - M @ a
    bound = np.where(a == 0.0, np.abs(rest) - coulomb, np.abs(rest - coulomb * np.sign(a)))
    assert bound.max() <= 1e-9


@pytest.mark.parametrize(('damping', 'stiffness'), [
    (0.0, 0.0), (1e-9, 1.0), (1.0, 1e5), (1e6, 0.0), (1e6, 1e5)])
def test_an_exponential_step_of_a_linear_arm_is_exact(damping, stiffness):
    M, _, _, viscous = random_case(7, 4)
    v = np.array([0.5, 0.0, -1.2, 0.8])
    h, free = 2e-3, v != 0.0
    K, D = stiffness * np.linspace(0.5, 1.0, 4) * free, damping * (0.1 + viscous)
    q, force = np.linspace(-0.3, 0.4, 4), np.array([3.0, -2.0, 1.0, 4.0])
    moving = np.flatnonzero(free)
    m = len(moving)
    inverse = np.linalg.inv(M[np.ix_(moving, moving)])

    def acceleration(at: FloatArray, rate: FloatArray) -> FloatArray:
        a = np.zeros(4)
        a[moving] = inverse @ (force - K * (at - q) - D * rate)[moving]
        return a

    position, velocity, _ = exponential_step(q, v, h, acceleration, M, D, K, free)
    generator = np.zeros((2 * m + 1, 2 * m + 1))  # of (q − q₀, v, 1)
    generator[:m, m:2 * m] = np.eye(m)
    generator[m:2 * m] = inverse @ np.column_stack(
        (-np.diag(K[moving]), -np.diag(D[moving]), force[moving]))
    exact = library('scipy.linalg').expm(h * generator) @ np.concatenate(
        (np.zeros(m), v[moving], [1.0]))
    assert position[moving] - q[moving] == pytest.approx(exact[:m], rel=1e-9, abs=1e-12)
    assert velocity[moving] == pytest.approx(exact[m:2 * m], rel=1e-9, abs=1e-12)
    assert velocity[~free].tolist() == [0.0] * (4 - m)
