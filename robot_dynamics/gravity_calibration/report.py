# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The HTML report of a calibration of gravity."""

import numpy as np
from robot_dynamics.gravity_calibration.calibration import Calibration
from robot_dynamics.gravity_calibration.recorded_holds import RecordedCalibration
from robot_dynamics.gravity_calibration.summary import (
    fact_rows,
    hold_rows,
    joint_rows,
    notes,
    tool_rows,
)
from robot_dynamics.gravity_calibration.verdict import joint_verdicts, RULE
from robot_dynamics.reporting.figures import effort_panel, joint_figure, residual_panel
from robot_dynamics.reporting.html_page import image, items, Origin, png, report_page, table


def calibration_page(found: RecordedCalibration, origin: Origin) -> str:
    """Return the report; raise MissingDependencyError without matplotlib."""
    calibration = found.calibration
    recordings = [one for one in (found.without_weight, found.with_weight) if one is not None]
    lines = [line for one in recordings for line in one.lines]
    body = ['<h2>Calibration</h2>',
            table(fact_rows(found), has_head=False, kind='text'),
            '<p>Torque at the joint = effort scale · (effort of the driver − effort offset).</p>']
    if lines:
        body += ['<h2>Recordings</h2>', items(lines)]
    body += [
        '<h2>Effort scale and offset</h2>', table(joint_rows(calibration)),
        '<p>Noise: standard deviation of the mean effort at a pose. Range of gravity: of the '
        'gravity torque in the poses.</p>']
    if calibration.tool is not None:
        body += ['<h2>Tool</h2>', table(tool_rows(calibration)), items(notes(calibration)),
                 '<p>m: mass; mx, my, mz: mass times centre of mass, in the frame of the link.'
                 '</p>']
    body += ['<h2>Effort at the poses</h2>',
             '<p>Measured: mean effort of the driver of both approaches. Model: calibrated.</p>',
             _figures(calibration)]
    for title, one in zip(('without weight', 'with the weight'), recordings):
        body += [f'<h2>Holds {title}</h2>', table(hold_rows(one)),
                 '<p>+ and −: direction of the motion of the joint to the hold; ?: it did not '
                 'move, or overshot.</p>']
    return report_page(
        f'{calibration.arm.name}: calibration of gravity', joint_verdicts(calibration), RULE,
        origin, body)


def _figures(found: Calibration) -> str:
    """Return the efforts at the poses of each set, over the time of the recording."""
    arm, first, figures = found.arm, 0, ''
    for one in found.sets:
        rows = slice(first, first + len(one.paired.times))
        measured = np.where(found.has_enough_poses, found.measured[rows], 0.0)
        model = np.where(found.has_enough_poses, found.model[rows], 0.0)
        title = 'With the weight' if one.weight is not None else 'Without weight'
        figure = joint_figure(title, arm.joint_names, arm.joint_kinds, [
            effort_panel('Effort', found.times[rows], {'measured': measured, 'model': model}),
            residual_panel(found.times[rows], measured - model)])
        figures += image(png(figure), f'{title}: measured and modelled effort at the poses')
        first = rows.stop
    return figures
