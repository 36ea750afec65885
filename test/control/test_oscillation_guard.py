# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Oscillations of the velocity error: which lower the gains, and which do not."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.oscillation_guard import OscillationGuard

RATES = st.sampled_from([100, 250, 1000])
SIZES = st.floats(1e-3, 3.0)
FEW = settings(max_examples=20)


def scales(signal: FloatArray, rate: int) -> FloatArray:
    """Return the factor (m,) of a joint after each sample of its velocity error."""
    guard, found = OscillationGuard(1), []
    for k, x in enumerate(signal.tolist()):
        guard.take(100.0 + k / rate, np.array([x]))
        found.append(guard.scale[0])
    return np.array(found)


@FEW
@given(RATES, SIZES, st.floats(9.0, 25.0), st.floats(0.0, 3.0), st.floats(0.0, 6.0))
def test_an_oscillation_that_does_not_decay_lowers_the_gains_within_six_periods(
    rate, size, frequency, growth, phase,
):
    t = np.arange(0.0, 6.0 / frequency + 10.0 / rate, 1.0 / rate)
    found = scales(size * np.exp(growth * t) * np.sin(2.0 * np.pi * frequency * t + phase), rate)
    assert found[-1] < 1.0


@FEW
@given(RATES, SIZES, st.floats(3.0, 25.0), st.floats(0.05, 1.0), st.floats(0.0, 6.0))
def test_an_oscillation_that_decays_does_not(rate, size, frequency, damping, phase):
    t = np.arange(0.0, 2.0, 1.0 / rate)
    omega = 2.0 * np.pi * frequency
    signal = size * np.exp(-damping * omega * t) * np.sin(omega * t + phase)
    assert scales(signal, rate)[-1] == 1.0


@FEW
@given(RATES, SIZES, st.floats(0.05, 6.0), st.floats(0.05, 6.0))
def test_smooth_motion_does_not(rate, size, first, second):
    t = 2.0 * np.pi * np.arange(0.0, 3.0, 1.0 / rate)
    assert scales(size * (np.sin(first * t) + np.cos(second * t)), rate)[-1] == 1.0


def test_white_noise_lowers_them_rarely_and_by_one_step():
    """In 10 s, once in 36 runs on average."""
    rng = np.random.default_rng(250)
    sizes = np.exp(rng.uniform(*np.log((1e-3, 3.0)), 10))
    found = np.array([scales(size * rng.standard_normal(2500), 250)[-1] for size in sizes])
    assert found.min() >= 0.7
    assert np.count_nonzero(found < 1.0) <= 2


@pytest.mark.parametrize(('louder', 'is_lowered'), [(3.5, False), (4.5, True)])
def test_an_irregular_oscillation_is_four_times_as_large_as_the_quietest(louder, is_lowered):
    t = np.arange(0.0, 2.0, 0.002)
    wave = np.sin(2.0 * np.pi * 20.0 * t)
    uneven = np.where(wave > 0.0, wave, 0.3 * wave)
    assert (scales(np.where(t < 1.0, 1.0, louder) * uneven, 500)[-1] < 1.0) == is_lowered


@pytest.mark.parametrize(('speed', 'is_lowered'), [(9.5, True), (10.5, False)])
def test_a_twentieth_of_the_velocity_of_the_reference_is_no_oscillation(speed, is_lowered):
    guard = OscillationGuard(1)
    for t in np.arange(0.0, 0.6, 0.002).tolist():
        guard.take(t, np.array([0.5 * np.sin(2.0 * np.pi * 15.0 * t)]), speed)
    assert (guard.scale[0] < 1.0) == is_lowered


@pytest.mark.parametrize('share', [0.18, 0.3])
def test_only_joints_that_oscillate_are_lowered_and_their_frequency_is_known(share):
    """That of the third decays slowly: alone it would not be lowered, but with a fifth it is."""
    guard, lowered, t = OscillationGuard(3), False, 0.0
    while not lowered:
        wave = 0.5 * np.sin(2.0 * np.pi * 15.0 * t)
        lowered = guard.take(t, np.array([wave, 0.0, share * np.exp(-t) * wave]))
        t += 0.002
    assert guard.scale.tolist() == [0.7, 1.0, 0.7 if share == 0.3 else 1.0]
    assert guard.frequency[:2] == pytest.approx([15.0, 0.0], rel=0.05)


@pytest.mark.parametrize(('size', 'is_restored'), [(0.09, True), (0.11, False)])
def test_a_small_oscillation_that_does_not_depend_on_the_gains_restores_them(size, is_restored):
    """At a tenth of the bandwidth, after one second; until then nothing changes."""
    t = np.arange(0.0, 3.0, 0.002)
    wave = np.sin(2.0 * np.pi * 20.0 * t)
    found = scales(size * wave, 500)
    assert 0.1 <= found.min() < 0.1 / 0.7
    assert (found[-1] == 1.0) == is_restored
    if is_restored:
        assert np.count_nonzero(found == found.min()) >= 500
        later = scales(size * np.concatenate((wave, 6.0 * wave)), 500)[len(t):]
        assert later[500] < 1.0  # a larger one counts

