# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
The cut-off frequency of a low-pass filter for a recorded motion, chosen from its own spectrum.

The cut-off frequency has three bounds. It is well above the band of the motion, so that the filter
does not attenuate the motion; below the frequency at which differentiated noise would dominate the
acceleration; and at a safe fraction of the Nyquist frequency. The first bound is a factor of ten,
as in M. Gautier, "Dynamic identification of robots with power model", IEEE Int. Conf. Robotics and
Automation, 1997.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import RecordingError

BAND = 0.999
"""Fraction of the power of acceleration that defines the band of the motion."""
MARGIN = 10.0
"""Ratio of the cut-off to the band of the motion."""
NOISE = 0.1
"""Accepted ratio of the RMS of noise to that of acceleration below the cut-off."""
HIGHEST_FRACTION = 0.4
"""Largest ratio of the cut-off to the Nyquist frequency."""
WINDOW = 8.0
"""Window [s] of the spectrum, if the recording is long enough."""
_MOVES = 1e-2
_LEAST_OVER_BAND = 2.0
_BANDS_PER_OCTAVE = 3


class Cutoff(NamedTuple):
    """A cut-off frequency [Hz], and the text of the reason for it."""

    hz: float
    reason: str


def choose_cutoff(accelerations: Sequence[FloatArray], rate_hz: float) -> Cutoff:
    """
    Return the cut-off for noisy accelerations: evenly sampled stretches of shape (m, n).

    Raises RecordingError if no joint moves.
    """
    frequency, power = spectrum(accelerations, rate_hz)
    ends = np.array([_end_of_motion(frequency, column) for column in power.T])
    is_motion = frequency[:, np.newaxis] <= ends
    motion = np.where(is_motion, power, 0.0)
    size = motion.sum(axis=0)
    moving = size > _MOVES**2 * size.max()
    if not size.max() > 0.0:
        raise RecordingError('no joint moves in the recording, expected a motion')
    # All joints share one filter, which preserves the equation of motion between them.
    fraction = np.cumsum(motion, axis=0) / np.where(moving, size, 1.0)
    band = float(frequency[np.argmax(fraction >= BAND, axis=0)][moving].max())
    is_noisy = np.cumsum(power - motion, axis=0) > NOISE**2 * size
    noisy_from = np.where(is_noisy.any(axis=0), frequency[np.argmax(is_noisy, axis=0)], np.inf)
    bounds = (
        (MARGIN * band, f'{MARGIN:g} times the band of the motion, {band:.3g} Hz'),
        (max(float(noisy_from[moving].min()), _LEAST_OVER_BAND * band),
         'the frequency at which noise reaches a tenth of the acceleration'),
        (HIGHEST_FRACTION * rate_hz / 2.0, f'{HIGHEST_FRACTION:g} of the Nyquist frequency'))
    return Cutoff(*min(bounds))


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
            piece = stretch[start:start + size]
            total += np.abs(np.fft.rfft(window * piece, axis=0))**2
    return np.asarray(np.fft.rfftfreq(size, 1.0 / rate_hz), dtype=np.float64), total


def _end_of_motion(frequency: FloatArray, power: FloatArray) -> float:
    """
    Return the frequency of the smallest power of acceleration; noise dominates beyond it.

    The power of a motion falls with frequency, whereas that of differentiated noise in position or
    velocity grows. The function compares means over thirds of an octave.
    """
    band = np.floor(_BANDS_PER_OCTAVE * np.log2(frequency[1:] / frequency[1])).astype(int)
    count = np.bincount(band)
    mean = np.bincount(band, weights=power[1:]) / np.maximum(count, 1)
    least = int(np.argmin(np.where(count > 0, mean, np.inf)))
    return float(frequency[1:][band == least].mean())
