# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Gains within the limits by rate and noise of the joint states."""

from collections.abc import Sequence
import math

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.control.gains.gain_scaling import (
    CROSSOVER,
    DELAY_LAG,
    LOOP_DELAY,
    LoopGains,
    slowest_rate,
    StableGains,
    USUAL_FREQUENCY,
    USUAL_MARGIN,
)
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.references.motion_limits import WorkspaceInertia
from tracking_loop import loop_of

ARM = load_arm(default_arm_urdf())
WORKSPACE = WorkspaceInertia(ArmDynamics(ARM))
GAINS = make_gains(ARM.joint_names)
RATE = ARM.limits.effort / 0.1
KINDS = ('revolute', 'revolute')
OMEGA = 20.0
NO_LIMIT = np.full(2, math.inf)
Q, V = np.array([0.3, -0.2]), np.array([0.1, 0.4])
FAST, SLOW = 0.002, 0.05
DEFAULT = loop_of(GAINS, WORKSPACE.matrices)


def observing(
    loop: LoopGains | None, rate: float | np.ndarray = math.inf, kinds: Sequence[str] = KINDS,
) -> StableGains:
    """Return gains without states."""
    one = StableGains(kinds)
    one.set_loop_gains(loop, np.full(len(kinds), rate))
    return one


def scales(one: StableGains) -> tuple[float, list[float], float]:
    return one.least, one.scale.tolist(), one.reference_scale


def take(
    one: StableGains, dt: float, q: np.ndarray, v: np.ndarray, velocity_delay: float = 0.0,
) -> np.ndarray:
    """Take a state and evaluate it; return the velocity to use."""
    used = one.take(dt, q, v, velocity_delay)
    before = scales(one)
    assert one.evaluate() or before == scales(one)
    assert not one.evaluate()  # a state is evaluated once
    return used


# --- states --------------------------------------------------------------------------------------

def observe(
    rate: float, noise: float = 0.0, resolution: float = 0.0, count: int = 400,
) -> tuple[StableGains, float]:
    """Return the gains after a smooth motion, and the deviation [rad/s] of the used velocity."""
    rng, gains = np.random.default_rng(1), observing(DEFAULT, RATE)
    errors, dt = [], 1.0 / rate
    for k in range(count):
        t = k * dt
        q, v = np.full(2, 0.5 * math.sin(t)), np.full(2, 0.5 * math.cos(t))
        if resolution:
            q = resolution * np.round(q / resolution)
        used = take(gains, dt if k else 0.0, q, v + rng.normal(0.0, noise, 2))
        if k > count // 2:
            errors.append(used - v)
    return gains, float(np.std(errors))


def test_fast_states_without_noise_leave_the_gains_and_the_velocity_as_they_are():
    gains, error = observe(500.0)
    assert scales(gains) == (1.0, [1.0, 1.0], 1.0)
    assert not gains.differs
    assert error == 0.0
    assert gains.period == pytest.approx(0.002)
    assert gains.mean_period == pytest.approx(0.002, rel=0.05)  # over 0.2 s


def test_the_slowest_rate_is_where_the_gains_begin_to_be_lowered():
    limit = slowest_rate(DEFAULT)
    assert observe(1.02 * limit)[0].least == 1.0
    assert observe(0.98 * limit)[0].least < 1.0
    assert slowest_rate(loop_of(make_gains(ARM.joint_names, [0.0]))) == 0.0
    assert slowest_rate(loop_of(make_gains(ARM.joint_names, [200.0]))) == math.inf


def test_a_noisy_velocity_is_replaced_by_the_difference_of_positions():
    gains, error = observe(500.0, noise=0.2)
    assert gains.differs
    assert gains.least > 0.9
    assert error < 0.01
    assert 'differences of the positions in use' in str(gains)


def test_harmless_noise_does_not_change_the_velocity():
    """At 30 Hz the delay lowers the gains more, and the difference of positions is later still."""
    rng, one = np.random.default_rng(1), observing(DEFAULT, RATE)
    for k in range(400):
        noise = rng.normal(0.0, 0.03, 2) if k > 100 else 0.0
        take(one, 1.0 / 30.0 if k else 0.0, Q, noise + np.zeros(2))
        assert not one.differs
    assert one._is_noisy
    assert one.least == pytest.approx(observe(30.0)[0].least)


