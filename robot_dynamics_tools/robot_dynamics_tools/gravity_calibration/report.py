# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The results of a calibration of gravity: verdicts, rows of text, and the HTML report."""

import numpy as np
from robot_dynamics.joints.effort_calibration import LARGEST_OFFSET, LARGEST_SCALE, LEAST_SCALE
from robot_dynamics.joints.units import units_of
from robot_dynamics.model_check.html_page import Grade, Origin, Page, Verdict
from robot_dynamics_tools.gravity_calibration import recorded_holds
from robot_dynamics_tools.gravity_calibration.calibration import (
    Calibration,
    LEAST_POSES,
    ScaleReference,
)
from robot_dynamics_tools.gravity_calibration.scale_fit import NAMES, ToolEstimate, UNITS
from robot_dynamics_tools.reporting.figures import comparison_panels, joint_figure
from robot_dynamics_tools.reporting.interactive import add_figure
from robot_dynamics_tools.reporting.text_table import cells, column_rows, Rows


def fact_rows(found: recorded_holds.RecordedCalibration) -> Rows:
    """Return the facts of a calibration, with a name and a value in each row."""
    calibration = found.calibration
    arm = calibration.arm
    rows: Rows = [('arm', f'{arm.name}, {arm.joint_count} joints')]
    for one, holds in zip(calibration.sets, found.recorded):
        rows.append((one.title, f'{", ".join(bag.name for bag in holds.bags)}: {len(holds.holds)} '
                            f'holds, {len(one.paired.times)} poses approached from both sides'))
    weight = calibration.sets[-1].weight
    if weight is not None:
        rows.append(('weight', f'{weight.mass:g} kg on {weight.link!r} at '
                               f'{weight.com.tolist()} m'))
    return [*rows, ('condition number', f'{calibration.condition:.3g}'),
            ('reference', calibration.reference.value)]


def joint_rows(found: Calibration) -> Rows:
    """Return scale and offset of each joint, with the half widths of the 95 % intervals."""
    units = [units_of(kind).effort for kind in found.arm.joint_kinds]
    return column_rows(
        'joint', found.arm.joint_names,
        ('effort scale', cells(found.scale, '.4f')),
        ('± (95 %)', cells(found.scale_interval, '.2g')),
        ('effort offset', cells(found.offset, '.3f', units)),
        ('± (95 %)', cells(found.offset_interval, '.2g', units)),
        ('noise at a pose', cells(found.noise, '.2g', units)),
        ('range of gravity', cells(found.torque_range, '.3g', units)),
        ('poses', map(str, found.pose_count)))


def tool_rows(tool: ToolEstimate) -> Rows:
    """Return mass and first moments of a tool with their 95 % intervals."""
    return column_rows(
        f'tool on {tool.link}', NAMES,
        ('value', [value if known else 'not observable' for value, known in zip(
            cells(tool.values, '.4g', UNITS), np.isfinite(tool.intervals))]),
        ('± (95 %)', ['given' if interval == 0.0 else cell for cell, interval in zip(
            cells(tool.intervals, '.2g', UNITS), tool.intervals)]))


def hold_rows(found: recorded_holds.RecordedHolds) -> Rows:
    """Return the holds, with positions and the side from which each joint came."""
    arm = found.arm
    rows: Rows = [('time [s]', *(
        f'{name} [{units_of(kind).position}]'
        for name, kind in zip(arm.joint_names, arm.joint_kinds)))]
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


GOOD_SCALE, GOOD_OFFSET = 0.01, 0.02
"""Half widths of the 95 % intervals of a good calibration: of the scale, and of the limit."""
UNLOADED = 0.01
"""A joint bears no gravity if its torque varies by less than this fraction of that of others."""
RULE = (
    f'Rule: good if the 95 % interval of the scale is within ±{100.0 * GOOD_SCALE:g} % and that '
    f'of the offset within ±{100.0 * GOOD_OFFSET:g} % of the effort limit, check if not, bad if '
    f'the scale is not in ±[{LEAST_SCALE:g}, {LARGEST_SCALE:g}] or the offset above '
    f'{100.0 * LARGEST_OFFSET:g} % of the effort limit, unknown if the holds do not determine the '
    'scale.')
USE = 'use the written parameter file'
SIDES = ('approach each pose by a motion of this joint in the positive direction, and again in '
         'the negative direction, without overshoot, and hold it for 1 s or longer')
POSES = 'add poses in which the gravity torque of this joint differs more'
WEIGHT = f'{POSES}, or attach the weight at a larger distance from the axis of this joint'
OTHER_SOURCE = ('tilt the base so that gravity loads this joint, or set the scale of a joint with '
                'the same drive; for gravity compensation nothing is missing')
INPUTS = ('check the unit of the effort (`measured_effort`), the joint names (`--map`), the '
          'direction of gravity, and the masses of the URDF, the tool and the weight')


