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
    Noise,
    slowest_rate,
    StableGains,
)
from robot_dynamics.control.laws.error_feedback import Gains, make_gains
from tracking_loop import loop_of, MASS

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


@FEW
@given(st.floats(0.05, 50.0), st.floats(0.05, 50.0), st.floats(-0.9, 0.9), st.booleans())
def test_coupling_raises_the_crossovers_by_that_of_the_faster_mode(
    first, second, coupling, is_damping,
):
    """[[1, c], [c, 1]] has the eigenvalues 1 ± |c|, in any units of the joints."""
    own, other = np.diag([first, second]), np.diag([0.3, 3.0])
    scale = np.sqrt(np.diagonal(own))
    coupled = own + coupling * np.outer(scale, scale) * (1.0 - np.eye(2))
    pair, alone = ((other, coupled), (other, own)) if is_damping else (
        (coupled, other), (own, other))
    found, expected = (loop_gains(lambda M, x=x: x, [M]) for x in (pair, alone))
    assert found.crossover == pytest.approx((1.0 + abs(coupling)) * expected.crossover)
    assert found.lag == pytest.approx(expected.lag)


@FEW
@given(st.floats(0.1, 100.0), st.floats(0.1, 100.0), st.lists(
    st.floats(0.01, 100.0), min_size=1, max_size=4))