def test_if_both_are_noisy_the_gains_are_lowered():
    gains, _ = observe(500.0, noise=0.2, resolution=2e-3)
    assert not gains.differs
    assert gains.least < 0.5
    assert 'velocity noise of up to 0.2' in str(gains)


@given(
    st.sampled_from([30.0, 100.0, 125.0, 500.0]), st.floats(0.3, 1.5), st.floats(0.0, 2.0),
    st.floats(-3.0, 3.0))
def test_a_motion_is_no_noise(rate, frequency, speed, phase):
    """At 30 Hz the second difference of such a velocity is up to 0.19 rad/s."""
    one, w = observing(DEFAULT, RATE), 2.0 * math.pi * frequency
    for k in range(200):
        x = w * k / rate + phase
        take(one, 1.0 / rate if k else 0.0, np.full(2, speed / w * math.sin(x)),
             np.full(2, speed * math.cos(x)))
        assert not one.is_known or one.scale == pytest.approx(scale_at(1.0 / rate))


def test_a_longer_period_counts_at_once_and_a_shorter_one_later():
    gains = after(FAST, 2)
    take(gains, 0.05, Q, np.zeros(2))
    assert gains.period == 0.05
    assert gains.mean_period == pytest.approx(0.5 * (0.002 + 0.05))
    take(gains, 0.002, Q, np.zeros(2))
    assert 0.04 < gains.period < 0.05
    assert gains.mean_period < gains.period
    assert gains.lag == 0.5 * (gains.mean_period + LOOP_DELAY)


def test_a_continuous_joint_may_wrap():
    gains = observing(
        loop_of(make_gains(['a']), np.ones((1, 1, 1))), 10.0, ('continuous',))
    rng, used = np.random.default_rng(0), np.zeros(1)
    for k in range(200):
        q = np.array([math.pi - (math.pi - 0.02 * k) % (2.0 * math.pi)])
        used = take(gains, 0.002 if k else 0.0, q, 10.0 + rng.normal(0.0, 0.5, 1))
        if k > 100:
            assert used == pytest.approx(10.0)
    assert gains.differs


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('size', [1e160, 1e308])
def test_after_velocities_beyond_any_range_the_noise_is_estimated_again(size):
    one = after(FAST)
    with np.errstate(over='ignore', invalid='ignore'):
        for k in range(40):
            take(one, FAST, Q, np.full(2, size if k % 2 else -size))
        for _ in range(400):
            take(one, FAST, Q, np.zeros(2))
    assert one.least == 1.0
    assert np.isfinite(one.scale).all()


# --- when the scale changes ----------------------------------------------------------------------

def scale_at(period: float, omega: float = OMEGA) -> float:
    """Return the scale for states without noise."""
    return min(1.0, DELAY_LAG / (CROSSOVER * omega * (0.5 * period + LOOP_DELAY)))


def after(
    period: float, count: int = 100, omega: Sequence[float] = (OMEGA,),
    ratio: Sequence[float] = (1.0,),
) -> StableGains:
    """Return the gains after `count` states at rest with this period [s]."""
    one = observing(loop_of(make_gains(KINDS, omega, ratio)))
    for k in range(count):
        take(one, period if k else 0.0, Q, np.zeros(2))
    return one


def changes(one: StableGains, period: float, count: int) -> list[int]:
    """Take more states at rest; return which of them changed a scale."""
    changed = []
    for k in range(count):
        before = scales(one)
        take(one, period, Q, np.zeros(2))
        if scales(one) != before:
            changed.append(k)
    return changed


@pytest.mark.parametrize('is_used', [False, True])
def test_without_gains_the_scale_is_1_and_no_state_changes_it(is_used):
    one = observing(None) if is_used else StableGains(KINDS)
    for k in range(20):
        assert take(one, SLOW if k else 0.0, Q, V) is V
    assert scales(one) == (1.0, [1.0, 1.0], 1.0)


@pytest.mark.parametrize('period', [FAST, 0.02, SLOW])
def test_the_scale_is_that_of_the_period(period):
    """The velocities count as measured: without the delay of an estimate."""
    one = after(period)
    assert one.least == pytest.approx(scale_at(period))
    assert one.scale == pytest.approx(np.full(2, one.least))
    assert 'measured velocities' in str(one)
    assert changes(one, period, 100) == []


