# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The filter of recorded motions: acceleration, cut-off, gaps, uneven stamps."""

import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics_tools.analysis.motion_filter import filter_motion, zero_phase
from robot_dynamics_tools.recordings.joint_series import JointSeries

JOINTS = ('a', 'b')
FREQUENCIES = (0.1, 0.23, 0.5)


def motion(times):
    """Return position and its derivatives of a sum of sines, all joints in motion."""
    q, v, a = (np.zeros((len(times), len(JOINTS))) for _ in range(3))
    for joint in range(len(JOINTS)):
        for k, frequency in enumerate(FREQUENCIES):
            w, phase = 2.0 * np.pi * frequency, 1.3 * k + 2.0 * joint
            q[:, joint] += np.sin(w * times + phase) / (k + 1)
            v[:, joint] += w * np.cos(w * times + phase) / (k + 1)
            a[:, joint] -= w**2 * np.sin(w * times + phase) / (k + 1)
    return q, v, a


def series(times, position, velocity=None, effort=None):
    stamps = np.asarray(np.round(times * 1e9), dtype=np.int64)
    return JointSeries(JOINTS, stamps, position, velocity, effort, 0)


def relative_error(found, true):
    return np.sqrt(np.mean((found - true)**2, axis=0) / np.mean(true**2, axis=0))


TIMES = np.arange(0.0, 20.0, 0.01)
Q, V, A = motion(TIMES)


@pytest.mark.parametrize(('rate', 'quantum', 'has_velocity'), [
    (30.0, 0.0, True), (125.0, 1e-3, False), (500.0, 1e-3, True), (1000.0, 0.0, False)])
def test_acceleration_of_a_noisy_motion(rate, quantum, has_velocity):
    times = np.arange(0.0, 25.0, 1.0 / rate)
    q, v, a = motion(times)
    noise = np.random.default_rng(1).normal(scale=1e-5 + 0.3 * quantum, size=q.shape)
    measured = q + noise if quantum == 0.0 else np.round((q + noise) / quantum) * quantum
    found = filter_motion(series(times, measured, v if has_velocity else None))
    assert 3.0 < found.cutoff_hz <= 0.2001 * rate
    use = found.usable
    assert np.all(relative_error(found.velocity[use], v[use]) < 0.01)
    assert np.all(relative_error(found.acceleration[use], a[use]) < 0.1)


def test_the_filter_has_no_phase_and_halves_at_its_cutoff():
    rate, cutoff = 200.0, 5.0
    times = np.arange(0.0, 20.0, 1.0 / rate)
    middle = slice(1000, 3000)
    for frequency, gain in ((0.5, 1.0), (5.0, 0.5), (20.0, 0.0)):
        signal = np.sin(2.0 * np.pi * frequency * times)
        found = zero_phase(signal[:, np.newaxis], cutoff, rate)[:, 0]
        assert found[middle] == pytest.approx(gain * signal[middle], abs=2e-4)


def test_the_equation_of_motion_is_kept():
    # A linear relation between the signals is the same relation between the filtered signals.
    found = filter_motion(series(TIMES, Q, V, 3.0 * A + 0.5 * V), cutoff_hz=4.0)
    expected = 3.0 * found.acceleration + 0.5 * found.velocity
    use = found.usable
    assert np.all(relative_error(found.effort[use], expected[use]) < 1e-3)


def test_uneven_stamps():
    rate = 100.0
    rng = np.random.default_rng(2)
    times = np.arange(0.0, 20.0, 1.0 / rate) + rng.uniform(-0.3, 0.3, 2000) / rate
    times = np.delete(times, rng.choice(np.arange(1, 1999), 100, replace=False))
    q, v, a = motion(times)
    found = filter_motion(series(times, q))
    assert found.effort is None
    assert len(found.stamps_ns) == len(times)
    use = found.usable
    assert np.all(relative_error(found.acceleration[use], a[use]) < 0.02)


def test_a_gap_parts_the_motion():
    """Segments below two periods of the cut-off are left out; a half at each end is not used."""
    times = np.concatenate([
        np.arange(0.0, 10.0, 0.01), 13.0 + 0.01 * np.arange(39), np.arange(15.0, 25.0, 0.01),
        28.0 + 0.01 * np.arange(43)])
    q, v, _ = motion(times)
    found = filter_motion(series(times, q, v), cutoff_hz=5.0)
    assert found.left_out == len(times) - len(found.stamps_ns) == 39
    assert set(found.segment) == {0, 1, 2}
    first = found.usable[found.segment == 0]
    assert np.flatnonzero(first)[[0, -1]] == pytest.approx([10, 989], abs=1)
    assert found.usable[found.segment == 2].sum() == pytest.approx(23, abs=2)
    true = motion(found.times)[2]
    use = found.usable
    assert np.all(relative_error(found.acceleration[use], true[use]) < 0.01)


@pytest.mark.parametrize('kind', ['zeros', 'degrees', 'late'])
def test_a_velocity_that_contradicts_the_position_is_not_used(kind):
    wrong = {'zeros': 0.0 * V, 'degrees': np.rad2deg(V), 'late': motion(TIMES - 0.4)[1]}[kind]
    recorded = np.column_stack([V[:, 0], wrong[:, 1]])
    found = filter_motion(series(TIMES, Q, recorded))
    assert found.differentiated == ('b',)
    assert np.all(relative_error(found.velocity[found.usable], V[found.usable]) < 0.01)
    assert np.all(relative_error(found.acceleration[found.usable], A[found.usable]) < 0.05)
    noisy = V + np.random.default_rng(0).normal(scale=0.3, size=V.shape)
    assert filter_motion(series(TIMES, Q, noisy)).differentiated == ()


@pytest.mark.parametrize(('given', 'cutoff', 'error', 'words'), [
    ((TIMES, None, V), None, RecordingError, 'has no position'),
    ((TIMES[:19], Q[:19]), None, RecordingError, 'has 19 samples, expected at least 20'),
    ((TIMES, np.zeros_like(Q)), None, RecordingError, 'no joint moves'),
    ((TIMES[:50], Q[:50]), 1.0, RecordingError, 'without a gap'),
    ((TIMES, Q), 40.0, InvalidInputError, 'cutoff is 40 Hz, expected at most 20 Hz'),
    ((TIMES, Q), -1.0, InvalidInputError, 'cutoff is -1'),
])
def test_bad_input(given, cutoff, error, words):
    with pytest.raises(error, match=words):
        filter_motion(series(*given), cutoff)
