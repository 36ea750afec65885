# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Oscillations of the velocity error: which lower the gains, for how long, and which do not."""

from hypothesis import given, settings
from hypothesis import strategies as st
from lock_step_loop import directions, LockStep, smooth_arm
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.gain_scaling import StableGains
from robot_dynamics.control.gains.oscillation import Oscillation

RATES = st.sampled_from([125, 250, 1000])
SIZES = st.floats(0.05, 3.0)
FEW = settings(max_examples=20)


def oscillation(sigma: float = 0.0) -> Oscillation:
    """Return the oscillations of a joint whose velocity has this noise [rad/s]."""
    gains = StableGains(1)
    gains.noise = np.array([sigma])
    return Oscillation(['joint'], gains)


def factors(signal: FloatArray, rate: int, sigma: float = 0.0) -> FloatArray:
    """Return the factor (m,) after each sample of the velocity error of a joint."""
    one, found = oscillation(sigma), []
    for k in range(len(signal)):
        one.take(100.0 + k / rate, np.zeros(1), signal[k:k + 1])
        found.append(one.factor)
    return np.array(found)


@FEW
@given(RATES, SIZES, st.floats(18.0, 25.0), st.floats(0.0, 3.0), st.floats(0.0, 6.0))
def test_an_oscillation_that_does_not_decay_lowers_the_gains_within_seven_periods(
    rate, size, frequency, growth, phase,
):
    t = np.arange(0.0, 7.0 / frequency + 10.0 / rate, 1.0 / rate)
    signal = size * np.exp(growth * t) * np.sin(2.0 * np.pi * frequency * t + phase)
    assert 0.4 < factors(signal, rate)[-1] < 0.71


def wave(seconds: float, begins: float, ends: float) -> FloatArray:
    """Return an oscillation of 15 Hz at full gains between two times, 500 Hz."""
    t = np.arange(0.0, seconds, 0.002)
    return np.where((t >= begins) & (t < ends), np.sin(2.0 * np.pi * 15.0 * t), 0.0)


def test_the_factor_has_a_lower_bound():
    assert 0.1 <= factors(wave(5.0, 0.0, 5.0), 500)[-1] < 0.15


def test_the_full_gains_are_tried_again_after_one_second_and_then_ever_more_rarely():
    one, lowered = oscillation(), []
    for k in range(60 * 500):
        before = one.factor
        x = np.array([np.sin(0.06 * np.pi * k)]) * (before == 1.0)  # it oscillates at full gains
        one.take(0.002 * k, np.zeros(1), x)
        if one.factor < before:
            lowered.append(0.002 * k)
    assert str(one) == "'joint' oscillated with 15 Hz: all gains are at 0.70 of their bandwidth"
    assert np.diff(lowered) == pytest.approx([1.3, 2.3, 4.3, 8.3, 16.3], abs=0.1)


def test_a_joint_that_yields_gets_the_full_gains_at_once():
    one, moved = oscillation(), 0.0
    for k in range(20 * 500):
        t = 0.002 * k
        moved = 0.03 if t > 10.0 else 0.0
        x = np.array([np.sin(30.0 * np.pi * t)]) * (one.factor == 1.0) * (moved == 0.0)
        one.take(t, np.array([moved]), x)
        if t > 9.0:
            assert (one.factor < 1.0) == (moved == 0.0)


@pytest.mark.parametrize('seconds', [1.0, 5.0, pytest.param(20.0, marks=pytest.mark.soak)])
def test_two_seconds_after_a_contact_the_gains_are_as_before(seconds, seen):
    """A stiff wall is 0.2 rad away from the arm, and its goal 0.3 rad beyond."""
    one = LockStep(smooth_arm('default'), rate=500.0, delay=8)
    one.run(0.5)
    before, home, wall = gains(one), one.q, one.q[1] + 0.2
    goal = home.copy()
    goal[1] += 0.5
    one.follow(goal)
    one.push = lambda t: np.eye(len(home))[1] * min(1e5 * (wall - one.q[1]), 0.0)
    lowest = before
    for _ in range(round(5.0 * seconds)):
        one.run(0.2)
        lowest = min(lowest, gains(one))
    one.push = lambda t: 0.0
    one.follow(home)
    one.run(2.0)
    seen(f'{lowest / before:.3f} of the gains')
    assert lowest < 0.9 * before
    assert gains(one) > 0.95 * before
    assert one.loop.supervisor.fault_count == 0


def gains(one: LockStep) -> float:
    return float(one.loop.controller.laws.feedback_gains[1].min())


@pytest.mark.parametrize('seed', [
    *range(4), *(pytest.param(seed, marks=pytest.mark.soak) for seed in range(4, 60))])
def test_a_stable_loop_never_lowers_its_gains(seed, seen):
    """Noise, delays of up to 8 ms, steps, streams of set-points."""
    rng = np.random.default_rng(seed)
    name = str(rng.choice(['default', 'ur5', 'ur10', 'panda', 'xarm7', 'kinova', 'z1']))
    one = LockStep(smooth_arm(name), rate=float(rng.choice([125, 250, 500, 1000])),
                   delay=int(rng.integers(0, 9)))
    sigma, n = float(rng.choice([0.0, 1e-3, 0.02])), len(one.q)
    one.sensor = lambda q, v: (
        q + 1e-3 * sigma * rng.standard_normal(n), v + sigma * rng.standard_normal(n))
    home, factor = one.q, 1.0
    one.run(0.3)
    for way in (0.3, -0.2):
        one.follow(home + way * directions(n) * rng.uniform(0.0, 1.0, n))
        for _ in range(10):
            one.run(0.1)
            factor = min(factor, one.loop.controller.laws.oscillation.factor)
    for k in range(40):
        one.follow(one.q + 0.02 * directions(n) * np.sin(0.3 * k))
        one.run(0.02)
        factor = min(factor, one.loop.controller.laws.oscillation.factor)
    seen(f'{name} {one.period} ms, delay {one.delay} ms, noise {sigma}')
    assert factor == 1.0
