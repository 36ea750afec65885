# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The type of joint trajectories, and the checks that reject invalid ones.

`make_trajectory` takes the fields of a message and returns a `JointTrajectory` in the joint order
of the arm, or raises a `TrajectoryError` that describes the fault.
The rules are those of `joint_trajectory_controller` (ros2_controllers, branch jazzy, function
`validate_trajectory_msg`) with the differences that docs/evidence/jtc.md lists.
"""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
import reprlib
from typing import Any

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.exceptions import (
    InvalidInputError,
    JointNamesError,
    PastTrajectoryError,
    TrajectoryError,
)
from robot_dynamics.validation import (
    check_scalar,
    check_unique,
    check_vector,
    holds_numbers,
    is_empty,
    LARGEST_VALUE,
)

Points = Sequence[npt.ArrayLike | None] | FloatArray
"""One row (n,) per point; None or an empty row for a point without the field."""

# The range of the seconds in builtin_interfaces/Duration.
_LONGEST_TIME = 2.0 ** 31

# Velocities up to this value count as zero in joint_trajectory_controller (float32 epsilon).
_ZERO_VELOCITY = float(np.finfo(np.float32).eps)


@dataclass(frozen=True, eq=False)
class TrajectoryPoint:
    """
    One point of a joint trajectory; its arrays are read-only.

    `time_from_start` [s]; `position` (n,) [rad or m]; `velocity` (n,) [rad/s or m/s] and
    `acceleration` (n,) [rad/s² or m/s²], or None if the sender omitted them.
    """

    time_from_start: float
    position: FloatArray
    velocity: FloatArray | None = None
    acceleration: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class JointTrajectory:
    """Points at strictly increasing times; every array is in the order of `joint_names`."""

    joint_names: tuple[str, ...]
    points: tuple[TrajectoryPoint, ...]

    def __repr__(self) -> str:
        duration = f', {self.duration:g} s' if self.points else ''
        return (f'<JointTrajectory of {len(self.joint_names)} joints '
                f'{reprlib.repr(self.joint_names)}, {len(self.points)} points{duration}>')

    @property
    def duration(self) -> float:
        """The time of the last point [s]."""
        return self.points[-1].time_from_start

    @cached_property
    def times_ns(self) -> list[int]:
        """The times of the points in whole nanoseconds."""
        return [nanoseconds(point.time_from_start) for point in self.points]

    @property
    def is_set_point(self) -> bool:
        """Whether this is a single streamed set-point, not a path."""
        return len(self.points) == 1


def make_trajectory(
    joint_names: Sequence[str],
    times: Sequence[float],
    positions: Points,
    velocities: Points = (),
    accelerations: Points = (),
    expected_joints: Sequence[str] = (),
) -> JointTrajectory:
    """
    Return a checked trajectory in the order of `expected_joints`.

    By default, that is the order of `joint_names`. `times` are the `time_from_start` of the points
    [s], rounded to 1 ns. `positions`, `velocities` and `accelerations` have one row per point, in
    the order of `joint_names`; an empty row means that the point omits the field, and `()` instead
    of all rows that all points do. A single point may have velocity and acceleration: it is a
    streamed set-point. The last of several points must be at rest.

    Raises TrajectoryError, whose message names point, field, value and expected values.
    """
    names = list(joint_names)
    expected = tuple(expected_joints) or tuple(names)
    try:
        _check_joint_names(names, expected)
        checked_times = _check_times(times)
        count = len(checked_times)
        q = _check_field('positions', positions, count, names, expected)
        v = _check_field('velocities', velocities, count, names, expected)
        a = _check_field('accelerations', accelerations, count, names, expected)
        _check_fields_together(q, v, a, names)
        _check_end_at_rest(v, names, expected)
    except TrajectoryError:
        raise
    except InvalidInputError as error:
        raise TrajectoryError(str(error)) from None
    if count == 1 and a[0] is not None and v[0] is None:
        v = _check_field('velocities', [[0.0] * len(names)], count, names, expected)
    points = tuple(
        TrajectoryPoint(t, position, velocity, acceleration)
        for t, position, velocity, acceleration in zip(checked_times, q, v, a)
        if position is not None)
    return JointTrajectory(expected, points)


def check_end_in_future(
    trajectory: JointTrajectory, stamp_ns: int, now_ns: int, max_age_ns: int = 0,
) -> None:
    """
    Raise PastTrajectoryError if a stamped trajectory ended more than `max_age_ns` before now.

    All times are nanoseconds of one clock; the stamp 0 means "now" and always passes.
    """
    end_ns = stamp_ns + nanoseconds(trajectory.duration)
    if stamp_ns != 0 and end_ns + max_age_ns < now_ns:
        raise PastTrajectoryError(
            f'header.stamp is {_in_seconds(stamp_ns)} s and the last point comes '
            f'{trajectory.duration:g} s later, which is {_in_seconds(now_ns - end_ns)} s before '
            f'now ({_in_seconds(now_ns)} s), expected an end in the future, or a zero stamp '
            'to start now')


def nanoseconds(seconds: float) -> int:
    """Return a duration in whole nanoseconds."""
    return round(seconds * NANOSECONDS_PER_SECOND)


def _in_seconds(time_ns: int) -> str:
    whole, rest = divmod(time_ns, NANOSECONDS_PER_SECOND)
    return f'{whole}.{rest:09d}'


def _check_joint_names(joint_names: Sequence[str], expected: tuple[str, ...]) -> None:
    if len(joint_names) == 0:
        raise JointNamesError(f'joint_names is empty, expected {list(expected)}')
    for name in joint_names:
        if name not in expected:
            raise JointNamesError(
                f'joint_names has {name!r}, expected only joints of this arm: {list(expected)}')
    try:
        check_unique('joint_names', joint_names)
    except InvalidInputError as error:
        raise JointNamesError(str(error)) from None
    missing = [name for name in expected if name not in joint_names]
    if missing:
        raise JointNamesError(
            f'joint_names is {list(joint_names)}, which lacks {missing}, expected all of '
            f'{list(expected)}')


def _check_times(times: Sequence[float]) -> list[float]:
    count = len(times)
    if count == 0:
        raise TrajectoryError('points is empty, expected at least one point')
    checked = _stack('time_from_start', list(times), ())
    for i in np.flatnonzero((checked < 0.0) | (checked > _LONGEST_TIME)):
        check_scalar(
            f'points[{i}].time_from_start', checked[i], minimum=0.0, maximum=_LONGEST_TIME)
    steps = np.diff(np.rint(checked * NANOSECONDS_PER_SECOND))
    for i in np.flatnonzero(steps <= 0.0):
        raise TrajectoryError(
            f'points[{i + 1}].time_from_start is {checked[i + 1]} s, expected more than the '
            f'{checked[i]} s of points[{i}], by 1 ns or more')
    return [float(t) for t in checked]


def _check_field(
    field: str, rows: Points, count: int, names: list[str], expected: tuple[str, ...],
) -> list[FloatArray | None]:
    """Return the rows in the order of `expected`, with None for each omitted field."""
    if len(rows) not in (0, count):
        raise TrajectoryError(
            f'{field} has {len(rows)} rows, expected {count}, one for each point')
    absent = [row is None or is_empty(row) for row in rows]
    if all(absent):
        return [None] * count
    matrix = _stack(field, [
        np.zeros(len(names)) if empty else row for row, empty in zip(rows, absent)], names)
    for i, j in np.argwhere(np.abs(matrix) > LARGEST_VALUE):
        check_scalar(
            f'points[{i}].{field}[{j}] ({names[j]})', matrix[i, j], -LARGEST_VALUE, LARGEST_VALUE)
    matrix = matrix[:, [names.index(name) for name in expected]]
    matrix.setflags(write=False)
    return [None if empty else row for row, empty in zip(matrix, absent)]


def _stack(field: str, rows: list[Any], names: Sequence[str]) -> FloatArray:
    """
    Return `rows` as one array; without `names` each row is one number.

    All rows are checked at once, because a path may have thousands of points; if the check fails,
    they are checked one by one to find the wrong row.
    """
    row_shape = (len(names),) if names else ()
    try:
        stacked = _as_matrix(rows, len(names))
    except (TypeError, ValueError, OverflowError):
        stacked = np.empty(0)
    if stacked.shape == (len(rows), *row_shape) and np.isfinite(stacked).all():
        return stacked
    labels = [f'points[{i}].{field}' for i in range(len(rows))]
    if not names:
        return np.array([check_scalar(label, row) for label, row in zip(labels, rows)])
    return np.array([
        check_vector(label, row, len(names), names) for label, row in zip(labels, rows)])


def _as_matrix(rows: list[Any], columns: int) -> FloatArray:
    """Return the rows as one array; the buffers of the rows of a message are joined."""
    if columns and all(type(row) is array and row.typecode == 'd' and len(row) == columns
                       for row in rows):
        return np.frombuffer(b''.join(rows), dtype=np.float64).reshape(-1, columns)
    if not holds_numbers(rows):
        raise TypeError('not all entries are numbers')
    return np.asarray(rows, dtype=np.float64)


def _check_fields_together(
    q: list[FloatArray | None],
    v: list[FloatArray | None],
    a: list[FloatArray | None],
    names: list[str],
) -> None:
    for i, position in enumerate(q):
        if position is None:
            raise TrajectoryError(
                f'points[{i}].positions is empty, expected {len(names)} values, one for each of '
                f'{names}: a point needs its positions')
    if len(q) == 1:
        return
    for i, (velocity, acceleration) in enumerate(zip(v, a)):
        if velocity is None and acceleration is not None:
            raise TrajectoryError(
                f'points[{i}].velocities is empty although accelerations are given, expected '
                f'{len(names)} values, one for each of {names}')


def _check_end_at_rest(
    v: list[FloatArray | None], names: list[str], expected: tuple[str, ...],
) -> None:
    last = v[-1]
    if len(v) == 1 or last is None:
        return
    for j in np.flatnonzero(np.abs(last) > _ZERO_VELOCITY):
        raise TrajectoryError(
            f'points[{len(v) - 1}].velocities[{names.index(expected[j])}] ({expected[j]}) is '
            f'{last[j]:g}, expected 0 at the last point, where the arm has to be at rest')
