# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Scaled gains: coupled joints, the noise of the joint states, and irregular states."""

from collections.abc import Callable, Sequence
import math

from hypothesis import example, given
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.gain_scaling import (
    CROSSOVER,
    DELAY_LAG,
    FIRST_PERIOD,
    LESS,
    LOOP_DELAY,
    loop_gains,
    LoopGains,
    Noise,
    NOISE_LAG,
    StableGains,
)

OMEGA, FAST, SLOW = 20.0, 0.002, 0.05
M = np.array([[2.0, 0.3], [0.3, 0.5]])
Q, V, NO_LIMIT = np.array([0.3, -0.2]), np.array([0.1, 0.4]), np.full(2, math.inf)

ClosedLoop = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


def impedance(stiffness: Sequence[float], damping: Sequence[float]) -> ClosedLoop:
    """Return the closed loop of these efforts per error."""
    return lambda M: (
        np.linalg.solve(M, np.diag(stiffness)), np.linalg.solve(M, np.diag(damping)))


def decoupled(omega: float = OMEGA) -> LoopGains:
    """Return the loop of computed torque with a damping ratio of 1."""
    return loop_gains(lambda M: (omega**2 * np.eye(2), 2.0 * omega * np.eye(2)), [M])


def stable(loop: LoopGains, effort_rate: FloatArray = NO_LIMIT) -> StableGains:
    one = StableGains(('revolute', 'revolute'))
    one.set_loop_gains(loop, effort_rate)
    return one


def follow(one: StableGains, dt: float, q: FloatArray, v: FloatArray) -> FloatArray:
    """Take a state and return the velocity to use; a change of the scales is reported."""
    before = one.least, one.scale.tolist(), one.reference_scale
    used = one.take(dt, q, v)
    assert one.evaluate() is (before != (one.least, one.scale.tolist(), one.reference_scale))
    return used


# --- the closed loop -----------------------------------------------------------------------------

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
    assert found.frequency == pytest.approx(expected.frequency)


@given(st.floats(0.1, 100.0), st.floats(0.1, 100.0), st.lists(
    st.floats(0.01, 100.0), min_size=1, max_size=4))