@pytest.mark.parametrize('ratio', [0.05, 0.3, 1.0, 2.0])
def test_a_low_damping_ratio_has_a_smaller_margin_and_scale(ratio):
    """The phase lag of the delay stays below the same fraction of the margin."""
    crossover = loop_of(make_gains(KINDS, [OMEGA], [ratio])).crossover[0]
    lag = after(SLOW, ratio=[ratio]).least * crossover * (0.5 * SLOW + LOOP_DELAY)
    margin = math.atan(2.0 * ratio * crossover / OMEGA)
    assert lag == pytest.approx(DELAY_LAG * min(1.0, margin / USUAL_MARGIN))
    assert lag < 0.4 * margin


def test_an_estimated_velocity_is_later_than_a_measured_one():
    one, delay = after(SLOW), 0.02
    measured = one.least
    for _ in range(200):
        take(one, SLOW, Q, np.zeros(2), delay)
    assert one.least == pytest.approx(
        measured * (0.5 * SLOW + LOOP_DELAY) / (0.5 * SLOW + LOOP_DELAY + delay))
    assert 'estimated velocities' in str(one)


def test_states_that_come_slower_lower_the_gains_at_once():
    one = after(FAST)
    assert one.least == 1.0
    for period in (0.02, SLOW):  # twice: compared with the period of the last evaluation
        assert changes(one, period, 1) == [0]
        assert one.least == pytest.approx(scale_at(period))


def test_a_period_that_changes_the_scale_by_less_than_a_tenth_leaves_it():
    one = after(SLOW)
    scale = one.least
    assert 1.0 < scale / scale_at(1.1 * SLOW) < 1.1
    assert changes(one, 1.1 * SLOW, 200) == []  # some of them are evaluated
    assert one.least == scale
    assert scale / scale_at(1.2 * SLOW) > 1.1
    assert changes(one, 1.2 * SLOW, 200) != []
    assert one.least == pytest.approx(scale_at(1.2 * SLOW))


def test_states_that_come_faster_raise_the_gains_later():
    one = after(SLOW)
    assert changes(one, FAST, 10) == []
    assert len(changes(one, FAST, 500)) > 1
    assert one.least == 1.0


def test_other_gains_are_scaled_at_once_for_any_change():
    one = after(SLOW)
    omega = 1.02 * OMEGA
    one.set_loop_gains(loop_of(make_gains(KINDS, [omega])), NO_LIMIT)
    assert one.least == pytest.approx(scale_at(SLOW, omega))
    one.set_loop_gains(None, NO_LIMIT)
    assert scales(one) == (1.0, [1.0, 1.0], 1.0)


# --- references ----------------------------------------------------------------------------------

def test_references_are_slowed_down_for_a_loop_of_less_than_the_usual_bandwidth():
    """Gains that are lower by themselves are not, unless they are scaled as well."""
    for omega in (10.0, 20.0, 40.0):
        one = after(SLOW, omega=[omega])
        bandwidth = one.least * omega
        assert one.reference_scale == pytest.approx(
            min(1.0, bandwidth / min(omega, USUAL_FREQUENCY)))


def test_one_gap_lowers_the_gains_and_slows_references_down_less():
    one = after(FAST)
    take(one, SLOW, Q, np.zeros(2))
    assert one.least == pytest.approx(scale_at(SLOW))
    assert one.reference_scale > 2.0 * one.least
    changes(one, FAST, 400)
    assert one.reference_scale == 1.0


def noisy(effort_rate: float) -> StableGains:
    """Take states until their noise is known."""
    one, rng = after(FAST, 0), np.random.default_rng(1)
    one.set_loop_gains(loop_of(make_gains(KINDS, [OMEGA])), np.full(2, effort_rate))
    for k in range(17):
        q, v = (rng.normal(0.0, [[0.002], [0.5]], (2, 2)) if k < 16 else np.zeros((2, 2)))
        take(one, FAST if k else 0.0, Q + q, v)
        assert one.is_known == (k == 16)
    return one


def test_references_are_slowed_down_if_noise_allows_no_more_than_the_first_scale():
    """Until the noise is known, gains have half of the bandwidth, and references full speed."""
    one = noisy(100.0)
    assert one.reference_scale == one.least < 0.5
    one = noisy(100.0 * (0.52 / one.least) ** 2)
    assert one.reference_scale == one.least == pytest.approx(0.52)
