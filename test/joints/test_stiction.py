# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Stiction: static friction within its bound holds a joint; otherwise the joint slides."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.joints.stiction import choose_modes, constrained_motion

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
