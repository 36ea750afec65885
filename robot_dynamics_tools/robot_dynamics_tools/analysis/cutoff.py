# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The cut-off frequency of a low-pass filter for a recorded motion, chosen from its own spectrum.

The cut-off frequency has five bounds. It is well above the band of the motion, so that the filter
does not attenuate the motion; below the frequency at which differentiated noise would dominate the
acceleration; near the frequency from which the effort is noise; at a safe fraction of the Nyquist
frequency; and where an arm is rigid. The first bound is a factor of ten,
as in M. Gautier, "Dynamic identification of robots with power model", IEEE Int. Conf. Robotics and
Automation, 1997.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.exceptions import RecordingError

BAND = 0.999
"""Fraction of the power of acceleration that defines the band of the motion."""
MARGIN = 10.0
"""Ratio of the cut-off to the band of the motion."""
NOISE = 0.1
"""Accepted ratio of the RMS of noise to that of acceleration below the cut-off."""
HIGHEST = 30.0
"""Largest cut-off [Hz]: above it, gears and links of arms are not rigid."""
HIGHEST_FRACTION = 0.4
"""Largest ratio of the cut-off to the Nyquist frequency."""
WINDOW = 8.0
"""Window [s] of the spectrum, if the recording is long enough."""
LARGEST_RATIO = 4.0
"""Largest ratio of the end of the motion of a joint to the median of the moving joints."""
RISE = 3.0
"""Ratio of a power to an earlier minimum above which the minimum is the end of the motion."""
SMALL = 0.03
"""RMS velocity beyond the end of the motion, relative to that of the motion, at most."""
OVER_EFFORT = 2.0
"""Largest ratio of the cut-off to the frequency from which the effort is noise."""
_MOVES = 1e-2
_LEAST_OVER_BAND = 2.0
_BANDS_PER_OCTAVE = 3


class Cutoff(NamedTuple):
    """A cut-off frequency [Hz], and the text of the reason for it."""

    hz: float
    reason: str


def choose_cutoff(
    accelerations: Sequence[FloatArray], rate_hz: float, efforts: Sequence[FloatArray] = (),
) -> Cutoff:
    """
    Return the cut-off for noisy accelerations: evenly sampled stretches of shape (m, n).

    `efforts` are the efforts of these stretches, if they were recorded. Raises RecordingError if
    no joint moves.
    """
    frequency, power = spectrum(accelerations, rate_hz)
    ends = np.array([_end_of_motion(frequency, column) for column in power.T])
    size = _motion(frequency, power, ends).sum(axis=0)
    if not size.max() > 0.0:
        raise RecordingError('no joint moves in the recording, expected a motion')
    # One joint with little noise, or with noise in a low band, must not decide for all.
    moving = size > _MOVES**2 * size.max()
    ends = np.minimum(ends, LARGEST_RATIO * np.median(ends[moving]))
    motion = _motion(frequency, power, ends)
    size = motion.sum(axis=0)
    # All joints share one filter, which preserves the equation of motion between them.
    fraction = np.cumsum(motion, axis=0) / np.where(moving, size, 1.0)
    band = float(frequency[np.argmax(fraction >= BAND, axis=0)][moving].max())
    is_noisy = np.cumsum(power - motion, axis=0) > NOISE**2 * size
    noisy_from = np.where(is_noisy.any(axis=0), frequency[np.argmax(is_noisy, axis=0)], np.inf)
    least = _LEAST_OVER_BAND * band
    bounds = [
        (MARGIN * band, f'{MARGIN:g} times the band of the motion, {band:.3g} Hz'),
        (max(float(noisy_from[moving].min()), least),
         'the frequency at which noise reaches a tenth of the acceleration'),
        (HIGHEST_FRACTION * rate_hz / 2.0, f'{HIGHEST_FRACTION:g} of the Nyquist frequency'),
        (HIGHEST, 'the frequency from which on an arm is not rigid')]
    if efforts:
        end = _end_of_effort(efforts, rate_hz, moving)
        bounds.append((max(OVER_EFFORT * end, least),
                       f'{OVER_EFFORT:g} times the frequency from which the effort is noise, '
                       f'{end:.3g} Hz'))
    return Cutoff(*min(bounds))


