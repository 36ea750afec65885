# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A filtered recorded motion, and its acceleration, which recordings do not contain.

Position, velocity and effort pass the same Butterworth filter forward and backward (zero phase),
which preserves the equation of motion between them; the acceleration is the derivative of a spline
through the filtered velocity. Sources: M. Gautier, "Numerical calculation of the base inertial
parameters of robots", J. Robotic Systems 8(4), 1991; J. Swevers, W. Verdonck, J. De Schutter,
"Dynamic model identification for industrial robots", IEEE Control Systems Magazine 27(5), 2007.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray, NANOSECONDS_PER_SECOND
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics.validation import check_scalar
from robot_dynamics_tools.analysis.cutoff import choose_cutoff, Cutoff, HIGHEST_FRACTION
from robot_dynamics_tools.analysis.units import contradicts_position
from robot_dynamics_tools.recordings.joint_series import JointSeries

FILTER_ORDER = 4
LEAST_SAMPLES = 4 * (FILTER_ORDER + 1)
"""Smallest number of samples that can be filtered."""
SHORTEST_SEGMENT = 2.0
"""Shortest usable segment between two gaps, in periods of the cut-off frequency."""
EDGE = 0.5
"""Duration at each end of a segment in which the filter extrapolates, in the same periods."""
NORMAL = 1.4826
"""Standard deviation of a normal distribution by its median absolute value."""
_EVEN = 1e-3


