# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The results of a calibration of gravity as rows of text, for the console and the report."""

import numpy as np
from robot_dynamics.analysis.summary import Rows
from robot_dynamics.gravity_calibration.calibration import Calibration
from robot_dynamics.gravity_calibration.gravity_model import NAMES, UNITS
from robot_dynamics.gravity_calibration.recorded_holds import RecordedCalibration, RecordedHolds
from robot_dynamics.gravity_calibration.verdict import effort_unit


def fact_rows(found: RecordedCalibration) -> Rows:
    """Return the facts of a calibration, with a name and a value in each row."""
    calibration = found.calibration
    arm = calibration.arm
    rows: Rows = [('arm', f'{arm.name}, {arm.joint_count} joints')]
    for title, one, holds in zip(
            ('without weight', 'with the weight'), calibration.sets,
            (found.without_weight, found.with_weight)):
        assert holds is not None
        rows.append((title, f'{", ".join(bag.name for bag in holds.bags)}: {len(holds.holds)} '
                            f'holds, {len(one.paired.times)} poses approached from both sides'))
    weight = calibration.sets[-1].weight
    if weight is not None:
        rows.append(('weight', f'{weight.mass:g} kg on {weight.link!r} at '
                               f'{weight.com.tolist()} m'))
    return [*rows, ('condition number', f'{calibration.condition:.3g}'),
            ('reference', calibration.reference.value)]


def joint_rows(found: Calibration) -> Rows:
    """Return scale and offset of each joint, with the half widths of the 95 % intervals."""
    rows: Rows = [('joint', 'effort scale', '± (95 %)', 'effort offset', '± (95 %)',
                   'noise at a pose', 'range of gravity', 'poses')]
    for j, name in enumerate(found.arm.joint_names):
        unit = effort_unit(found, j)
        rows.append((
            name, f'{found.scale[j]:.4f}', _finite(found.scale_interval[j], ''),
            f'{found.offset[j]:.3f} {unit}',
            _finite(found.offset_interval[j], f' {unit}'),
            f'{found.noise[j]:.2g} {unit}', f'{found.torque_range[j]:.3g} {unit}',
            str(found.pose_count[j])))
    return rows


def tool_rows(found: Calibration) -> Rows:
    """Return mass and first moments of the tool with their 95 % intervals, if estimated."""
    if found.tool is None:
        return []
    rows: Rows = [(f'tool on {found.tool.link}', 'value', '± (95 %)')]
    for name, unit, value, interval in zip(
            NAMES, UNITS, found.tool.values, found.tool.intervals):
        is_known = np.isfinite(interval)
        rows.append((name, f'{value:.4g} {unit}' if is_known else 'not observable', (
            'given' if interval == 0.0 else _finite(interval, f' {unit}'))))
    return rows


def hold_rows(found: RecordedHolds) -> Rows:
    """Return the holds, with positions and the side from which each joint came."""
    arm = found.arm
    units = ['m' if kind == 'prismatic' else 'rad' for kind in arm.joint_kinds]
    rows: Rows = [('time [s]', *(
        f'{name} [{unit}]' for name, unit in zip(arm.joint_names, units)))]
    return rows + [(f'{hold.start:.1f} to {hold.end:.1f}', *(
        f'{q:.3f} {"−?+"[side + 1]}' for q, side in zip(hold.position, hold.approach)))
        for hold in found.holds]


def notes(found: Calibration) -> list[str]:
    """Return what a user must do with the tool that was estimated, in sentences."""
    if found.tool is None or found.tool.values[0] <= 0.0 or not np.isfinite(
            found.tool.deviations[0]):
        return []
    mass, moments = found.tool.values[0], np.where(
        np.isfinite(found.tool.deviations[1:]), found.tool.values[1:], 0.0)
    x, y, z = moments / mass
    return [f'The tool is not part of the parameter file. Set it in the running node: ros2 '
            f'dynamics payload {found.tool.link} {mass:.4g} --com {x:.4f} {y:.4f} {z:.4f}']


def _finite(value: float, unit: str) -> str:
    return f'{value:.2g}{unit}' if np.isfinite(value) else '-'
