# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Gains within the limits by margin of the loop, rate and noise of the joint states."""

import cmath
from collections.abc import Sequence
import math

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.gain_scaling import (
    longest_period,
    loop_gains,
    LoopGains,
    StableGains,
)
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
KINDS = ('revolute', 'revolute')
Q, V, ZERO = np.array([0.3, -0.2]), np.array([0.1, 0.4]), np.zeros(2)
M = np.array([[2.0, 0.3], [0.3, 0.5]])
FEW = settings(max_examples=50)


# --- the closed loop -----------------------------------------------------------------------------

@FEW
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


def test_stiffness_without_damping_has_no_margin_and_damping_without_stiffness_has_one():
    for kd, longest in ((0.0, math.inf), (5.0, 2.0 * (DELAY_LAG / 5.0 - LOOP_DELAY))):
        found = loop_of(Gains(ZERO, np.full(2, kd)))
        assert found.crossover == pytest.approx(kd)
        assert longest_period(found) == pytest.approx(longest)
    found = loop_of(Gains(np.full(2, 100.0), ZERO))
    assert longest_period(found) == 0.0
    assert stable(found).scale.tolist() == [0.0, 0.0]


# --- rate of the states --------------------------------------------------------------------------

def stable(loop: LoopGains | None, effort_rate: FloatArray | float = math.inf) -> StableGains:
    one = StableGains(KINDS)
    one.set_loop_gains(loop, np.full(2, effort_rate))
    return one


def scales(one: StableGains) -> tuple[float, list[float], float]:
    return one.least, one.scale.tolist(), one.reference_scale


def take(
    one: StableGains, dt: float, q: FloatArray, v: FloatArray, velocity_delay: float = 0.0,
) -> FloatArray:
    """Take a state and evaluate it; return the velocity to use. A change is reported."""
    before = scales(one)
    used = one.take(dt, q, v, velocity_delay)
    assert one.evaluate() or before == scales(one)
    assert not one.evaluate()  # a state is evaluated once
    return used


def scale_at(period: float, omega: float = OMEGA) -> float:
    """Return the scale for states without noise."""
    return min(1.0, DELAY_LAG / (CROSSOVER * omega * (0.5 * period + LOOP_DELAY)))


def after(period: float, count: int = 100, omega: float = OMEGA) -> StableGains:
    """Return the gains after `count` states at rest with this period [s]."""
    one = stable(loop_of(make_gains(KINDS, [omega])))
    for k in range(count):
        take(one, period if k else 0.0, Q, ZERO)
    return one


def changes(one: StableGains, period: float, count: int) -> list[int]:
    """Take more states at rest; return which of them changed a scale."""
    changed = []
    for k in range(count):
        before = scales(one)
        take(one, period, Q, ZERO)
        if scales(one) != before:
            changed.append(k)
    return changed


@pytest.mark.parametrize('period', [FAST, 0.02, SLOW])
def test_the_scale_is_that_of_the_period(period):
    one = after(period)
    assert one.least == pytest.approx(scale_at(period))
    assert one.scale == pytest.approx(np.full(2, one.least))
    assert 'measured velocities' in str(one)
    assert changes(one, period, 100) == []
    assert not one.differs
    delay = 0.02  # that of an estimated velocity
    for _ in range(200):
        take(one, period, Q, ZERO, delay)
    assert one.least == pytest.approx(scale_at(period + 2.0 * delay))
    assert 'estimated velocities' in str(one)


def test_slower_states_lower_the_gains_at_once_and_faster_ones_raise_them_later():
    one = after(FAST)
    assert one.least == 1.0
    for period in (0.02, SLOW):
        assert changes(one, period, 1) == [0]
        assert one.least == pytest.approx(scale_at(period))
    assert changes(one, FAST, 10) == []
    assert len(changes(one, FAST, 500)) > 1
    assert one.least == 1.0


