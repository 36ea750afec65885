# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Contact levels θ = a + b |q̇| from recordings without contact, for a promised rate of false alarms.

The line follows the 99 % quantile of the external effort by the speed (R. Koenker and G. Bassett,
"Regression quantiles", Econometrica 46(1), 1978), and is then scaled so that 40 contacts exceed
that of each joint in ten minutes. The promise, such as one alarm per hour, lies beyond such a
recording. Therefore the largest ratio z of effort and level of all joints, of which each contact
has one peak, is extrapolated (peaks over threshold: A. C. Davison and R. L. Smith, J. Royal
Statistical Society B 52(3), 1990): the excesses of the 80 highest peaks over a threshold u have a
generalized Pareto distribution with the shape ξ and the scale σ, and u + σ/ξ ((ν / rate)^ξ − 1)
is exceeded at the promised rate, if they occur ν times per second.

The promise is an upper bound. The shape of 80 peaks is uncertain by 0.1, which changes the alarms
of an extrapolation from ten minutes to an hour several times. Errors of the model are bounded and
noise is Gaussian; such sums have ξ < 0, and ξ = 0, the exponential distribution, is their bound.
Therefore ξ is the mean of its estimate by moments (J. R. M. Hosking and J. R. Wallis,
Technometrics 29(3), 1987) and of 0 with the weight of 160 peaks. The less is extrapolated, the
less this matters.
"""

from bisect import bisect_left
from collections.abc import Sequence
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import arm_from_urdf, ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.arm_parameters import convention_from_parameters
from robot_dynamics.monitoring.contact_levels import ContactLevels
from robot_dynamics.monitoring.external_effort import ExternalEffort, joint_effort
from robot_dynamics.validation import check_scalar
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics_tools.monitoring.contact_detector import SEPARATION
from robot_dynamics_tools.recordings.joint_series import JointSeries
from robot_dynamics_tools.yaml_output import dump_yaml, rounded

ALARMS_PER_HOUR = 1.0
"""Promised rate of false alarms of all joints together."""
SHORTEST = 60.0
"""[s] of motion from which levels are learned, at least."""
EXPECTED = 3.0
"""False alarms of the promised rate in a recording that shows this rate."""
_QUANTILE, _PEAKS, _PEAK_TIME = 0.99, 80, 7.5
_EXPONENTIAL_WEIGHT = 160.0


class LearnedLevels(NamedTuple):
    """
    Learned levels, and from what.

    `duration` [s] is that of the motion, `exceeded` (n,) the scale of the levels by the largest
    ratio in this motion: above 1 they are extrapolated.
    """

    levels: ContactLevels
    duration: float
    exceeded: FloatArray


def learn_contact_levels(
    times: FloatArray, v: FloatArray, effort: FloatArray, joint_names: Sequence[str],
    alarms_per_hour: float = ALARMS_PER_HOUR,
) -> LearnedLevels:
    """
    Return levels for a promised rate of false alarms, from a motion without contact.

    `times` (m,) [s] are increasing and may have gaps; `v` and the external `effort` are (m, n).
    Raises InvalidInputError if the motion is shorter than 60 s, or an effort is constantly 0.
    """
    check_scalar('alarms_per_hour', alarms_per_hour, 0.0, exclusive_minimum=True)
    duration = len(times) * float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    if duration < SHORTEST:
        raise InvalidInputError(
            f'the motion lasts {duration:.1f} s, expected at least {SHORTEST:g} s without '
            'contact, better 10 minutes')
    count = min(_PEAKS, int(duration / _PEAK_TIME))
    lines, ratios = [], []
    for name, speed, r in zip(joint_names, np.abs(v).T, np.abs(effort).T):
        if not r.any():
            raise InvalidInputError(
                f'the external effort at {name!r} is 0 throughout, expected a measured effort')
        line = _line(speed, r)
        ratio = r / (line[0] + line[1] * speed)
        scale = _exceeded_by(count // 2, times, ratio)
        lines.append(scale * line)
        ratios.append(ratio / scale)
    z = np.max(ratios, axis=0)
    u = _exceeded_by(count, times, z)
    factor = u + _extrapolated(_peaks(times, z, u) - u, alarms_per_hour / 3600.0 * duration)
    a, b = factor * np.array(lines).T
    return LearnedLevels(ContactLevels(a, b), duration, factor / np.max(ratios, axis=1))


def _peaks(times: FloatArray, ratio: FloatArray, level: float) -> FloatArray:
    """Return the largest ratio (k,) in each contact: `ContactDetector` with this level."""
    above = np.flatnonzero(ratio > level)
    begins = np.flatnonzero(np.diff(times[above], prepend=-np.inf) >= SEPARATION)
    return np.maximum.reduceat(ratio[above], begins) if len(above) else ratio[:0]


def _exceeded_by(count: int, times: FloatArray, ratio: FloatArray) -> float:
    """Return the highest level that this number of contacts exceeds."""
    blocks = np.flatnonzero(np.diff(np.floor(times / SEPARATION), prepend=-np.inf))
    highest = np.sort(np.maximum.reduceat(ratio, blocks))[::-1][:4 * count]
    i = bisect_left(highest, count, key=lambda level: len(_peaks(times, ratio, float(level))))
    return float(highest[min(i, len(highest) - 1)])


def _extrapolated(excesses: FloatArray, expected: float) -> float:
    """Return the excess that `expected` of k excesses (k,) surpass, at least 0; see the module."""
    k = len(excesses)
    if k < 2 or not np.ptp(excesses):
        return float(excesses.max(initial=0.0))
    mean = float(excesses.mean())
    moments = 0.5 * (1.0 - mean**2 / float(excesses.var(ddof=1)))
    shape = k * moments / (k + _EXPONENTIAL_WEIGHT)
    log = math.log(max(k / expected, 1.0))
    return mean * (1.0 - shape) * (math.expm1(shape * log) / shape if shape else log)


def _line(speed: FloatArray, r: FloatArray) -> FloatArray:
    """Return a > 0 and b >= 0 of the quantile a + b · speed of r: the least pinball loss."""
    def offset(b: float) -> float:
        return max(float(np.quantile(r - b * speed, _QUANTILE)), 1e-3 * float(r.max()))

    def loss(b: float) -> float:
        above = r - b * speed - offset(b)
        return float(np.maximum(_QUANTILE * above, (_QUANTILE - 1.0) * above).mean())

    steepest = 2.0 * float(np.quantile(r, _QUANTILE)) / max(float(np.quantile(speed, 0.9)), 1e-9)
    search = optional('scipy.optimize', 'levels of contacts').minimize_scalar
    b = float(search(loss, bounds=(0.0, steepest), method='bounded').x)
    b = b if loss(b) < loss(0.0) else 0.0
    return np.array([offset(b), b])


DEFAULT_BANDWIDTH = 10.0
"""[Hz] of the momentum observer."""
_DIGITS = 4


def levels_from_bags(
    bags: Sequence[Path], settings: AnalysisSettings, alarms_per_hour: float,
) -> tuple[LearnedLevels, tuple[str, ...]]:
    """
    Return the levels from recordings together, and the joints.

    Raises InvalidInputError if a joint of the arm, velocity or effort is missing, or if the
    recordings are too short; RecordingError and ModelError.
    """
    found: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    offset = 0.0
    bandwidth = float(settings.parameters.get('external_effort_bandwidth', DEFAULT_BANDWIDTH))
    joints = arm_from_urdf(settings.urdf, settings.parameters.get('joints') or ()).joint_names
    for bag in bags:
        read = read_for_arm(bag, settings)
        missing = [name for name in joints if name not in read.arm.joint_names]
        if missing:
            raise InvalidInputError(f'recording {str(bag)!r} lacks the joints {missing}')
        t, v, r = external_efforts(read.arm, read.series, settings, bandwidth)
        found.append((t + offset, v, r))
        offset += 10.0 + float(t[-1] if len(t) else 0.0)
    t, v, r = (np.concatenate(each) for each in zip(*found))
    return learn_contact_levels(t, v, r, joints, alarms_per_hour), joints


def external_efforts(
    arm: ArmModel, series: JointSeries, settings: AnalysisSettings, bandwidth: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """
    Return times (m,) [s], velocities and external efforts (m, n) of recorded joint states.

    The first 5 time constants of the observer after each gap are left out.
    """
    for name in ('position', 'velocity', 'effort'):
        if getattr(series, name) is None:
            raise InvalidInputError(f'the recording has no {name}, expected joint states with '
                                    'position, velocity and effort')
    q, v, measured = (np.asarray(each) for each in (
        series.position, series.velocity, series.effort))
    convention = convention_from_parameters(settings.parameters)
    dynamics = ArmDynamics(arm)
    observer, body = ExternalEffort(dynamics, bandwidth), dynamics.unchecked.rigid_body
    rows, estimates = [], []
    for stretch in series.stretches():
        observer.restart()
        times = series.times[stretch]
        for i, t, dt in zip(stretch, times - times[0], np.diff(times, prepend=times[0])):
            effort = joint_effort(arm, convention, measured[i], v[i], body.gravity(q[i]))
            r = observer.update(float(dt), q[i], v[i], effort)
            if r is not None and t >= 5.0 / observer.gain:
                rows.append(int(i))
                estimates.append(r)
    return series.times[rows], v[rows], np.array(estimates).reshape(-1, arm.joint_count)


def parameter_text(found: LearnedLevels, joints: Sequence[str], alarms_per_hour: float) -> str:
    """Return the parameter file of the levels for `dynamics_node`."""
    return dump_yaml({'/**/dynamics': {'ros__parameters': {
        'joints': list(joints), 'contact': {
            'effort': rounded(found.levels.effort, _DIGITS),
            'effort_per_velocity': rounded(found.levels.per_velocity, _DIGITS)}}}}, (
        f'Contact levels for at most {alarms_per_hour:g} false alarms per hour, learned from '
        f'{found.duration:.0f} s without contact.',
        'The levels are extrapolated beyond this motion. No safety function.'), 'a parameter file')