def test_a_workspace_permits_the_delay_that_each_of_its_poses_permits(stiffness, damping, masses):
    """The damping of an effort leaves a heavy pose the least margin, at the lowest crossover."""

    def loop(M: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.array([[stiffness]]), damping / M

    every = [loop_gains(loop, [np.array([[m]])]) for m in masses]
    found = loop_gains(loop, [np.array([[m]]) for m in masses])
    assert found.lag / found.crossover == pytest.approx(
        min(each.lag / each.crossover for each in every))


def test_noise_of_one_velocity_is_an_effort_at_all_joints():
    """The efforts per error of the velocity are those of M(q) K_d, by size, in the worst pose."""
    D = np.diag([30.0, 40.0])
    coupled = np.array([[2.0, 0.7], [0.7, 0.5]])
    found = loop_gains(lambda _: (D, D), [
        coupled, 3.0 * coupled, np.array([[1.0, -4.0], [-4.0, 20.0]])])
    assert found.noise == pytest.approx(np.array([[180.0, 160.0], [120.0, 800.0]]))


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


def test_without_gains_the_scale_is_1_and_no_state_changes_it():
    for one in (stable(None), StableGains(KINDS)):
        for k in range(20):
            assert take(one, SLOW if k else 0.0, Q, V) is V
        assert scales(one) == (1.0, [1.0, 1.0], 1.0)


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


def test_the_slowest_rate_is_where_the_gains_begin_to_be_lowered():
    limit = slowest_rate(loop_of(make_gains(KINDS, [OMEGA])))
    assert after(0.98 / limit).least == 1.0
    assert after(1.02 / limit).least < 1.0
    assert slowest_rate(loop_of(make_gains(KINDS, [0.0]))) == 0.0
    assert slowest_rate(loop_of(make_gains(KINDS, [200.0]))) == math.inf


def test_a_joint_without_feedback_does_not_limit_the_others():
    stiffness, damping = np.diag([0.0, 150.0]), np.diag([0.0, 10.0])
    loop = loop_gains(lambda M: (
        np.linalg.solve(M, stiffness), np.linalg.solve(M, damping)), [M])
    assert loop.crossover[0] == 0.0 < loop.crossover[1]
    gains = stable(loop)
    for k in range(20):
        take(gains, SLOW if k else 0.0, Q, V)
    assert gains.scale == pytest.approx(
        [1.0, loop.lag[1] / loop.crossover[1] / (0.5 * SLOW + LOOP_DELAY)])
    assert gains.reference_scale == pytest.approx(gains.least)


def test_slower_states_lower_the_gains_at_once_and_faster_ones_raise_them_later():
    one = after(FAST)
    assert one.least == 1.0
    for period in (0.02, SLOW):
        assert changes(one, period, 1) == [0]
        assert one.least == pytest.approx(scale_at(period))
    assert changes(one, FAST, 10) == []
    assert len(changes(one, FAST, 500)) > 1
    assert one.least == 1.0


def test_a_period_that_changes_the_scale_by_less_than_a_tenth_leaves_it():
    one = after(SLOW)
    scale = one.least
    assert 1.0 < scale / scale_at(1.1 * SLOW) < 1.1 < scale / scale_at(1.2 * SLOW)
    assert changes(one, 1.1 * SLOW, 200) == []  # some of them are evaluated
    assert changes(one, 1.2 * SLOW, 200) != []
    assert one.least == pytest.approx(scale_at(1.2 * SLOW))


def test_the_mean_period_follows_a_longer_one_slowly():
    gains = after(FAST, 2)
    take(gains, 0.05, Q, ZERO)
    assert gains.period == 0.05
    assert gains.mean_period == pytest.approx(0.5 * (0.002 + 0.05))
    take(gains, 0.002, Q, ZERO)
    assert 0.04 < gains.period < 0.05
    assert gains.lag == 0.5 * (gains.mean_period + LOOP_DELAY)


def test_references_are_slowed_down_for_a_loop_of_less_than_20_rad_per_second():
    """A loop with lower gains by itself does not slow them down, unless it is scaled as well."""
    for omega in (10.0, 20.0, 40.0):
        one = after(SLOW, omega=omega)
        assert one.reference_scale == pytest.approx(
            min(1.0, one.least * omega / min(omega, 20.0)))
    one = after(FAST)
    take(one, SLOW, Q, ZERO)  # one gap
    assert one.reference_scale > 2.0 * one.least
    changes(one, FAST, 400)
    assert one.reference_scale == 1.0


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

@FEW
@given(st.lists(st.integers(1, 6), min_size=1, max_size=4), st.integers(0, 2**32 - 1))
def test_the_noise_is_the_mean_square_of_second_differences(lengths, seed):
    """Without forgetting, and never across a restart."""
    rng, noise = np.random.default_rng(seed), Noise(2)
    second, residual = [np.zeros((0, 2))], [np.zeros((0, 2))]
    for length in lengths:
        noise.restart()
        x, means = rng.normal(size=(2, length, 2))
        for sample, mean in zip(x, means):
            noise.take(sample, 0.0, mean)
        second.append(np.diff(x, n=2, axis=0) ** 2 / 6.0)
        residual.append(2.0 * (0.5 * (x[1:] + x[:-1]) - means[1:])[1:] ** 2)
    squares = [np.concatenate(each) for each in (second, residual)]
    if len(squares[0]) == 0:
        squares = [np.zeros((1, 2))] * 2
    variance, other = (each.mean(axis=0) for each in squares)
    assert noise.deviation == pytest.approx(np.sqrt(variance))
    assert noise.deviation_with_mean == pytest.approx(np.sqrt(np.minimum(variance, other)))


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


@pytest.mark.parametrize('sigma', [(0.4, 0.1), (0.1, 0.4)])
def test_the_noise_of_the_efforts_takes_the_phase_that_the_rate_limit_may_take(sigma):
    """At the scaled crossover s ω_x, the efforts s M D v have the time constant σ / (0.8 τ̇)."""
    rate = np.array([0.25, 0.075]) * OMEGA**2
    one = stable(decoupled(), rate)
    noisy(one, 400, FAST, sigma, of_difference=4.0)
    efforts = np.random.default_rng(0).normal(size=(10000, 2)) * sigma @ M * 2.0 * OMEGA
    times = efforts.std(axis=0) / (math.sqrt(2.0 / math.pi) * rate)
    assert one.least < 0.6
    assert one.least**2 * CROSSOVER * OMEGA * times.max() == pytest.approx(NOISE_LAG, rel=0.2)
    assert 'velocity noise of up to 0.' in str(one)


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


def test_the_difference_of_positions_is_used_from_the_start_and_late_by_half_a_period():
    one, dt = stable(decoupled(), 10.0), 0.02
    assert (noisy(one, 40, dt, [0.4, 0.4])[6:] == 0.0).all()
    assert one.least == pytest.approx(scale_at(2.0 * dt))


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


@pytest.mark.filterwarnings('error')
def test_after_velocities_beyond_any_range_the_noise_is_estimated_again():
    one = after(FAST)
    with np.errstate(over='ignore', invalid='ignore'):
        for k in range(40):
            take(one, FAST, Q, np.full(2, 1e308 if k % 2 else -1e308))
        for _ in range(400):
            take(one, FAST, Q, ZERO)
    assert one.least == 1.0
    assert np.isfinite(one.scale).all()


def test_a_continuous_joint_may_wrap():
    gains = StableGains(('continuous',))
    gains.set_loop_gains(loop_of(make_gains(['a']), np.ones((1, 1, 1))), np.full(1, 10.0))
    rng, used = np.random.default_rng(0), np.zeros(1)
    for k in range(200):
        q = np.array([math.pi - (math.pi - 0.02 * k) % (2.0 * math.pi)])
        used = take(gains, 0.002 if k else 0.0, q, 10.0 + rng.normal(0.0, 0.5, 1))
        if k > 100:
            assert used == pytest.approx(10.0)
    assert gains.differs
