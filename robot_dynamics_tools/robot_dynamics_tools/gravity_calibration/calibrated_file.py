# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The parameter file of a calibration: the given file, with effort scales and offsets."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from robot_dynamics.urdf.yaml_text import load_yaml
from robot_dynamics.validation import lower_triangle
from robot_dynamics_tools.gravity_calibration.calibration import Calibration
from robot_dynamics_tools.gravity_calibration.recorded_holds import RecordedCalibration
from robot_dynamics_tools.yaml_output import dump_yaml, rounded

SECTIONS = '/**', '/**/dynamics', 'dynamics', '/dynamics'
"""Sections of the node in a parameter file; a later one overrides an earlier one."""
_DIGITS, _COVARIANCE_DIGITS = 6, 10


def calibrated_file(
    given: str, found: Calibration, comments: Sequence[str] = (),
    command: Calibration | None = None,
) -> str:
    """
    Return a parameter file of ROS 2 with scale, offset and covariance of the measured efforts.

    `command` is the calibration of the command; without it, its parameters are kept.
    `given` is the text of the previous file, or ''. Its other parameters, also those of other
    nodes, are kept, its comments are not. The new parameters are in the last section that applies
    to `dynamics`, and have one value for each of the parameter `joints`, which is added if the
    file does not set it. Joints that were not recorded keep their values, which count as exact.
    """
    document = load_yaml(given, 'a parameter file') or {}
    present = [name for name in SECTIONS if isinstance(document.get(name), dict)] or ['/**']
    sections = [document.setdefault(name, {}).setdefault('ros__parameters', {})
                for name in present]
    before: dict[str, Any] = {}
    for values in sections:
        before |= _taken_out(values, command is not None)
    values = sections[-1]
    if not any(section.get('joints') for section in sections):
        values['joints'] = list(found.arm.joint_names)
    joints = [section['joints'] for section in sections if section.get('joints')][-1]
    values['effort'] = {**values.get('effort', {}), **{
        f'{direction}_{name}': _in_order(
            one, joints, before.get(f'effort.{direction}_{name}') or [default], name)
        for direction, one in (('report', found), ('command', command)) if one is not None
        for name, default in (('scale', 1.0), ('offset', 0.0))},
        'report_covariance': _covariance(found, joints)}
    return dump_yaml(document, comments, 'a parameter file')


def _taken_out(values: dict[str, Any], has_command: bool) -> dict[str, Any]:
    """Remove the calibrated parameters of a section, and return them by their full names."""
    names = ['report_scale', 'report_offset', 'report_covariance', *(
        ('command_scale', 'command_offset') if has_command else ())]
    found: dict[str, Any] = {}
    for group, prefix in ((values, 'effort.'), (values.get('effort'), '')):
        if isinstance(group, dict):
            found |= {f'effort.{name}': group.pop(f'{prefix}{name}') for name in names
                      if f'{prefix}{name}' in group}
    return found


def _in_order(
    found: Calibration, joints: Sequence[str], before: Sequence[float], name: str,
) -> list[float]:
    """Return one value for each joint, that `before` if it is not calibrated."""
    values = dict(zip(joints, np.broadcast_to(np.array(before, float), len(joints)).tolist()))
    values |= zip(found.arm.joint_names, rounded(getattr(found, name), _DIGITS))
    return [values[joint] for joint in joints]


def _covariance(found: Calibration, joints: Sequence[str]) -> list[float]:
    """Return the lower triangle of the covariance of all scales, then all offsets."""
    n, recorded = len(joints), found.arm.joint_names
    places = [(joints.index(joint), j) for j, joint in enumerate(recorded) if joint in joints]
    to, source = np.array(places, dtype=np.int64).reshape(-1, 2).T
    to, source = np.concatenate([to, n + to]), np.concatenate([source, len(recorded) + source])
    C = np.zeros((2 * n, 2 * n))
    C[np.ix_(to, to)] = found.covariance[np.ix_(source, source)]
    return rounded(lower_triangle(C), _COVARIANCE_DIGITS)


def header(found: RecordedCalibration, path: Path) -> list[str]:
    """Return the comments of a parameter file with this path."""
    names = ', '.join(bag.name for one in found.recorded for bag in one.bags)
    return [
        f'Effort scale and offset by `calibrate_gravity` from {names}.',
        found.calibration.reference.value,
        '',
        f'  ros2 run robot_dynamics dynamics_node --ros-args --params-file {path.name}',
    ]