def _motion(frequency: FloatArray, power: FloatArray, ends: FloatArray) -> FloatArray:
    return np.where(frequency[:, np.newaxis] <= ends, power, 0.0)


def _end_of_effort(efforts: Sequence[FloatArray], rate_hz: float, moving: BoolArray) -> float:
    """
    Return the frequency from which the effort is noise: the median of the moving joints.

    The density of the noise is the mean of the spectrum above a quarter of the Nyquist
    frequency, where an arm has hardly any effort. The effort ends where its power is less than
    twice this density, if what follows is less than a tenth of the effort.
    """
    frequency, power = spectrum([each - each.mean(axis=0) for each in efforts], rate_hz)
    density = power[frequency > 0.125 * rate_hz].mean(axis=0)
    band, count = _thirds_of_octaves(frequency)
    ends = np.full(len(density), np.inf)
    for j in np.flatnonzero(moving).tolist():
        total = np.bincount(band, weights=power[1:, j])
        excess = total - density[j] * count
        beyond = excess.sum() - np.cumsum(excess)
        is_noise = (count > 0) & (total < 2.0 * density[j] * count) & (
            beyond < NOISE**2 * excess.sum())
        if is_noise.any():
            ends[j] = frequency[1:][band == int(np.argmax(is_noise))].mean()
    return float(np.median(ends[moving]))


def _thirds_of_octaves(frequency: FloatArray) -> tuple[IntArray, IntArray]:
    """
    Return the number of the third of an octave of each frequency but the first, which is 0.

    The second value is how many frequencies each third has.
    """
    band = np.floor(_BANDS_PER_OCTAVE * np.log2(frequency[1:] / frequency[1])).astype(np.int64)
    return band, np.bincount(band)


def spectrum(stretches: Sequence[FloatArray], rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """
    Return frequencies (k,) [Hz] and the power there, (k, n), of signals of shape (m, n).

    The sum over Hann windows that overlap by half (P. D. Welch, IEEE Trans. Audio and
    Electroacoustics 15(2), 1967), in any unit.
    """
    size = max(min(int(WINDOW * rate_hz), max(len(stretch) for stretch in stretches)), 4)
    window = np.hanning(size + 2)[1:-1, np.newaxis]
    total = np.zeros((size // 2 + 1, stretches[0].shape[1]))
    for stretch in stretches:
        for start in range(0, len(stretch) - size + 1, max(size // 2, 1)):
            total += np.abs(np.fft.rfft(window * stretch[start:start + size], axis=0))**2
    return np.asarray(np.fft.rfftfreq(size, 1.0 / rate_hz), dtype=np.float64), total


def _end_of_motion(frequency: FloatArray, power: FloatArray) -> float:
    """
    Return the frequency of the first minimum of the acceleration; noise dominates beyond it.

    The power of a motion falls with frequency, whereas that of differentiated noise in position or
    velocity grows, up to the band of a filter of the driver, and falls again beyond it. A minimum
    between two parts of a motion is skipped: the velocity beyond it is not small. The function
    compares means over thirds of an octave.
    """
    band, count = _thirds_of_octaves(frequency)
    mean = np.bincount(band, weights=power[1:]) / np.maximum(count, 1)
    velocity = np.bincount(band, weights=power[1:] / frequency[1:]**2)
    beyond = velocity.sum() - np.cumsum(velocity)
    filled = np.flatnonzero(count > 0)
    least = filled[int(np.argmin(mean[filled]))]
    lowest = filled[0]
    for i in filled:
        if mean[i] < mean[lowest]:
            lowest = i
        elif mean[i] > RISE * mean[lowest] and beyond[lowest] <= SMALL**2 * velocity.sum():
            least = lowest
            break
    return float(frequency[1:][band == least].mean())