def joint_verdicts(found: Calibration) -> list[Verdict]:
    """Return the verdict on each joint."""
    return [_verdict(found, j) for j in range(found.arm.joint_count)]


def is_accepted(found: Calibration) -> bool:
    """Return whether the nodes accept the scale and the offset of each joint."""
    return not any(verdict.grade is Grade.BAD for verdict in joint_verdicts(found))


def _verdict(found: Calibration, j: int) -> Verdict:
    name, unit = found.arm.joint_names[j], units_of(found.arm.joint_kinds[j]).effort
    limit = float(found.arm.given_report.limit[j])
    scale, of_scale, offset, of_offset = (float(values[j]) for values in (
        found.scale, found.scale_interval, found.offset, found.offset_interval))
    at_zero = f'offset {offset:.3g} ± {of_offset:.2g} {unit}'
    kept = f'scale {scale:.4g} is kept; {at_zero}'
    text = f'scale {scale:.4g} ± {of_scale:.2g}, {at_zero}'
    least = UNLOADED * found.reachable_range.max()
    if not found.has_enough_poses[j]:
        return Verdict(name, Grade.UNKNOWN, (
            f'approached from both sides in {found.pose_count[j]} poses, expected at least '
            f'{LEAST_POSES}: scale {scale:.4g} and offset {offset:.3g} {unit} are kept'), SIDES)
    if abs(offset) > LARGEST_OFFSET * limit:
        return Verdict(name, Grade.BAD, (
            f'{at_zero} is above {100.0 * LARGEST_OFFSET:g} % of the effort limit '
            f'{limit:g} {unit}'), INPUTS)
    if not found.is_observable[j]:
        if max(found.reachable_range[j], found.torque_range[j]) <= least:
            return Verdict(name, Grade.UNKNOWN, (
                f'gravity does not load this joint: {kept}'), OTHER_SOURCE)
        return Verdict(name, Grade.UNKNOWN, (
            f'the gravity torque varies by {found.torque_range[j]:.3g} {unit} in the poses, '
            f'within the limits by {found.reachable_range[j]:.3g} {unit}; the effort has the '
            f'standard deviation {found.noise[j]:.2g} {unit}: {kept}'), _more(found))
    if not LEAST_SCALE <= abs(scale) <= LARGEST_SCALE:
        return Verdict(name, Grade.BAD, (
            f'{text}: the scale is not in ±[{LEAST_SCALE:g}, {LARGEST_SCALE:g}]'), INPUTS)
    if of_scale <= GOOD_SCALE * abs(scale) and of_offset <= GOOD_OFFSET * limit:
        return Verdict(name, Grade.GOOD, text, USE)
    return Verdict(name, Grade.CHECK, text, _more(found))


def _more(found: Calibration) -> str:
    return WEIGHT if found.reference is ScaleReference.WEIGHT else POSES


def calibration_page(found: recorded_holds.RecordedCalibration, origin: Origin) -> str:
    """Return the report; raise MissingDependencyError without matplotlib."""
    calibration = found.calibration
    lines = [*filter(None, [found.mount]), *(
        line for one in found.recorded for line in one.lines)]
    page = Page(
        f'{calibration.arm.name}: calibration of gravity', joint_verdicts(calibration), RULE,
        origin)
    page.section('Calibration')
    page.table(fact_rows(found), has_head=False, kind='text')
    page.text('Torque at the joint = effort scale · (effort of the driver − effort offset).')
    if lines:
        page.section('Recordings')
        page.items(lines)
    page.section('Effort scale and offset')
    page.table(joint_rows(calibration))
    page.text('Noise: standard deviation of the mean effort at a pose. Range of gravity: of the '
              'gravity torque in the poses.')
    if calibration.tool is not None:
        page.section('Tool')
        page.table(tool_rows(calibration.tool))
        page.items(notes(calibration))
        page.text('m: mass; mx, my, mz: mass times centre of mass, in the frame of the link.')
    page.section('Effort at the poses')
    page.text('Measured: mean effort of the driver of both approaches. Model: calibrated.')
    _add_figures(page, calibration)
    for one, holds in zip(calibration.sets, found.recorded):
        page.section(f'Holds {one.title}')
        page.table(hold_rows(holds))
        page.text('+ and −: direction of the motion of the joint to the hold; ?: it did not '
                  'move, or overshot.')
    return page.html()


def _add_figures(page: Page, found: Calibration) -> None:
    """Add the efforts at the poses of each set, over the time of the recording."""
    arm, first = found.arm, 0
    for one in found.sets:
        title = one.title.capitalize()
        rows = slice(first, first + len(one.paired.times))
        measured = np.where(found.has_enough_poses, found.measured[rows], 0.0)
        model = np.where(found.has_enough_poses, found.model[rows], 0.0)
        add_figure(page, joint_figure(
            title, arm, comparison_panels(found.times[rows], measured, model)),
            f'{title}: measured and modelled effort at the poses')
        first = rows.stop
