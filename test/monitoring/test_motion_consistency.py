# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Measured velocities against measured positions: no false alarms."""

import math

from consistency_signals import (
    FINE,
    N,
    no_alarm,
    RATES,
    regular,
    sampled,
    smooth_motion,
    States,
)
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from recordings import NO_ROSBAG2, ROSBAG2
from robot_dynamics.arrays import FloatArray
from robot_dynamics.recordings.reader import Recording

UR10 = ROSBAG2.parent / 'ur10'
RECORDINGS = [UR10, ROSBAG2 / 'mcap', ROSBAG2 / 'sqlite3_lock_step']


def filtered(v: FloatArray, delay: float, order: int) -> FloatArray:
    """Return v through a low-pass filter with this delay [s]; order 0 is a pure delay."""
    if order == 0:
        late = round(delay / FINE)
        return np.concatenate((np.repeat(v[:1], late, axis=0), v[:len(v) - late]))
    for _ in range(order if delay > 0.0 else 0):
        weight, result = 1.0 - math.exp(-FINE * order / delay), np.empty_like(v)
        state = v[0]
        for k, value in enumerate(v):
            state = state + weight * (value - state)
            result[k] = state
        v = result
    return v


# --- no false alarms -----------------------------------------------------------------------------

@settings(max_examples=25)
@given(
    st.integers(0, 10**6), st.sampled_from(RATES), st.sampled_from((0.1, 1.0, 3.0)),
    st.sampled_from((0.0, 0.02, 0.2)), st.sampled_from((0.0, 0.005, 0.015)),
    st.integers(0, 2), st.sampled_from((0.0, 1e-4, 1e-3)), st.sampled_from((0.85, 1.0, 1.2)))
def test_consistent_motion_is_never_in_doubt(
    seed, rate, speed, noise, delay, order, resolution, scale,
):
    """Noise, filters, encoder resolution, wrong scale, jitter of the stamps, whole turns."""
    rng = np.random.default_rng(seed)
    t, q, v = smooth_motion(rng, 2.5, speed)
    times = regular(t, rate)
    times = np.sort(times + rng.uniform(0.0, 0.4 / rate, len(times)))
    states = sampled(t, q, filtered(v, delay, order), times)
    measured = states.q if resolution == 0.0 else resolution * np.round(states.q / resolution)
    measured[:, 1] = np.mod(measured[:, 1] + np.pi, 2.0 * np.pi) - np.pi
    no_alarm(States(
        states.stamps, measured, scale * states.v + rng.normal(0.0, noise, states.v.shape)))


@settings(max_examples=15)
@given(st.integers(0, 10**6), st.floats(0.02, 0.2), st.sampled_from((0.0, 0.2)))
def test_gaps_changes_of_the_rate_and_repeated_stamps(seed, gap, noise):
    rng = np.random.default_rng(seed)
    t, q, v = smooth_motion(rng, 4.0, 2.0)
    steps = np.concatenate([np.full(round(0.8 * rate), 1.0 / rate) for rate in (
        500, 100, 30, 1000, 250)])
    steps[rng.choice(len(steps), 20, replace=False)] += rng.uniform(0.01, gap, 20)
    steps[rng.choice(len(steps), 20, replace=False)] = 0.0
    times = np.cumsum(steps)
    states = sampled(t, q, v, times[times < t[-1]])
    no_alarm(states._replace(v=states.v + rng.normal(0.0, noise, states.v.shape)))


@pytest.mark.parametrize('rate', [30, 125, 500])
@pytest.mark.parametrize(('before', 'after'), [(0.0, 1.0), (1.0, -0.7), (2.0, 0.0)])
def test_impacts_are_no_contradiction(rate, before, after):
    """The velocity changes between two samples, at any phase of the sampling."""
    t = np.arange(0.0, 3.0, FINE)
    v = np.where(t < 2.0, before * np.minimum(t / 0.5, 1.0), after * np.exp(
        -(t - 2.0) / 0.2))[:, None] * np.ones(N)
    q = np.cumsum(FINE * v, axis=0)
    for delay, phase in ((0.0, 0.0), (0.0, 0.3), (0.0, 0.7), (0.015, 0.4)):
        no_alarm(sampled(t, q, filtered(v, delay, 1), regular(t, rate) + phase / rate))


@pytest.mark.skipif(not (ROSBAG2.is_dir() and UR10.is_dir()), reason=NO_ROSBAG2)
@pytest.mark.parametrize('path', RECORDINGS, ids=lambda path: path.name)
def test_recordings_are_consistent(path):
    with Recording(path) as recording:
        series = recording.joint_series(recording.joint_state_topic())
    rng, n = np.random.default_rng(0), len(series.joint_names)
    stamps, q, v = series.stamps_ns, series.position, series.velocity
    no_alarm(States(stamps, q, v), n=n)
    no_alarm(States(
        stamps[::2], np.round(q[::2], 4), v[::2] + rng.normal(0.0, 0.2, v[::2].shape)), n=n)
