# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Gains within the limits by margin of the loop, rate and noise of the joint states."""

import cmath
import math

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.gain_scaling import loop_gains, LoopGains, StableGains
from robot_dynamics.control.laws.computed_torque import ComputedTorque
from robot_dynamics.control.laws.error_feedback import ErrorFeedback, Gains, make_gains
from robot_dynamics.control.options import ControllerOptions

MASS = np.diag([2.0, 0.5])[np.newaxis]
"""M of two joints without coupling, (1, 2, 2) [kg·m²]."""


def loop_of(gains: Gains, mass_matrices: np.ndarray = MASS) -> LoopGains:
    """Return the loop with these gains at poses with M (m, n, n)."""
    law = ComputedTorque(
        ErrorFeedback(gains, ('revolute',) * len(gains.kp)), ControllerOptions(gains))
    return loop_gains(law.closed_loop, mass_matrices)


LOOP_DELAY = 0.008
"""[s] of transport and computation that the gains allow, in addition to half a period."""
DELAY_LAG = 0.5
"""[rad] of phase that all delays may take of a loop with a damping ratio of 1."""
NOISE_LAG = 0.1
"""[rad] of phase that the rate limit of the effort may take because of noise."""
CROSSOVER = math.sqrt(2.0 + math.sqrt(5.0))
"""Crossover by natural frequency of a loop with a damping ratio of 1."""
USUAL_MARGIN = math.atan(2.0 * CROSSOVER)
"""[rad], phase margin of that loop."""
OMEGA, FAST, SLOW = 20.0, 0.002, 0.05
NAMES = ('shoulder', 'elbow')
V, ZERO = np.array([0.1, 0.4]), np.zeros(2)
M = np.array([[2.0, 0.3], [0.3, 0.5]])
FEW = settings(max_examples=50)


# --- the closed loop -----------------------------------------------------------------------------

@FEW
@given(omega=st.floats(0.1, 100.0), zeta=st.floats(0.01, 3.0))
def test_the_crossover_and_the_margin_are_those_of_the_open_loop(omega, zeta):
    """The open loop of ë = −K e − D ė is (D s + K)/s²."""
    gains = Gains(np.full(2, omega**2), np.full(2, 2.0 * zeta * omega))
    found = loop_of(gains)
    for j in range(2):
        w = 1.0 / float(found.delay[j])
        for _ in range(60):  # the delay has the lag at the crossover, which depends on the margin
            open_loop = (1j * w * gains.kd[j] + gains.kp[j]) / (1j * w)**2
            w *= math.sqrt(abs(open_loop))
        margin = math.pi - abs(cmath.phase(open_loop))
        lag = DELAY_LAG * min(1.0, margin / USUAL_MARGIN)
        assert found.delay[j] == pytest.approx(lag / w, rel=1e-6)
        assert found.frequency[j] == pytest.approx(max(omega, zeta * omega))
    assert found.noise == pytest.approx(MASS[0] @ np.diag(gains.kd))


def test_stiffness_without_damping_has_no_margin_and_damping_without_stiffness_has_one():
    for kd, longest in ((0.0, math.inf), (5.0, DELAY_LAG / 5.0)):
        found = loop_of(Gains(ZERO, np.full(2, kd)))
        assert found.delay == pytest.approx(longest)
    found = loop_of(Gains(np.full(2, 100.0), ZERO))
    assert stable(found).scale.tolist() == [0.0, 0.0]


# --- rate of the states --------------------------------------------------------------------------

def stable(loop: LoopGains | None, effort_rate: FloatArray | float = math.inf) -> StableGains:
    one = StableGains(2)
    one.set_loop_gains(loop, np.full(2, effort_rate))
    return one


def take(one: StableGains, dt: float, v: FloatArray, velocity_delay: float = 0.0) -> None:
    """Take a state. A change is reported."""
    before = one.scale.tolist()
    assert one.take(dt, ((v, velocity_delay),)) == (before != one.scale.tolist())


def scale_at(period: float, omega: float = OMEGA) -> float:
    """Return the scale for states without noise."""
    return min(1.0, DELAY_LAG / (CROSSOVER * omega * (0.5 * period + LOOP_DELAY)))


def after(period: float, count: int = 100, omega: float = OMEGA) -> StableGains:
    """Return the gains after `count` states at rest with this period [s]."""
    one = stable(loop_of(make_gains(NAMES, [omega])))
    for k in range(count):
        take(one, period if k else 0.0, ZERO)
    return one


def changes(one: StableGains, period: float, count: int) -> list[int]:
    """Take more states at rest; return which of them changed a scale."""
    return [k for k in range(count) if one.take(period, ((ZERO, 0.0),))]