@pytest.mark.filterwarnings('error')
def test_only_a_state_that_follows_another_one_has_a_period():
    """Pauses of more than half a second in a row are the period, up to one second."""
    one = stable(loop_of(make_gains(KINDS, [OMEGA])))
    first = one.scale
    assert first == pytest.approx(0.5 * scale_at(0.035))  # until the rate is known
    for dt in (0.01, 0.0, -0.01, 0.8):  # the first one, repeated, earlier, after a pause
        assert one.take(dt, Q, V) is V
        assert not one.evaluate()
    assert one.period == 0.0
    for dt, period in ((FAST, FAST), (0.51, FAST), (0.49, 0.49), (0.51, 0.49), (0.8, 0.8),
                       (3.0, 1.0)):
        take(one, dt, Q, V)
        assert one.period == period
        assert period != FAST or str(one).startswith('joint states at 500 Hz')


# --- noise ---------------------------------------------------------------------------------------

def noisy(
    one: StableGains, count: int, dt: float, sigma: Sequence[float], of_difference: float = 0.0,
) -> FloatArray:
    """
    Take states at rest with this noise of the velocities; return those in use, (count, n).

    `of_difference` is the ratio to it of the noise of the differences of positions.
    """
    rng, used = np.random.default_rng(2), []
    for _ in range(count):
        q = Q + of_difference * np.array(sigma) * dt / math.sqrt(20.0 / 6.0) * rng.normal(size=2)
        used.append(take(one, dt, q, sigma * rng.normal(size=2)))
    return np.array(used)


def decoupled(omega: float = OMEGA) -> LoopGains:
    """Return the loop of computed torque with a damping ratio of 1."""
    return loop_gains(lambda M: (omega**2 * np.eye(2), 2.0 * omega * np.eye(2)), [M])


@pytest.mark.parametrize(('ratio', 'is_replaced'), [(0.3, True), (0.8, False)])
def test_noise_that_begins_after_quiet_states_decides_about_the_velocity(ratio, is_replaced):
    """Positions replace velocities that have more than twice their noise, at once for good."""
    one = stable(decoupled(), 10.0)
    noisy(one, 10, FAST, [0.0, 0.0])
    assert one.is_known  # fewer states suffice without noise
    noisy(one, 300, FAST, [0.0, 0.0])
    assert one.least == 1.0
    assert not one.differs
    noisy(one, 200, FAST, [0.4, 0.4], ratio)
    assert one.least < 0.5
    assert one.differs == is_replaced
    assert ('differences of the positions in use' in str(one)) == is_replaced


def test_harmless_noise_does_not_change_the_velocity():
    """At 30 Hz the delay lowers the gains more, and the difference of positions is later still."""
    one, rng = stable(loop_of(make_gains(KINDS, [OMEGA])), 1000.0), np.random.default_rng(1)
    for k in range(400):
        noise = rng.normal(0.0, 0.03, 2) if k > 100 else 0.0
        take(one, 1.0 / 30.0 if k else 0.0, Q, noise + ZERO)
        assert not one.differs
    assert one.least == pytest.approx(after(1.0 / 30.0).least)


@settings(max_examples=30)
@given(
    st.sampled_from([30.0, 100.0, 125.0, 500.0]), st.floats(0.3, 1.5), st.floats(0.0, 2.0),
    st.floats(-3.0, 3.0))
def test_a_motion_is_no_noise(rate, frequency, speed, phase):
    """At 30 Hz the second difference of such a velocity is up to 0.19 rad/s."""
    one, w = stable(loop_of(make_gains(KINDS, [OMEGA])), 1000.0), 2.0 * math.pi * frequency
    for k in range(200):
        x = w * k / rate + phase
        take(one, 1.0 / rate if k else 0.0, np.full(2, speed / w * math.sin(x)),
             np.full(2, speed * math.cos(x)))
        assert not one.is_known or one.scale == pytest.approx(scale_at(1.0 / rate))

