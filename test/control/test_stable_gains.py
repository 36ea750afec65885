# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Gains within the limits by rate and noise of the joint states; warnings about other gains."""

import math

import numpy as np
import pytest
from robot_dynamics.control.control_law import make_gains
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.loop_warnings import loop_warnings
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.control.stable_gains import (
    CROSSOVER,
    DELAY_LAG,
    LOOP_DELAY,
    slowest_rate,
    StateQuality,
)
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from robot_dynamics.trajectories.motion_limits import WorkspaceInertia

ARM = load_arm(default_arm_urdf())
WORKSPACE = WorkspaceInertia(ArmDynamics(ARM))
GAINS = make_gains(ARM.joint_names)
RATE = ARM.limits.effort / 0.1


def observe(
    rate: float, noise: float = 0.0, resolution: float = 0.0, count: int = 400,
) -> tuple[StateQuality, float, float]:
    """
    Return the quality of states of a smooth motion, the gain scale, and an error.

    The error is the standard deviation [rad/s] of the velocity in use.
    """
    rng, quality = np.random.default_rng(1), StateQuality(ARM.joint_kinds)
    errors, scale, dt = [], 1.0, 1.0 / rate
    for k in range(count):
        t = k * dt
        q, v = np.full(2, 0.5 * math.sin(t)), np.full(2, 0.5 * math.cos(t))
        if resolution:
            q = resolution * np.round(q / resolution)
        used = quality.velocity(dt if k else 0.0, q, v + rng.normal(0.0, noise, 2))
        if quality.is_due:
            scale = quality.stable_scale(GAINS, WORKSPACE.largest(), RATE)
        if k > count // 2:
            errors.append(used - v)
    return quality, scale, float(np.std(errors))


def test_fast_states_without_noise_leave_the_gains_and_the_velocity_as_they_are() -> None:
    quality, scale, error = observe(500.0)
    assert scale == 1.0
    assert not quality.differs
    assert error == 0.0
    assert quality.period == pytest.approx(0.002)


@pytest.mark.parametrize('rate', [10.0, 30.0, 60.0])
def test_the_phase_lag_of_slow_states_stays_below_its_bound(rate: float) -> None:
    _, scale, _ = observe(rate)
    crossover = CROSSOVER * 20.0 * scale
    assert crossover * (0.5 / rate + LOOP_DELAY) == pytest.approx(DELAY_LAG)
    assert rate < slowest_rate(GAINS)


def test_the_slowest_rate_is_where_the_gains_begin_to_be_lowered() -> None:
    limit = slowest_rate(GAINS)
    assert observe(1.02 * limit)[1] == 1.0
    assert observe(0.98 * limit)[1] < 1.0
    assert slowest_rate(make_gains(ARM.joint_names, [0.0])) == 0.0
    assert slowest_rate(make_gains(ARM.joint_names, [200.0])) == math.inf


def test_a_noisy_velocity_is_replaced_by_the_difference_of_positions() -> None:
    quality, scale, error = observe(500.0, noise=0.2)
    assert quality.differs
    assert scale > 0.9
    assert error < 0.01


def test_if_both_are_noisy_the_gains_are_lowered() -> None:
    quality, scale, _ = observe(500.0, noise=0.2, resolution=2e-3)
    assert not quality.differs
    assert scale < 0.5
    assert 'velocity noise of up to 0.2' in str(quality)


def test_until_the_quality_is_known_the_gains_are_low() -> None:
    quality, scale, _ = observe(500.0, noise=0.2, count=4)
    assert not quality.is_known
    assert scale <= 0.5
    assert observe(500.0, count=20)[0].is_known


def test_a_longer_period_counts_at_once_and_a_shorter_one_later() -> None:
    quality = StateQuality(ARM.joint_kinds)
    q, v = np.zeros(2), np.zeros(2)
    quality.velocity(0.0, q, v)
    for dt in (0.002, 0.002, 0.05):
        quality.velocity(dt, q, v)
    assert quality.period == 0.05
    quality.velocity(0.002, q, v)
    assert 0.04 < quality.period < 0.05


