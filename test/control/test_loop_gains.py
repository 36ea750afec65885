# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Crossover, margin and noise of a loop with these gains."""

import cmath
from collections.abc import Callable
import math
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.control.gains.gain_scaling import (
    DELAY_LAG,
    longest_period,
    LOOP_DELAY,
    loop_gains,
    StableGains,
    USUAL_MARGIN,
)
from robot_dynamics.control.laws.error_feedback import Gains, make_gains
from tracking_loop import loop_of, MASS


@given(omega=st.floats(0.1, 100.0), zeta=st.floats(0.01, 3.0))
def test_the_crossover_and_the_margin_are_those_of_the_open_loop(omega, zeta):
    """The open loop of ë = −K e − D ė is (D s + K)/s²."""
    gains = make_gains(['a', 'b'], [omega], [zeta])
    found = loop_of(gains)
    for j in range(2):
        w = float(found.crossover[j])
        open_loop = (1j * w * gains.kd[j] + gains.kp[j]) / (1j * w)**2
        assert abs(open_loop) == pytest.approx(1.0)
        margin = math.pi - abs(cmath.phase(open_loop))
        assert found.lag[j] == pytest.approx(
            DELAY_LAG * min(1.0, margin / USUAL_MARGIN), rel=1e-6)
        assert found.frequency[j] == pytest.approx(max(omega, zeta * omega))
    assert found.noise == pytest.approx(MASS[0] @ np.diag(gains.kd))


@pytest.mark.parametrize('kd', [0.0, 0.5, 5.0])
def test_without_stiffness_damping_is_the_loop_and_without_both_there_is_none(kd):
    found = loop_of(Gains(np.zeros(2), np.full(2, kd)))
    assert found.crossover == pytest.approx(kd)
    if kd:
        assert found.lag == pytest.approx(DELAY_LAG)  # with a margin of 90°
    assert longest_period(found) == pytest.approx(
        2.0 * (DELAY_LAG / kd - LOOP_DELAY) if kd else math.inf)


def test_a_stiffness_without_damping_has_no_margin():
    found = loop_of(Gains(np.full(2, 100.0), np.zeros(2)))
    assert found.lag.tolist() == [0.0, 0.0]
    assert longest_period(found) == 0.0
    one = StableGains(('revolute',) * 2)
    one.set_loop_gains(found, np.full(2, math.inf))
    assert one.scale.tolist() == [0.0, 0.0]


def impedance(K: np.ndarray, D: np.ndarray) -> Callable[[np.ndarray], Any]:
    """Return the closed loop with these matrices of torques."""
    return lambda M: (np.linalg.solve(M, K), np.linalg.solve(M, D))


def test_the_least_favourable_pose_counts_joint_by_joint():
    """An impedance: K is the same in each pose, and M is not."""
    K, D = np.diag([100.0, 50.0]), np.diag([20.0, 10.0])
    heavy, light = np.diag([4.0, 0.1]), np.diag([0.5, 2.0])
    closed_loop = impedance(K, D)
    both = loop_gains(closed_loop, [heavy, light])
    first, second = loop_gains(closed_loop, [light]), loop_gains(closed_loop, [heavy])
    assert both.crossover == pytest.approx([first.crossover[0], second.crossover[1]])
    assert both.noise == pytest.approx(D)


def test_coupling_raises_the_frequencies_by_at_most_the_stated_factor():
    rng = np.random.default_rng(3)
    for _ in range(50):
        A = rng.normal(size=(4, 4))
        M, K = A @ A.T + 0.1 * np.eye(4), np.diag(rng.uniform(1.0, 100.0, 4))
        found = loop_gains(impedance(K, 0.2 * K), [M])
        highest = float(np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).real.max()))
        assert highest <= found.crossover.max() * (1.0 + 1e-9)