def test_slower_states_lower_the_gains_with_the_second_and_faster_ones_raise_them_later():
    one = after(FAST)
    assert one.least == 1.0
    for period in (0.02, 0.033, SLOW, 0.09):
        assert changes(one, period, 2) == [1]
        assert one.least == pytest.approx(scale_at(period))
    assert changes(one, FAST, 10) == []
    assert len(changes(one, FAST, 500)) > 1
    assert one.least == 1.0


def test_single_gaps_lower_no_gains():
    one = after(FAST)
    for _ in range(100):
        assert [changes(one, dt, 1) for dt in (0.4, FAST)] == [[], []]
    assert one.period == pytest.approx(FAST)


@pytest.mark.filterwarnings('error')
def test_a_quarter_of_the_usual_rate_is_assumed_until_two_intervals_are_known():
    """Repeated states have no interval."""
    one = stable(loop_of(make_gains(NAMES, [OMEGA])))
    assert one.scale == pytest.approx(scale_at(0.032))
    for dt in (0.0, 0.51, 0.0):
        take(one, dt, V)
        assert one.period == 0.0
        assert one.scale == pytest.approx(scale_at(0.032))
    take(one, FAST, V)
    assert one.least == 1.0
    assert str(one).startswith('joint states at 500 Hz')


# --- noise ---------------------------------------------------------------------------------------

def noisy(one: StableGains, count: int, dt: float, sigma: float) -> None:
    """Take states at rest with this noise of the velocities [rad/s]."""
    rng = np.random.default_rng(2)
    for _ in range(count):
        take(one, dt, sigma * rng.normal(size=2))


@pytest.mark.parametrize(('sigma', 'rate'), [(0.01, 10.0), (0.01, 30.0), (0.2, 2000.0)])
def test_noise_that_begins_after_quiet_states_lowers_the_gains(sigma, rate):
    """The rate limit delays efforts with the noise e = M D s sigma by e / (0.8 rate)."""
    omega = 20.0
    D = 2.0 * omega * np.eye(2)
    one = stable(loop_gains(lambda M: (omega**2 * np.eye(2), D), [M]), rate)
    noisy(one, 300, FAST, 0.0)
    assert one.least == 1.0
    noisy(one, 400, FAST, sigma)
    noise = np.hypot(*(M @ D)[0]) * sigma
    delay = noise / (math.sqrt(2.0 / math.pi) * rate)
    expected = min(1.0, math.sqrt(NOISE_LAG / (CROSSOVER * omega * delay)))
    assert one.least == pytest.approx(expected, rel=0.15)
    noisy(one, 600, FAST, 0.0)
    assert one.least == 1.0


@settings(max_examples=30)
@given(
    st.sampled_from([30.0, 100.0, 125.0, 500.0]), st.floats(0.3, 1.5), st.floats(0.0, 2.0),
    st.floats(-3.0, 3.0))
def test_a_motion_is_no_noise(rate, frequency, speed, phase):
    """At 30 Hz the second difference of such a velocity is up to 0.19 rad/s."""
    one, w = stable(loop_of(make_gains(NAMES, [OMEGA])), 1000.0), 2.0 * math.pi * frequency
    for k in range(200):
        x = w * k / rate + phase
        take(one, 1.0 / rate if k else 0.0, np.full(2, speed * math.cos(x)))
        assert k < 2 or one.scale == pytest.approx(scale_at(1.0 / rate))


@pytest.mark.parametrize(('sigma', 'choice', 'least'), [(0.0, 0, 1.0), (0.001, 0, 1.0),
                                                        (0.2, 1, 0.92), (0.6, 1, 0.92)])
def test_positions_give_the_velocity_if_the_measured_one_is_too_noisy(sigma, choice, least):
    """They are late by 4 ms: 0.5 rad / (41.2 rad/s (9 + 4) ms) of the gains is left."""
    M, rng, v = 0.2 * np.eye(2), np.random.default_rng(3), np.zeros(2)
    loop = loop_gains(lambda M: (400.0 * np.eye(2), 40.0 * np.eye(2)), [M])
    one = stable(loop, 10.0)
    for k in range(1200):
        noise = sigma if k < 100 else float(k < 200)  # later it may be an oscillation
        one.take(FAST if k else 0.0, ((noise * rng.normal(size=2), 0.0), (v, 0.004)))
        assert one.choice == (0 if k < 7 else choice) or k > 200
        if 32 < k < 100:
            assert one.least == pytest.approx(least, abs=0.02)
    assert one.choice == 0
