# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Oscillations of the velocity error: which lower the gains, and which do not."""

from collections.abc import Sequence
import math

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.oscillation_guard import (
    _Noise,
    HALF_WAVES,
    HARMLESS,
    HIGHER,
    LEAST,
    LONGEST,
    LOUD,
    NOISE_FACTOR,
    OscillationGuard,
    REGULAR,
    RIPPLE,
    SETTLING,
    SHARE,
    STEP,
    SUSTAINED,
    WINDOW,
)

RATES = st.sampled_from([100, 125, 250, 500, 1000])
SIZES = st.floats(1e-3, 3.0)


def scales(signal: FloatArray, rate: int) -> FloatArray:
    """Return the factor (m,) of a joint after each sample of its velocity error."""
    guard, found = OscillationGuard(1), []
    for k, x in enumerate(signal.tolist()):
        guard.take(100.0 + k / rate, np.array([x]))
        found.append(guard.scale[0])
    return np.array(found)


@settings(max_examples=60, deadline=None)
@given(RATES, SIZES, st.floats(9.0, 25.0), st.floats(0.0, 3.0), st.floats(0.0, 6.0))
def test_an_oscillation_that_does_not_decay_lowers_the_gains_in_time(
    rate, size, frequency, growth, phase,
):
    t = np.arange(0.0, 2.0, 1.0 / rate)
    found = scales(size * np.exp(growth * t) * np.sin(2.0 * np.pi * frequency * t + phase), rate)
    assert found[round(rate * (HALF_WAVES + 4) * 0.5 / frequency) + 10] < 1.0


@pytest.mark.parametrize('rate', [100, 125, 250, 500, 1000])
def test_an_oscillation_of_two_frequencies_lowers_the_gains(rate):
    """It looks like noise, but there was less before; of 0.01 rad or more 1 of 1,000 is missed."""
    rng, t = np.random.default_rng(rate), 2.0 * np.pi * np.arange(0.0, 3.0, 1.0 / rate)
    found = []
    for _ in range(40):
        frequency, ratio = rng.uniform(14.0, 20.0), rng.uniform(1.5, 2.2)
        signal = np.sin(frequency * t) + np.sin(ratio * frequency * t)
        signal[:rate] = 0.0
        signal += 0.05 * rng.standard_normal(len(t))
        found.append(scales(np.exp(rng.uniform(*np.log((0.01, 3.0)))) * signal, rate).min())
    assert np.count_nonzero(np.array(found) < 1.0) >= 39


@settings(max_examples=60, deadline=None)
@given(RATES, SIZES, st.floats(3.0, 25.0), st.floats(0.05, 1.0), st.floats(0.0, 6.0))
def test_an_oscillation_that_decays_does_not(rate, size, frequency, damping, phase):
    t = np.arange(0.0, 3.0, 1.0 / rate)
    omega = 2.0 * np.pi * frequency
    signal = size * np.exp(-damping * omega * t) * np.sin(omega * t + phase)
    assert scales(signal, rate)[-1] == 1.0


@pytest.mark.parametrize('rate', [100, 125, 250, 500, 1000])
def test_white_noise_lowers_them_rarely_and_by_one_step(rate):
    """In 10 s, once in 36 runs on average."""
    rng = np.random.default_rng(rate)
    sizes = np.exp(rng.uniform(*np.log((1e-3, 3.0)), 40))
    found = np.array([
        scales(size * rng.standard_normal(10 * rate), rate)[-1] for size in sizes])
    assert found.min() >= STEP
    assert np.count_nonzero(found < 1.0) <= 5


@settings(max_examples=30, deadline=None)
@given(RATES, SIZES, st.floats(0.05, 6.0), st.floats(0.05, 6.0))
def test_smooth_motion_does_not(rate, size, first, second):
    t = 2.0 * np.pi * np.arange(0.0, 5.0, 1.0 / rate)
    assert scales(size * (np.sin(first * t) + np.cos(second * t)), rate)[-1] == 1.0


def test_only_the_joint_that_oscillates_is_lowered_and_its_frequency_is_known():
    guard = OscillationGuard(2)
    for t in np.arange(0.0, 0.35, 0.002).tolist():
        guard.take(t, np.array([0.01 * np.sin(2.0 * np.pi * 15.0 * t), 0.0]))
    assert guard.scale.tolist() == [STEP, 1.0]
    assert guard.frequency == pytest.approx([15.0, 0.0], rel=0.05)