def test_a_single_pause_is_no_period_and_two_in_a_row_are() -> None:
    quality = StateQuality(ARM.joint_kinds)
    for _ in range(100):
        quality.velocity(0.002, np.zeros(2), np.zeros(2))
    period = quality.period
    quality.velocity(0.8, np.zeros(2), np.zeros(2))
    quality.velocity(0.002, np.zeros(2), np.zeros(2))
    assert quality.period == pytest.approx(period)
    quality.velocity(0.8, np.zeros(2), np.zeros(2))
    quality.velocity(0.8, np.zeros(2), np.zeros(2))
    assert quality.period == 0.8


def test_a_continuous_joint_may_wrap() -> None:
    quality = StateQuality(('continuous',))
    rng, used = np.random.default_rng(0), np.zeros(1)
    for k in range(200):
        q = np.array([math.pi - (math.pi - 0.02 * k) % (2.0 * math.pi)])
        used = quality.velocity(0.002 if k else 0.0, q, 10.0 + rng.normal(0.0, 0.5, 1))
        if quality.is_due:
            quality.stable_scale(make_gains(['a']), np.ones((1, 1)), np.array([10.0]))
        if k > 100:
            assert used == pytest.approx(10.0)
    assert quality.differs


def warnings_of(**options: object) -> list[str]:
    return list(loop_warnings(WORKSPACE, ControllerOptions(**options)))  # type: ignore[arg-type]


def test_the_default_parameters_are_no_reason_to_warn() -> None:
    assert not warnings_of(
        gains=GAINS, softens_gains=True, conditions_references=True, effort_rate=RATE)


def test_settings_that_can_oscillate_are_named_with_numbers() -> None:
    weak = make_gains(ARM.joint_names, damping_ratio=[1.0, 0.1])
    safe = {'softens_gains': True, 'conditions_references': True, 'effort_rate': RATE}
    damping, = warnings_of(gains=weak, **safe)
    assert damping.startswith("The damping ratio of 'joint2' is 0.1")
    unconditioned, = warnings_of(gains=GAINS, **{**safe, 'conditions_references': False})
    assert unconditioned.startswith('condition_references is false')
    slow, rate = warnings_of(gains=GAINS, **{**safe, 'softens_gains': False})
    assert f'below {slowest_rate(GAINS):.0f} Hz' in slow
    error = 1500.0 / 50.0 / (400.0 * WORKSPACE.largest()[0].sum())
    assert f"'joint1' can oscillate after an error above {error:.2g} rad" in rate


def test_at_slow_rates_the_terms_sum_to_the_command_for_the_position_ahead() -> None:
    controller = Controller(ARM, ControllerOptions(
        GAINS, effort_rate=RATE, softens_gains=True, conditions_references=True))
    q, v, period = np.array([0.8, 0.5]), np.array([0.4, -0.3]), 0.05
    for k in range(20):
        controller.update(round(1e9 * period * k), q + k * period * v, v)
    controller.follow(make_trajectory(ARM.joint_names, [0.0], [[1.0, 1.0]], (), (),
                                      ARM.joint_names), 0)
    at = q + 20 * period * v
    output = controller.update(round(1e9 * period * 20), at, v, with_terms=True)
    assert controller.bandwidth_scale < 0.5
    assert output.terms is not None
    assert output.command == pytest.approx(output.terms.effort)
    body = ArmDynamics(ARM).rigid_body
    assert output.terms.gravity == pytest.approx(body.gravity(at + 0.5 * period * v))
    assert output.gravity_compensation == pytest.approx(body.gravity(at))


def test_warnings_about_gains_of_any_size_are_finite() -> None:
    for kp in (1e-300, 1e-90, 1e8):
        options = ControllerOptions(
            make_gains(ARM.joint_names, kp=[kp], kd=[kp]), effort_rate=np.full(2, 1e9))
        assert [words for words in loop_warnings(WORKSPACE, options) if 'nan' in words] == []
