# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Units and signs of recorded joint states: degrees, calibrated ranges, bits for signs.

A recorded velocity must be the derivative of the recorded position. Some drivers publish zeros,
other units, or a velocity with a large delay. The velocity, integrated over windows of a few
seconds in which noise is negligible, must agree with the change of position.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics_tools.recordings.joint_series import JointSeries

IMPLAUSIBLE = {'position': 2.0, 'velocity': 10.0, 'effort': 10.0}
"""Multiple of a limit beyond which a sample is noise."""
UNITS = ('rad', 'deg', 'range')
"""Units of positions: `range` is −100 to 100 of the range of a joint in the URDF."""
RANGE = 100.0
SIGN_STEP = 0.3
"""Smallest step of an effort that may be that of a sign bit, relative to its range."""
SIGN_LEFT = 0.1
"""Largest part of such a step that is left without the bit."""
WINDOW = 4.0
"""[s]"""
LARGEST_ERROR = 0.2
"""Largest RMS of the difference within windows, relative to that of the motion there."""
_LEAST_MOVE = 1e-3


def reach(arm: ArmModel) -> FloatArray:
    """Return the largest positions (n,) within the limits, at least 1 [rad] or [m]."""
    return np.maximum(np.maximum(np.abs(arm.limits.lower), np.abs(arm.limits.upper)), 1.0)


def in_radians(
    series: JointSeries, arm: ArmModel, unit: str, may_convert: bool,
) -> tuple[JointSeries, list[str]]:
    """
    Return joint states in radians, and remarks.

    `unit` is one of UNITS, empty to convert degrees if `may_convert`, and positions are plausible
    only as degrees. Raises InvalidInputError if they may be of a range too.
    """
    q, turns = series.position, np.array([kind != 'prismatic' for kind in arm.joint_kinds])
    if q is None or unit == 'rad' or not (unit or may_convert):
        return series, []
    low, high = arm.limits.lower, arm.limits.upper
    if unit == 'range':
        half = 0.5 * (high - low) / RANGE
        if not np.isfinite(half).all():
            raise InvalidInputError(
                "unit is 'range', expected position limits of all joints in the URDF")
        return replace(series, position=low + (q + RANGE) * half, velocity=None if (
            series.velocity is None) else series.velocity * half), ['positions by the range']
    factor = np.where(turns, np.radians(1.0), 1.0)
    if not unit:
        largest = np.quantile(np.abs(q), 0.9, axis=0)
        is_beyond = turns & (largest > IMPLAUSIBLE['position'] * reach(arm))
        if not is_beyond.any():
            return series, []
        if series.velocity is None and np.abs(q).max() <= RANGE:
            raise InvalidInputError(
                'positions beyond the limits of '
                f'{", ".join(np.array(arm.joint_names)[is_beyond])} are not in radians: degrees, '
                'or −100 to 100 of a range, expected --unit deg or --unit range')
    degrees = replace(series, position=q * factor)
    if series.velocity is not None and contradicts_position(
            series.times, q * factor, series.velocity, series.stretches()).any():
        degrees = replace(degrees, velocity=series.velocity * factor)
    return degrees, ['positions in degrees' + ('' if unit else ', because radians would be beyond '
                                               'the limits') + ': converted to radians']


def check_degrees(series: JointSeries) -> None:
    """Raise RecordingError if the velocity is the derivative of the position taken as degrees."""
    q, v = series.position, series.velocity
    if q is None or v is None or len(v) < 2:
        return
    is_wrong, is_wrong_as_degrees = (
        contradicts_position(series.times, each, v, series.stretches())
        for each in (q, np.radians(q)))
    if (is_wrong & ~is_wrong_as_degrees).any():
        raise RecordingError(
            'position in degrees: its derivative is 57.3 times the velocity at '
            + ', '.join(np.array(series.joint_names)[is_wrong & ~is_wrong_as_degrees])
            + '. Expected radians')


def check_sign_bits(series: JointSeries) -> None:
    """Raise RecordingError if the effort is a magnitude with a bit for its sign."""
    effort = np.zeros((2, 0)) if series.effort is None else series.effort
    found = {name: bit for name, e in zip(series.joint_names, effort.T) if (bit := _sign_bit(e))}
    if found:
        raise RecordingError(
            'the effort has a sign bit: it is never negative, and steps at changes of its sign, '
            + ', '.join(f'from 0 to {bit:.4g} at {name}' for name, bit in found.items())
            + '. Expected a negative effort instead')


def _sign_bit(effort: FloatArray) -> float:
    """Return the value of the bit in an effort (m,), 0 without one."""
    is_step = np.abs(np.diff(effort)) > SIGN_STEP * np.ptp(effort)
    if is_step.sum() < 2 or effort.min() < 0.0:
        return 0.0
    bit = float(np.maximum(effort[1:], effort[:-1])[is_step].min())
    below = effort[effort < bit]
    left = float(np.median(np.abs(np.diff(np.where(effort < bit, effort, bit - effort)))[is_step]))
    # a square wave has steps too, but not with a motion between them that ends at 0
    is_signed = left < SIGN_LEFT * bit and np.quantile(below, 0.9) > left / SIGN_LEFT * 0.5
    return bit if is_signed else 0.0


def contradicts_position(
    times: FloatArray, position: FloatArray, velocity: FloatArray,
    stretches: Sequence[npt.NDArray[np.integer]],
) -> BoolArray:
    """
    Return the joints (n,) whose velocity is not the derivative of the position, both (m, n).

    `times` is (m,) [s]; `stretches` are the rows of samples without gaps between them. A joint
    that hardly moves, compared with the joint that moves most, is not checked.
    """
    error, moved = np.zeros(position.shape[1]), np.zeros(position.shape[1])
    for rows in stretches:
        t, q, v = times[rows], position[rows], velocity[rows]
        steps = 0.5 * (v[1:] + v[:-1]) * np.diff(t)[:, np.newaxis]
        integral = np.concatenate([np.zeros((1, q.shape[1])), np.cumsum(steps, axis=0)])
        count = max(int((t[-1] - t[0]) / WINDOW), 1)
        edges = np.searchsorted(t, np.linspace(t[0], t[-1], count + 1)[1:-1])
        for q_window, x in zip(np.split(q, edges), np.split(integral, edges)):
            own = q_window - q_window.mean(axis=0)
            moved += np.sum(own**2, axis=0)
            error += np.sum((own - (x - x.mean(axis=0)))**2, axis=0)
    is_judged = moved > _LEAST_MOVE**2 * max(float(moved.max()), 1e-300)
    return np.asarray(is_judged & (error > LARGEST_ERROR**2 * moved))
