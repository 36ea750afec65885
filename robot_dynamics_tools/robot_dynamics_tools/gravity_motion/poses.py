# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The poses of a calibration motion: selected for the arm, or read from a file; their torques."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.payload import Payload
from robot_dynamics.urdf.yaml_text import load_yaml
from robot_dynamics.validation import check_scalar, LARGEST_VALUE
from robot_dynamics_tools.gravity_calibration.calibration import LEAST_POSES
from robot_dynamics_tools.gravity_calibration.poses import approach_distance, COUNTS, select_poses
from robot_dynamics_tools.gravity_motion.plan import position_bounds

MOST_IN_FILE = 30
LARGEST_SHARE = 0.8
"""Largest share of the effort limit that gravity may take at a pose."""


class PoseChoice(NamedTuple):
    """
    Which poses are used: of a file, or `number` selected ones within `ranges`.

    `least` is the smallest number in a file.
    """

    file: Path | None = None
    number: int = 10
    seed: int = 0
    ranges: Sequence[Sequence[str]] = ()
    least: int = LEAST_POSES


def chosen_poses(
    arm: ArmModel, choice: PoseChoice, approach: FloatArray, weight: Payload | None,
) -> FloatArray:
    """
    Return the poses (m, n), which are within the bounds, and at which the arm can hold itself.

    `approach` (n,) is the distance δ from which each pose is approached. With `weight`, the arm
    holds that as well. Raises InvalidInputError.
    """
    low, high = position_bounds(arm, choice.ranges, approach, is_finite=choice.file is None)
    if choice.file is not None:
        poses = read_poses(choice.file, arm.joint_names, choice.least)
    else:
        count = int(check_scalar('--count', choice.number, *COUNTS))
        loaded = arm if weight is None else arm.with_payloads([*arm.payloads, weight])
        within = approach_distance(arm)
        poses = select_poses(loaded, count, low - within, high + within, choice.seed).positions
    names, slack = arm.joint_names, 1e-9
    for i, j in np.argwhere((poses < low - slack) | (poses > high + slack))[:1]:
        raise InvalidInputError(
            f'pose {i + 1} has {names[j]} at {poses[i, j]:g}, expected a value in '
            f'[{low[j]:g}, {high[j]:g}]: the position limits and --range, less the approach')
    for load in (None,) if weight is None else (None, weight):
        share = gravity_share(arm, poses, load)
        for i, j in np.argwhere(share > LARGEST_SHARE)[:1]:
            added = '' if load is None else f' with {load.mass:g} kg on {load.link}'
            raise InvalidInputError(
                f'gravity at pose {i + 1} takes {100.0 * share[i, j]:.0f} % of the effort limit '
                f'of {names[j]}{added}, expected at most {100.0 * LARGEST_SHARE:.0f} %')
    return poses


def read_poses(file: Path, joint_names: Sequence[str], least: int = LEAST_POSES) -> FloatArray:
    """
    Return the poses (m, n) of a YAML file: `poses`, a list of JOINT: POSITION, [rad] or [m].

    It has at least so many poses. Raises InvalidInputError, which names the pose and the joint.
    """
    yaml = optional('yaml', 'a file of poses')
    try:
        document = load_yaml(file.read_text(encoding='utf-8'), 'a file of poses')
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise InvalidInputError(
            f'--poses {str(file)!r} cannot be read: {" ".join(str(error).split())}') from None
    entries = document.get('poses') if isinstance(document, dict) else None
    if not isinstance(entries, list) or not least <= len(entries) <= MOST_IN_FILE:
        raise InvalidInputError(
            f'--poses {str(file)!r} has no list `poses` of {least} to {MOST_IN_FILE} entries, '
            f'expected for example: poses: [{{{joint_names[0]}: 0.5, ...}}, ...]')
    return np.array([_pose(i, entry, joint_names) for i, entry in enumerate(entries, 1)])


def gravity_share(arm: ArmModel, poses: FloatArray, weight: Payload | None = None) -> FloatArray:
    """Return |g| at the poses as a share of the effort limits, (m, n); 0 without a limit."""
    loaded = arm if weight is None else arm.with_payloads([*arm.payloads, weight])
    return np.asarray(np.abs(RigidBody(loaded).gravity_batch(poses)) / arm.limits.effort)


def _pose(number: int, entry: object, joint_names: Sequence[str]) -> list[float]:
    names = list(entry) if isinstance(entry, dict) else []
    if not isinstance(entry, dict) or sorted(map(str, names)) != sorted(joint_names):
        raise InvalidInputError(
            f'pose {number} has {names or entry!r}, expected a position of each of '
            f'{list(joint_names)}')
    return [
        check_scalar(f'pose {number}, {name}', entry[name], -LARGEST_VALUE, LARGEST_VALUE)
        for name in joint_names]
