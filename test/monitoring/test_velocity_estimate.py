# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Velocities estimated from positions: delay, noise, and the loop with estimated velocities."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.model.arm import load_arm
from robot_dynamics.monitoring.velocity_estimate import VelocityEstimate
from robot_dynamics.planar.urdf import default_arm_urdf

SECOND = 1_000_000_000
ARM = load_arm(default_arm_urdf())
RATES = (30, 100, 125, 250, 500, 1000)


def span_of(rate: int) -> float:
    """Return the span of the difference [s]: whole periods, at least 10 ms."""
    return math.ceil(0.01 * rate - 1e-9) / rate


@settings(max_examples=50)
@given(st.sampled_from(RATES), st.floats(-3.0, 3.0), st.floats(-9.0, 9.0))
def test_it_is_late_by_half_of_its_span(rate, v0, a):
    """For constant acceleration the estimate is the velocity at the time t − delay."""
    estimate = VelocityEstimate(np.array([False]))
    for k in range(40):
        t = k / rate
        found = estimate.update(round(SECOND * t), np.array([v0 * t + 0.5 * a * t * t]))
        if k == 0:
            assert found is None
            continue
        assert estimate.delay == pytest.approx(0.5 * min(k / rate, span_of(rate)), abs=1e-9)
        assert found[0] == pytest.approx(v0 + a * (t - estimate.delay), abs=1e-5)


@pytest.mark.parametrize('rate', [30, 1000])
def test_its_noise_is_that_of_two_positions_over_the_span(rate):
    estimate, sigma = VelocityEstimate(np.zeros(4, dtype=bool)), 1e-4
    rng = np.random.default_rng(0)
    found = [estimate.update(round(SECOND * k / rate), rng.normal(0.0, sigma, 4))
             for k in range(2000)]
    noise = np.std(np.array(found[100:], dtype=float))
    assert noise == pytest.approx(math.sqrt(2.0) * sigma / span_of(rate), rel=0.05)


def test_only_a_joint_without_an_end_may_jump_by_a_turn():
    estimate = VelocityEstimate(np.array([True, False]))
    for k, q in enumerate((3.13, 3.14, -3.133185307, -3.123185307)):
        found = estimate.update(k * SECOND // 100, np.array([q, 4.0 * k]))
        assert k == 0 or found == pytest.approx(np.array([1.0, 400.0]), abs=1e-6)


def test_an_equal_stamp_repeats_the_estimate():
    estimate = VelocityEstimate(np.array([False]))
    estimate.update(0, np.array([0.0]))
    found = estimate.update(SECOND // 100, np.array([0.02]))
    assert found == pytest.approx(np.array([2.0]))
    assert estimate.update(SECOND // 100, np.array([7.0])) == found
    assert estimate.update(SECOND // 50, np.array([0.05])) == pytest.approx(np.array([3.0]))


def test_a_pause_of_more_than_half_a_second_or_a_step_back_in_time_resets_the_estimate():
    estimate = VelocityEstimate(np.array([False]))
    estimate.update(0, np.array([0.0]))
    assert estimate.update(SECOND // 2, np.array([1.0])) == pytest.approx(np.array([2.0]))
    assert estimate.update(SECOND + 1, np.array([5.0])) is None
    assert estimate.update(SECOND // 2, np.array([7.0])) is None
    assert estimate.update(SECOND // 2, np.array([8.0])) is None  # an equal stamp
    estimate.restart()
    assert estimate.update(SECOND // 2 + 1, np.array([9.0])) is None


def controller(**changes: object) -> Controller:
    return Controller(ARM, ControllerOptions(
        make_gains(ARM.joint_names), effort_rate=10.0 * ARM.limits.effort, scales_gains=True,
        **changes))


def states(one: Controller, rate: int, velocities: bool) -> None:
    for k in range(400):
        one.update(SECOND + SECOND * k // rate, np.full(2, 0.2),
                   np.zeros(2) if velocities else None)


@pytest.mark.parametrize('rate', [30, 250, 1000])
def test_the_gains_follow_the_delay(rate):
    measured, estimated = controller(), controller(estimates_velocity=True)
    states(measured, rate, True)
    states(estimated, rate, False)
    omega = math.sqrt(make_gains(ARM.joint_names).kp.max())

    def scale(delay: float) -> float:
        """Return the factor with which 8 ms, half a period and the delay take 0.5 rad."""
        crossover = math.sqrt(2.0 + math.sqrt(5.0)) * omega
        return min(1.0, 0.5 / (crossover * (0.5 / rate + 0.008 + delay)))

    assert measured.gains.least == pytest.approx(scale(0.0), rel=0.11)
    assert estimated.gains.least == pytest.approx(scale(0.5 * span_of(rate)), rel=0.11)
    assert 'estimated velocities' in str(estimated.gains)
    assert estimated.gains.least <= measured.gains.least