@pytest.mark.parametrize('share', [0.9 * SHARE, 1.5 * SHARE])
def test_joints_that_oscillate_together_are_lowered_together(share):
    """The oscillation of the third decays slowly: alone it would not be lowered."""
    guard, lowered = OscillationGuard(3), 0
    for t in np.arange(0.0, 1.0, 0.002).tolist():
        wave = 0.5 * np.sin(2.0 * np.pi * 15.0 * t)
        lowered += guard.take(t, np.array([wave, 0.0, share * np.exp(-t) * wave]))
        if lowered:
            break
    assert guard.scale.tolist() == [STEP, 1.0, STEP if share > SHARE else 1.0]


@pytest.mark.parametrize(('count', 'is_lowered'), [(HALF_WAVES - 1, False), (HALF_WAVES, True)])
def test_a_joint_is_lowered_with_another_after_as_many_half_waves(count, is_lowered):
    """Its oscillation decays: alone it would not be lowered."""
    guard, wave = OscillationGuard(2), half_waves(np.ones(HALF_WAVES + 1))
    index = np.arange(len(wave)) // 25
    other = 0.95**index * wave * (index >= HALF_WAVES - count)
    for k, (x, y) in enumerate(zip(wave, other)):
        guard.take(100.0 + 0.001 * k, np.array([x, y]))
    assert guard.scale.tolist() == [STEP, STEP if is_lowered else 1.0]


def test_an_oscillation_that_does_not_depend_on_the_gains_restores_them_for_good():
    t = np.arange(0.0, 60.0, 0.002)
    wave = np.sin(2.0 * np.pi * 20.0 * t)
    found = scales(0.01 * wave, 500)
    assert LEAST <= found.min() < LEAST / STEP
    assert (found[-20000:] == 1.0).all()
    later = scales(np.concatenate((0.01 * wave, 2.0 * HIGHER * 0.01 * wave)), 500)[len(t):]
    assert later[500] < 1.0 == later[-1]  # a larger one counts, and is judged in the same way


@pytest.mark.parametrize(('share', 'lowers'), [(0.9, False), (1.1, True)])
def test_a_ripple_of_the_reference_is_no_oscillation_of_the_loop(share, lowers):
    guard, size = OscillationGuard(1), share * RIPPLE * 2.0
    for t in np.arange(0.0, 1.0, 0.002).tolist():
        guard.take(t, np.array([size * np.sin(2.0 * np.pi * 25.0 * t)]), 2.0)
    assert (guard.scale[0] < 1.0) == lowers


@pytest.mark.parametrize(('share', 'restores'), [(0.9, True), (1.1, False)])
def test_an_oscillation_at_the_least_gains_is_judged_after_it_has_settled(share, restores):
    """Until then nothing changes, and no change is reported; a large one is never left alone."""
    rate, guard, changes, rows, before = 500, OscillationGuard(1), [], [], 1.0
    for k in range(3 * rate):
        x = np.array([share * HARMLESS * np.sin(2.0 * np.pi * 20.0 * k / rate)])
        changed = guard.take(100.0 + k / rate, x)
        assert changed is (float(guard.scale[0]) != before)
        before = float(guard.scale[0])
        if changed:
            changes.append(before)
            rows.append(k)
    assert min(changes) >= LEAST
    assert (changes[-1] == 1.0) == restores  # it does not depend on the gains
    assert not restores or rows[-1] - rows[-2] >= rate * SETTLING


# --- exact bounds, by half-waves of one sample per millisecond -----------------------------------

def half_waves(peaks: Sequence[float], duration: int | Sequence[int] = 25) -> FloatArray:
    """Return half-waves with alternating signs, each of `duration` samples."""
    durations = np.broadcast_to(duration, len(peaks)).tolist()
    return np.concatenate([
        (-1)**k * peak * np.sin(np.pi * (np.arange(n) + 0.5) / n)
        for k, (peak, n) in enumerate(zip(peaks, durations))])


def lowered_at(signal: FloatArray) -> list[int]:
    """Return the samples after which the factor changed."""
    found = scales(signal, 1000)
    return np.flatnonzero(np.diff(found, prepend=1.0)).tolist()


def test_an_event_ends_with_the_first_sample_after_its_half_waves():
    """The half-wave that begins with the signal counts, although its duration is not known."""
    assert lowered_at(half_waves(np.ones(HALF_WAVES))) == []
    assert lowered_at(half_waves(np.ones(HALF_WAVES + 1))) == [25 * HALF_WAVES]


@pytest.mark.parametrize(('peaks', 'lowers'), [
    ([1.0] * 4 + [SUSTAINED] * 4, True),
    ([1.0] * 4 + [0.98 * SUSTAINED] * 4, False),
    ([0.5, 1.0, 0.5, 0.5, 0.5, 0.5, 1.02 * SUSTAINED, 0.5], True),
    ([0.5, 1.0, 0.5, 0.5, 0.5, 0.5, 0.98 * SUSTAINED, 0.5], False),
    ([0.1] * 4 + [1.0, REGULAR, 1.0, 1.0], True),
    ([0.1] * 4 + [1.0, 0.98 * REGULAR, 1.0, 1.0], False),
])
def test_an_event_is_sustained_and_regular(peaks, lowers):
    """The bounds belong to an event; a half-wave of 25 samples contains its peak."""
    assert bool(lowered_at(half_waves([*peaks, 0.5]))) == lowers


