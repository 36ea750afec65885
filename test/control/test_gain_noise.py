# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The effort of velocity noise on a coupled arm, its lag, and the choice of the velocity."""

import math

import numpy as np
import pytest
from robot_dynamics.control.gains.gain_scaling import (
    loop_gains,
    LoopGains,
    NOISE_LAG,
    StableGains,
)

M = np.array([[2.0, 0.7], [0.7, 0.5]])
D = np.array([30.0, 40.0])
KINDS = ('revolute', 'revolute')
CROSSOVER = 41.0
"""[rad/s]"""
RATE = np.array([400.0, 90.0])
"""[N·m/s]"""


def coupled() -> LoopGains:
    found = loop_gains(lambda _: (np.diag([400.0, 400.0]), np.diag(D)), [M])
    return found._replace(crossover=np.full(2, CROSSOVER))


def test_noise_of_one_velocity_is_an_effort_at_all_joints() -> None:
    """The efforts per error of the velocity are those of M(q) K_d, by size."""
    found = loop_gains(lambda _: (np.diag(D), np.diag(D)), [M, 3.0 * M, np.array(
        [[1.0, -4.0], [-4.0, 20.0]])])
    assert found.noise == pytest.approx(np.array([[180.0, 160.0], [120.0, 800.0]]))


def test_the_gains_are_lowered_to_the_lag_of_a_rate_limit_with_normal_noise() -> None:
    """The effort of the noise is simulated; the mean |normal value| is 0.8 deviations."""
    one, sigma = StableGains(KINDS), np.array([0.3, 0.05])
    samples = np.random.default_rng(1).normal(0.0, 1.0, (200_000, 2)) * sigma @ (M * D).T
    one.set_loop_gains(coupled(), RATE)
    T = float(np.max(samples.std(axis=0) / (np.abs(samples).mean(axis=0) / samples.std(
        axis=0) * RATE)))
    assert one._largest_scale(coupled(), sigma) == pytest.approx(
        math.sqrt(NOISE_LAG / (CROSSOVER * T)), rel=0.01)


@pytest.mark.parametrize(('ratio', 'differs'), [(1.6, False), (2.6, True)])
def test_later_noise_of_the_velocity_is_replaced_if_the_difference_has_less_than_half(
    ratio: float, differs: bool,
) -> None:
    """`ratio` is the noise of the velocity by that of the difference of positions."""
    one, rng, dt, of_position = StableGains(KINDS), np.random.default_rng(2), 0.002, 2e-4
    one.set_loop_gains(coupled(), RATE)
    of_difference = math.sqrt(2.0) * of_position / dt
    for k in range(2000):
        is_quiet = k < 300
        q = np.zeros(2) if is_quiet else rng.normal(0.0, of_position, 2)
        v = np.zeros(2) if is_quiet else rng.normal(0.0, ratio * of_difference, 2)
        one.take(dt if k else 0.0, q, v)
        one.evaluate()
        assert not (is_quiet and one.differs)
    assert one.least < 1.0
    assert one.differs == differs
