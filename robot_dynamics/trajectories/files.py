# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Joint trajectories as files: a `trajectory_msgs/JointTrajectory` in YAML.

They are written in YAML's flow style, which is also JSON. A shell can therefore pass a file as a
message: `ros2 topic pub --once … trajectory_msgs/msg/JointTrajectory "$(cat trajectory.yaml)"`.
"""

from collections.abc import Mapping, Sequence
import json
from pathlib import Path
from typing import Any

from robot_dynamics.arrays import NANOSECONDS_PER_SECOND
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.trajectories.joint_trajectory import (
    JointTrajectory,
    make_trajectory,
    nanoseconds,
    TrajectoryPoint,
)
from robot_dynamics.urdf.yaml_text import load_yaml

DECIMALS = 12
"""Decimal places of every number: accelerations between points 1 ms apart are exact to 1e-5."""
FIELDS = ('positions', 'velocities', 'accelerations')


def write_trajectory(path: Path, trajectory: JointTrajectory) -> None:
    """Write a trajectory, one point per line, with the stamp 0 (from now); raise OSError."""
    points = ',\n  '.join(json.dumps(_as_data(point)) for point in trajectory.points)
    path.write_text(
        f'{{"joint_names": {json.dumps(list(trajectory.joint_names))}, "points": [\n'
        f'  {points}]}}\n', encoding='utf-8')


def read_trajectory(path: Path, joint_names: Sequence[str]) -> JointTrajectory:
    """
    Return the trajectory in a file, in the order of `joint_names`, checked like a message.

    Raises TrajectoryError, and InvalidInputError if the file does not exist.
    """
    data = _load(path)
    try:
        points = [_checked(point, f'points[{i}]', Mapping)
                  for i, point in enumerate(_checked(data.get('points'), 'points', list))]
        q, v, a = ([point.get(field) or () for point in points] for field in FIELDS)
        return make_trajectory(
            _checked(data.get('joint_names'), 'joint_names', list),
            [_seconds(point.get('time_from_start')) for point in points], q, v, a, joint_names)
    except TrajectoryError as error:
        raise TrajectoryError(f'{path}: {error}') from None


def _as_data(point: TrajectoryPoint) -> dict[str, Any]:
    values = dict(zip(FIELDS, (point.position, point.velocity, point.acceleration)))
    sec, nanosec = divmod(nanoseconds(point.time_from_start), NANOSECONDS_PER_SECOND)
    return {
        **{field: [round(float(x), DECIMALS) + 0.0 for x in array]
           for field, array in values.items() if array is not None},
        'time_from_start': {'sec': sec, 'nanosec': nanosec}}


def _load(path: Path) -> Mapping[str, Any]:
    yaml = optional('yaml', 'a trajectory file')
    try:
        data = load_yaml(path.read_text(encoding='utf-8'), 'a trajectory file')
    except (OSError, ValueError) as error:
        raise InvalidInputError(f'trajectory file {str(path)!r} cannot be read: {error}') from None
    except yaml.YAMLError as error:
        raise TrajectoryError(f'{path}: {" ".join(str(error).split())}') from None
    checked: Mapping[str, Any] = _checked(data, str(path), Mapping)
    return checked


def _checked(value: Any, field: str, kind: type) -> Any:
    if not isinstance(value, kind):
        words = 'a list' if kind is list else 'a mapping'
        raise TrajectoryError(
            f'{field} is {type(value).__name__}, expected {words}, as of a '
            'trajectory_msgs/msg/JointTrajectory')
    return value


def _seconds(time: Any) -> float:
    time = _checked({} if time is None else time, 'time_from_start', Mapping)
    try:
        return float(time.get('sec', 0)) + 1e-9 * float(time.get('nanosec', 0))
    except (TypeError, ValueError):
        raise TrajectoryError(
            f'time_from_start is {dict(time)}, expected sec and nanosec') from None
