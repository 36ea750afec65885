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
The motion behind recorded joint states: what inverse dynamics needs, and a recording has not.

Acceleration is not measured. It is the derivative of the measured velocity, both after a low-pass
filter without phase: a Butterworth filter run forwards and backwards (A. V. Oppenheim and
R. W. Schafer, *Discrete-Time Signal Processing*, on zero-phase filtering). The measured effort
goes through the same filter, so that both sides of the comparison have the same band.
"""

from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.exceptions import MissingDependencyError, RecordingError
from robot_dynamics.recording import JointSeries
from robot_dynamics.validation import FloatArray

CUT_OFF = 5.0
"""[Hz]"""
ORDER = 4
LARGEST_SHARE_OF_RATE = 0.2
"""The cut-off is lowered to this share of the sampling rate where that is slow."""
FEWEST_SAMPLES = 50


class MeasuredMotion(NamedTuple):
    """
    A motion on an even grid: `times` (m,) [s], the others (m, n) [rad or m, per second, N·m or N].

    `effort` is None where it was not measured. `cut_off` [Hz] and `rate` [Hz] are those used.
    """

    times: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    effort: FloatArray | None
    cut_off: float
    rate: float


def measured_motion(series: JointSeries, cut_off: float = CUT_OFF) -> MeasuredMotion:
    """
    Return the motion of recorded joint states, filtered at `cut_off` [Hz].

    A velocity that was not recorded is the derivative of the position. Raises RecordingError
    without positions or with too few samples, MissingDependencyError without scipy.
    """
    m = len(series.stamps_ns)
    if series.position is None or m < FEWEST_SAMPLES:
        given = 'no positions' if series.position is None else f'{m} samples'
        raise RecordingError(
            f'the joint states have {given}, expected positions in at least '
            f'{FEWEST_SAMPLES} samples')
    t = series.times
    period = float(np.median(np.diff(t)))
    times = np.asarray(np.arange(int(t[-1] / period + 0.5) + 1) * period, dtype=np.float64)
    rate = 1.0 / period
    used = min(cut_off, LARGEST_SHARE_OF_RATE * rate)
    signal = _signal()
    b, a = signal.butter(ORDER, used, fs=rate)

    def on_grid(values: FloatArray) -> FloatArray:
        return np.column_stack([np.interp(times, t, column) for column in values.T])

    def smooth(values: FloatArray) -> FloatArray:
        return np.asarray(signal.filtfilt(b, a, values, axis=0))

    q = on_grid(series.position)
    v = smooth(np.gradient(q, period, axis=0) if series.velocity is None
               else on_grid(series.velocity))
    return MeasuredMotion(
        times, q, v, np.gradient(v, period, axis=0),
        None if series.effort is None else smooth(on_grid(series.effort)), used, rate)


def _signal() -> Any:
    try:
        from scipy import signal
    except ImportError:
        raise MissingDependencyError(
            'filtering a recording needs the library scipy (apt install python3-scipy, or '
            'pip install scipy)') from None
    return signal
