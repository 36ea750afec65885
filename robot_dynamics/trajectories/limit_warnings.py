# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Messages about states and efforts outside an arm's limits, for answers that are still given."""

from collections.abc import Iterator, Sequence

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.actuator import ActuatorLoad
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.trajectories.efforts import TrajectoryEfforts


def limit_warnings(
    arm: ArmModel, q: FloatArray, v: FloatArray, effort: FloatArray | None = None,
) -> list[str]:
    """
    Return one line for each joint whose position, velocity or effort is outside its limits.

    Arrays are (n,), or (samples, n): then a line names the sample that exceeds the limit most.
    """
    limits = arm.limits
    return [
        *lines_outside('position', arm.joint_names, q, limits.lower, limits.upper),
        *lines_outside('velocity', arm.joint_names, v, -limits.velocity, limits.velocity),
        *([] if effort is None else lines_outside(
            'effort', arm.joint_names, effort, -limits.effort, limits.effort)),
    ]


def motor_warnings(arm: ArmModel, load: ActuatorLoad) -> list[str]:
    """Return one such line for each motor whose current or voltage would exceed its limit."""
    return [
        f'{field} of the motor of {arm.joint_names[j]!r} is {values[index]:.6g} {unit}{sample}, '
        f'{ratios[index]:.3g} times its limit'
        for field, unit, values, ratios in (
            ('current', 'A', load.current, load.current_ratio),
            ('voltage', 'V', load.voltage, load.voltage_ratio))
        for j, index, sample in _worst(ratios - 1.0)]


def worst_in_words(result: TrajectoryEfforts) -> str:
    """Return the limit that a trajectory comes closest to, or exceeds most; '' without limits."""
    if result.worst_ratio == 0.0:
        return ''
    of_motor = '' if result.worst_limit == 'effort' else 'the motor of '
    return (
        f'{result.worst_limit} of {of_motor}{result.worst_joint!r} is {result.worst_ratio:.3g} '
        f'times its limit at {result.worst_time:g} s, the worst case')


def lines_outside(
    field: str, names: Sequence[str], values: FloatArray, lower: FloatArray, upper: FloatArray,
    tolerance: FloatArray | float = 0.0, times: FloatArray | None = None,
) -> list[str]:
    """
    Return such lines for values (n,), or (samples, n) with `times` [s] or the numbers of samples.

    The limits (n,) are widened by the `tolerance` (n,).
    """
    excess = np.maximum(lower - values, values - upper) - tolerance
    return [
        f'{field} of {names[j]!r} is {values[index]:.6g}{sample}, outside its limits '
        f'[{lower[j]:.6g}, {upper[j]:.6g}]' for j, index, sample in _worst(excess, times)]


def _worst(
    excess: FloatArray, times: FloatArray | None = None,
) -> Iterator[tuple[int, tuple[int, ...], str]]:
    """Yield each joint with an excess above 0, the index of the largest one, and its sample."""
    rows = np.atleast_2d(excess)
    for j in np.flatnonzero((rows > 0.0).any(axis=0)).tolist():
        i = int(rows[:, j].argmax())
        sample = f' in sample {i}' if times is None else f' at {times[i, j]:.6g} s'
        yield (j, (j,), '') if excess.ndim == 1 else (j, (i, j), sample)