@dataclass(frozen=True, eq=False)
class FilteredMotion:
    """
    A filtered motion of n joints at m of the original stamps.

    `stamps_ns` (m,) are strictly increasing; `position`, `velocity`, `acceleration` and `effort`
    are (m, n) [rad or m, its derivatives, N·m or N]; `effort` is None if none was recorded.
    `segment` (m,) numbers the stretches without gaps, which were filtered separately, and `usable`
    (m,) is false near their ends. `left_out` counts the samples of segments that were too short to
    filter; they are in no array.
    """

    joint_names: tuple[str, ...]
    stamps_ns: IntArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    effort: FloatArray | None
    cutoff_hz: float
    sample_rate_hz: float
    cutoff_reason: str
    segment: IntArray
    usable: BoolArray
    left_out: int
    differentiated: tuple[str, ...] = ()
    """Joints whose recorded velocity is inconsistent with their position, and was not used."""
    effort_noise: tuple[float, ...] = ()
    """Deviation of the noise of `effort` by its RMS, if the noise is white; empty without one."""
    recorded_effort: FloatArray | None = None
    """The effort (m, n) before the filter, None if none was recorded."""

    @property
    def times(self) -> FloatArray:
        """Seconds since the first sample, (m,)."""
        return np.asarray((self.stamps_ns - self.stamps_ns[0]) / NANOSECONDS_PER_SECOND)

    @property
    def measured_effort(self) -> FloatArray:
        """The effort (m, n); raises RecordingError if none was recorded."""
        if self.effort is None:
            raise RecordingError('the recording has no effort, expected the measured effort')
        return self.effort

    def with_efforts(self, change: Callable[[FloatArray], FloatArray]) -> 'FilteredMotion':
        """Return the motion with a change of its effort, before and behind the filter."""
        return replace(self, effort=change(self.measured_effort), recorded_effort=None if (
            self.recorded_effort is None) else change(self.recorded_effort))

    def without_delay(self, delay: float) -> 'FilteredMotion':
        """Return the motion with the effort `delay` [s] later; samples without effort are cut."""
        t, number = self.times, self.segment
        first, last = (t[np.searchsorted(number, number, side) - (side == 'right')]
                       for side in ('left', 'right'))
        kept = (t + delay >= first) & (t + delay <= last)
        late = self.with_efforts(lambda effort: np.stack([
            np.interp(t + delay, t, column) for column in effort.T], axis=1))
        return late.at(kept)

    def state(
        self, rows: IntArray | BoolArray | slice = slice(None),
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position, velocity and acceleration (m, n) of these rows."""
        return self.position[rows], self.velocity[rows], self.acceleration[rows]

    def at(self, rows: IntArray | BoolArray | slice) -> 'FilteredMotion':
        """Return the samples of these rows."""
        return replace(self, **{
            field.name: getattr(self, field.name)[rows] for field in fields(self)
            if isinstance(getattr(self, field.name), np.ndarray)})


def filter_motion(series: JointSeries, cutoff_hz: float | None = None) -> FilteredMotion:
    """
    Return a recorded motion, filtered, with velocity and acceleration, at its own stamps.

    At `cutoff_hz` [Hz] the filter, run forward and backward, halves an amplitude; None chooses it
    from the data (`cutoff.choose_cutoff`). Uneven stamps are resampled to the median interval
    between gaps, and the results are interpolated at the stamps. Velocity that was not recorded,
    or is inconsistent with the position, is differentiated from the position. The position must
    not step by whole turns (`JointSeries.unwrapped`).

    Raises RecordingError if there is no position or if there are too few samples,
    InvalidInputError for a cut-off that is too high for the sampling rate, MissingDependencyError
    without scipy.
    """
    if series.position is None:
        raise RecordingError('the recording has no position, expected joint states with position')
    if len(series.stamps_ns) < LEAST_SAMPLES:
        raise RecordingError(
            f'the recording has {len(series.stamps_ns)} samples, expected at least '
            f'{LEAST_SAMPLES} to filter')
    interval = float(np.median(np.diff(series.times)))
    rate = 1.0 / interval
    segments = series.stretches()
    bad = np.zeros(len(series.joint_names), dtype=np.bool_) if series.velocity is None else (
        contradicts_position(series.times, series.position, series.velocity, segments))
    if cutoff_hz is None:
        chosen = choose_cutoff(
            [_acceleration(series, rows, interval, bad) for rows in segments], rate,
            [] if series.effort is None else [
                _on_grid(series.times[rows], series.effort[rows], interval)[1]
                for rows in segments])
    else:
        highest = HIGHEST_FRACTION * rate / 2.0
        given = check_scalar('cutoff', cutoff_hz, 0.0, exclusive_minimum=True)
        if given > highest:
            raise InvalidInputError(
                f'cutoff is {given:g} Hz, expected at most {highest:.3g} Hz for joint states at '
                f'{rate:.4g} Hz')
        chosen = Cutoff(given, 'as given')
    shortest = SHORTEST_SEGMENT / chosen.hz
    kept = [rows for rows in segments if series.times[rows[-1]] - series.times[rows[0]] > shortest
            and len(rows) >= LEAST_SAMPLES]
    if not kept:
        raise RecordingError(
            f'the recording has no {shortest:.3g} s without a gap, expected at least that much '
            f'for a cut-off of {chosen.hz:.3g} Hz')
    return _join(series, kept, chosen, rate, bad)


def filter_motion_below(series: JointSeries, cutoff_hz: float) -> FilteredMotion:
    """Filter at `cutoff_hz` [Hz], or at the highest cut-off for the sampling rate."""
    if len(series.stamps_ns) < 2:
        return filter_motion(series)  # raises the error about too few samples
    rate = 1.0 / float(np.median(np.diff(series.times)))
    return filter_motion(series, min(cutoff_hz, HIGHEST_FRACTION * rate / 2.0))


def _join(
    series: JointSeries, segments: list[IntArray], cutoff: Cutoff, rate: float, bad: BoolArray,
) -> FilteredMotion:
    parts = [_filter_segment(series, rows, cutoff.hz, rate, bad) for rows in segments]
    signals = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    rows = np.concatenate(segments)
    ends = [series.times[part[[0, -1]]] for part in segments]
    usable = np.concatenate([
        (series.times[part] - first >= EDGE / cutoff.hz)
        & (last - series.times[part] >= EDGE / cutoff.hz)
        for part, (first, last) in zip(segments, ends)])
    return FilteredMotion(
        series.joint_names, series.stamps_ns[rows], signals['position'], signals['velocity'],
        signals['acceleration'], signals.get('effort'), cutoff.hz, rate, cutoff.reason,
        segment=np.repeat(np.arange(len(segments)), [len(part) for part in segments]),
        usable=usable, left_out=len(series.stamps_ns) - len(rows), differentiated=tuple(
            name for name, is_bad in zip(series.joint_names, bad) if is_bad),
        effort_noise=() if series.effort is None else _noise(
            series.effort[rows], signals['effort'], cutoff.hz, rate),
        recorded_effort=None if series.effort is None else series.effort[rows])


def _noise(
    recorded: FloatArray, effort: FloatArray, cutoff_hz: float, rate: float,
) -> tuple[float, ...]:
    """Return the deviation of white noise after the filter, from what the filter removed."""
    removed = NORMAL * np.median(np.abs(recorded - effort), axis=0)
    passed = 1.0 / samples_per_independent_sample(cutoff_hz, rate)
    rms = np.sqrt(np.mean(effort**2, axis=0))
    return tuple((removed * np.sqrt(passed / (1.0 - passed)) / np.maximum(rms, 1e-300)).tolist())


def _acceleration(
    series: JointSeries, rows: IntArray, interval: float, bad: BoolArray,
) -> FloatArray:
    """Return the unfiltered acceleration on an even grid."""
    assert series.position is not None
    position = _on_grid(series.times[rows], series.position[rows], interval)[1]
    by_position = np.asarray(np.diff(position, 2, axis=0) / interval**2)
    if series.velocity is None:
        return by_position
    velocity = _on_grid(series.times[rows], series.velocity[rows], interval)[1]
    return np.where(bad, by_position, np.diff(velocity[:-1], axis=0) / interval)


def _on_grid(times: FloatArray, values: FloatArray, interval: float) -> (
        tuple[FloatArray, FloatArray]):
    """Return an even grid from the first to about the last time, and the values on it."""
    count = max(int(round((times[-1] - times[0]) / interval)), 1) + 1
    grid = np.linspace(times[0], times[-1], count)
    if count == len(times) and np.abs(times - grid).max() < _EVEN * interval:
        return grid, values
    return grid, np.stack([np.interp(grid, times, column) for column in values.T], axis=1)


def _smooth(
    times: FloatArray, values: FloatArray, cutoff_hz: float, rate: float,
) -> tuple[FloatArray, FloatArray]:
    """Return an even grid, and the filtered values on it."""
    grid, even = _on_grid(times, values, 1.0 / rate)
    return grid, zero_phase(even, cutoff_hz, (len(grid) - 1) / (grid[-1] - grid[0]))


def _filter_segment(
    series: JointSeries, rows: IntArray, cutoff_hz: float, rate: float, bad: BoolArray,
) -> dict[str, FloatArray]:
    """Return position, velocity, acceleration and effort (m, n), if it was recorded."""
    times = series.times[rows]
    make_spline = optional('scipy.interpolate', 'filtering').make_interp_spline

    def smooth(values: FloatArray) -> tuple[FloatArray, FloatArray]:
        return _smooth(times, values[rows], cutoff_hz, rate)

    assert series.position is not None
    position = make_spline(*smooth(series.position), k=5)
    if series.velocity is None:
        velocity = position.derivative()
    else:
        grid, recorded = smooth(series.velocity)
        velocity = make_spline(grid, np.where(bad, position.derivative()(grid), recorded), k=5)
    found = {'position': position(times), 'velocity': velocity(times),
             'acceleration': velocity.derivative()(times)}
    if series.effort is not None:
        found['effort'] = make_spline(*smooth(series.effort), k=3)(times)
    return found


def zero_phase(values: FloatArray, cutoff_hz: float, rate_hz: float) -> FloatArray:
    """
    Return evenly sampled signals, (m, n), after a Butterworth filter forward and backward.

    Beyond the ends the signals are continued by their point reflection, for three periods of the
    cut-off frequency if they are long enough. Raises MissingDependencyError without scipy.
    """
    signal = optional('scipy.signal', 'filtering')
    sections = signal.butter(FILTER_ORDER, cutoff_hz, fs=rate_hz, output='sos')
    padding = min(len(values) - 1, int(np.ceil(3.0 * rate_hz / cutoff_hz)))
    return np.asarray(signal.sosfiltfilt(sections, values, axis=0, padlen=padding))


def filter_like(motion: FilteredMotion, values: FloatArray) -> FloatArray:
    """
    Return signals (m, k) at the samples of a motion after the filter of this motion.

    Terms with steps in velocity, such as dry friction, contain frequencies beyond the cut-off that
    the filter has removed from the measured effort. Before the comparison, they pass the same
    filter (M. Gautier's parallel filtering).
    """
    filtered = np.empty_like(values)
    for number in np.unique(motion.segment):
        rows = np.flatnonzero(motion.segment == number)
        times = motion.times[rows]
        grid, smooth = _smooth(times, values[rows], motion.cutoff_hz, motion.sample_rate_hz)
        filtered[rows] = smooth if len(grid) == len(rows) and (
            np.abs(times - grid).max() < _EVEN / motion.sample_rate_hz) else np.stack([
                np.interp(times, grid, column) for column in smooth.T], axis=1)
    return filtered


def samples_per_independent_sample(cutoff_hz: float, rate_hz: float) -> float:
    """
    Return the number of filtered samples of white noise that equal one independent sample.

    Its inverse is the fraction of the power up to the Nyquist frequency that the filter passes:
    the mean of |H|⁴, because the filter runs twice.
    """
    ratio = np.linspace(0.0, 0.5 * rate_hz, 4096) / cutoff_hz
    return float(1.0 / np.mean(1.0 / (1.0 + ratio**(2 * FILTER_ORDER))**2))


def noise_bandwidth(cutoff_hz: float, rate_hz: float) -> float:
    """Return the bandwidth [Hz] of the white noise that the filter passes."""
    return 0.5 * rate_hz / samples_per_independent_sample(cutoff_hz, rate_hz)