@pytest.mark.parametrize(('factor', 'lowers'), [(0.98, True), (1.03, False)])
def test_half_waves_of_an_event_are_short(factor, lowers):
    """A long one begins the count again."""
    durations = [25] * 12
    durations[5] = round(1000 * factor * LONGEST)
    found = lowered_at(half_waves(np.ones(12), durations))
    assert found[:1] == ([sum(durations[:HALF_WAVES])] if lowers else [])


def test_the_frequency_is_that_of_the_last_half_waves():
    guard = OscillationGuard(1)
    for k, x in enumerate(half_waves(np.ones(9), [50] * 4 + [20] * 5).tolist()):
        guard.take(100.0 + 0.001 * k, np.array([x]))
    assert guard.frequency == pytest.approx([25.0])


@pytest.mark.parametrize(('factor', 'lowers'), [(0.95, False), (1.05, True)])
def test_irregular_half_waves_count_if_they_are_loud(factor, lowers):
    """The quietest window is that before; the peaks differ too much for a regular event."""
    quiet, loud = [1.0, 0.3] * 8, [1.0, 0.3] * 9
    signal = np.concatenate((
        half_waves(quiet, 26), factor * LOUD * half_waves(loud, 26)))
    assert bool(lowered_at(signal)) == lowers


@pytest.mark.parametrize(('last', 'lowers'), [(1.05 * SUSTAINED, True), (0.95 * SUSTAINED, False)])
def test_irregular_half_waves_count_if_they_are_sustained(last, lowers):
    """After rest every window is loud; the second one ends with the sample that follows it."""
    count = math.ceil(1000 * WINDOW / 26)
    peaks = np.array([1.0, 0.3] * (count + 1))[:2 * count + 1]
    peaks[count:] *= last
    signal = np.concatenate((np.zeros(100), half_waves(peaks, 26)))
    assert lowered_at(signal) == ([100 + 52 * count] if lowers else [])


def test_irregular_half_waves_count_in_two_successive_windows():
    wave = 3.0 * half_waves([1.0, 0.3] * 5, 26)
    assert lowered_at(np.concatenate([np.zeros(100), wave] * 3)) == []
    assert lowered_at(np.concatenate([np.zeros(100), wave, wave])) != []


@pytest.mark.parametrize(('growth', 'lowers'), [(1.015, False), (1.05, True)])
def test_the_quietest_window_is_forgotten_in_favour_of_slowly_growing_ones(growth, lowers):
    count = round(1000 * WINDOW / 25)
    peaks = np.repeat(1e-3 * growth**np.arange(100), count) * np.tile([1.0, 0.3], 50 * count)
    assert bool(lowered_at(half_waves(peaks))) == lowers


def test_a_joint_that_oscillated_before_is_not_lowered_with_another():
    guard, t = OscillationGuard(2), np.arange(0.0, 2.0, 0.002)
    wave = np.sin(2.0 * np.pi * 15.0 * t)
    error = np.stack([wave * (t > 1.3), 50.0 * wave * np.exp(-5.0 * t) * (t < 0.6)], axis=1)
    for now, x in zip(t.tolist(), error):
        guard.take(now, x)
    assert guard.scale[0] < guard.scale[1] == 1.0


def test_a_signal_that_never_was_quieter_is_no_oscillation():
    assert lowered_at(half_waves([1.0, 0.3] * 40)) == []


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(-2.0, 2.0), st.integers(3, 40))
def test_the_noise_is_the_residual_of_a_recursion(seed, a, count):
    """The variance of the least-squares residual of x[k+1] + x[k-1] = a x[k] is (2 + a²) σ²."""
    rng, noise = np.random.default_rng(seed), _Noise()
    x = rng.standard_normal(count)
    y = a * x + rng.standard_normal(count)
    for k in range(count):
        noise.take(1.0 / (k + 1), 0.3 * y[k], x[k], 0.7 * y[k])
    slope = np.dot(x, y) / np.dot(x, x)
    sigma = np.sqrt(np.mean((y - slope * x)**2) / (2.0 + slope**2))
    assert noise.explains(0.99 * NOISE_FACTOR * sigma)
    assert noise.explains(-0.99 * NOISE_FACTOR * sigma)
    assert not noise.explains(1.01 * NOISE_FACTOR * sigma)