@example(100.0, 1.0, [0.1, 10.0])
def test_a_workspace_permits_the_delay_that_each_of_its_poses_permits(stiffness, damping, masses):
    """The damping of an effort leaves a heavy pose the least margin, at the lowest crossover."""

    def loop(M: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.array([[stiffness]]), damping / M

    every = [loop_gains(loop, [np.array([[m]])]) for m in masses]
    found = loop_gains(loop, [np.array([[m]]) for m in masses])
    assert found.lag / found.crossover == pytest.approx(
        min(each.lag / each.crossover for each in every))


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize(('stiffness', 'damping'), [(150.0, 10.0), (0.05, 0.001)])
def test_a_joint_without_feedback_does_not_limit_the_others(stiffness, damping):
    """Nor does it matter how slow the others are."""
    loop = loop_gains(impedance([0.0, stiffness], [0.0, damping]), [M])
    one = loop_gains(impedance([stiffness], [damping]), [1.0 / np.linalg.inv(M)[1:, 1:]])
    assert loop.crossover == pytest.approx([0.0, one.crossover[0]])
    gains = stable(loop)
    for k in range(20):
        follow(gains, SLOW if k else 0.0, Q, V)
    assert gains.scale == pytest.approx(
        [1.0, one.lag[0] / one.crossover[0] / (0.5 * SLOW + LOOP_DELAY)])
    assert gains.least == gains.scale[1] < 1.0
    assert gains.reference_scale == pytest.approx(gains.least)


def test_noise_of_one_velocity_is_an_effort_at_all_joints():
    """The efforts per error of the velocity are those of M(q) K_d, by size, in the worst pose."""
    D = np.diag([30.0, 40.0])
    coupled = np.array([[2.0, 0.7], [0.7, 0.5]])
    found = loop_gains(lambda _: (D, D), [
        coupled, 3.0 * coupled, np.array([[1.0, -4.0], [-4.0, 20.0]])])
    assert found.noise == pytest.approx(np.array([[180.0, 160.0], [120.0, 800.0]]))


# --- the estimate of the noise -------------------------------------------------------------------

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
        used.append(follow(one, dt, q, sigma * rng.normal(size=2)))
    return np.array(used)


@pytest.mark.parametrize('sigma', [(0.4, 0.1), (0.1, 0.4)])
@pytest.mark.parametrize('omega', [OMEGA, 0.4])
def test_the_noise_of_the_efforts_takes_the_phase_that_the_rate_limit_may_take(sigma, omega):
    """At the scaled crossover s ω_x, the efforts s M D v have the time constant σ / (0.8 τ̇)."""
    rate = np.array([0.25, 0.075]) * omega**2
    one = stable(decoupled(omega), rate)
    noisy(one, 400, FAST, sigma, of_difference=4.0)
    efforts = np.random.default_rng(0).normal(size=(10000, 2)) * sigma @ M * 2.0 * omega
    times = efforts.std(axis=0) / (math.sqrt(2.0 / math.pi) * rate)
    assert one.least < 0.6
    assert one.least**2 * CROSSOVER * omega * times.max() == pytest.approx(NOISE_LAG, rel=0.2)


@pytest.mark.parametrize('ratio', [0.6 * LESS, 1.6 * LESS])
def test_noise_that_begins_after_quiet_states_decides_about_the_velocity(ratio):
    """Positions replace velocities that have more than twice their noise, at once for good."""
    one = stable(decoupled(), np.full(2, 10.0))
    noisy(one, 10, FAST, [0.0, 0.0])
    assert one.is_known  # fewer states suffice without noise
    noisy(one, 300, FAST, [0.0, 0.0])
    assert one.least == 1.0
    assert not one.differs
    noisy(one, 200, FAST, [0.4, 0.4], ratio)
    assert one.least < 0.5
    assert one.differs == (ratio < LESS)


def test_the_difference_of_positions_is_used_from_the_start_and_late_by_half_a_period():
    one, dt = stable(decoupled(), np.full(2, 10.0)), 0.02
    assert (noisy(one, 40, dt, [0.4, 0.4])[6:] == 0.0).all()
    assert one.least == pytest.approx(DELAY_LAG / (CROSSOVER * OMEGA * (LOOP_DELAY + dt)))


# --- irregular states ----------------------------------------------------------------------------

@pytest.mark.filterwarnings('error')
def test_only_a_state_that_follows_another_one_has_a_period():
    one = stable(decoupled())
    assert not one.evaluate()
    assert not one.differs
    for dt in (0.01, 0.0, -0.01, 0.8):  # the first one, repeated, earlier, after a pause
        assert one.take(dt, Q, V) is V
        assert not one.evaluate()
    assert one.period == 0.0
    follow(one, FAST, Q, V)
    assert one.period == FAST
    assert str(one).startswith('joint states at 500 Hz')
    assert 'measured velocities' in str(one)


@given(st.floats(FAST, FIRST_PERIOD))
def test_gains_before_the_rate_is_known_are_at_most_those_of_that_rate(period):
    """Else noise of the first slow states moves the arm as with the gains of fast ones."""
    one = stable(decoupled())
    first = one.scale
    follow(one, 0.0, Q, V)
    follow(one, period, Q, V)
    assert (first <= one.scale).all()


def test_pauses_in_a_row_are_the_period_up_to_a_second():
    one = stable(decoupled())
    for dt, period in ((0.0, 0.0), (FAST, FAST), (0.7, FAST), (0.8, 0.8), (0.9, 0.9), (3.0, 1.0)):
        follow(one, dt, Q, V)
        assert one.period == period
