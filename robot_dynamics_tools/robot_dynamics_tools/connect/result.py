# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The result of a connection: parameter file, completed description, and report page."""

from collections.abc import Sequence
from datetime import datetime
import json
from pathlib import Path

import numpy as np
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model_check.html_page import Origin, Page
from robot_dynamics_tools.connect.checklist import Checklist
from robot_dynamics_tools.gravity_calibration.holds import Hold
from robot_dynamics_tools.reporting.figures import comparison_panels, joint_figure
from robot_dynamics_tools.reporting.interactive import add_figure

Settings = dict[str, tuple[object, str]]
"""Values of parameters by their full names, each with a comment."""
USUAL = 'joint_states:=/joint_states', 'effort_command:=/effort_command'
"""Remappings that change nothing."""
RULE = ('Rule: bad forbids the parameter file, check changes a parameter or needs a look, unknown '
        'is not shown by this robot in these poses.')


def parameter_file(settings: Settings, remaps: Sequence[str], path: Path) -> str:
    """Return a parameter file of `dynamics_node` with a comment per value."""
    options = ''.join(f' -r {remap}' for remap in remaps if remap not in USUAL)
    lines = [
        f'# By `ros2 dynamics connect`, {datetime.now():%Y-%m-%d %H:%M}.', '#',
        f'#   ros2 run robot_dynamics dynamics_node --ros-args --params-file {path.name}{options}',
        '/**/dynamics:', '  ros__parameters:']
    groups: set[str] = set()
    for name, (value, comment) in sorted(
            settings.items(), key=lambda item: item[0].rpartition('.')[0]):
        group, dot, key = name.rpartition('.')
        if dot and group not in groups:
            groups.add(group)
            lines.append(f'    {group}:')
        indent = '      ' if dot else '    '
        lines += [f'{indent}# {comment}', f'{indent}{key}: {json.dumps(value)}']
    return '\n'.join(lines) + '\n'


def report_page(
    arm: ArmModel, checks: Checklist, settings: Settings, holds: Sequence[Hold], origin: Origin,
) -> str:
    """Return the report of the checks; with figures if the arm reported efforts."""
    page = Page(f'{arm.name}: connection', [check.verdict for check in checks], RULE, origin,
                'checks')
    page.section('Parameters')
    page.table([('parameter', 'value', 'from'), *(
        (name, json.dumps(value), comment) for name, (value, comment) in settings.items())],
        kind='text')
    if holds:
        q, effort = (np.array([getattr(hold, name) for hold in holds])
                     for name in ('position', 'effort'))
        title = 'Reported effort and g(q) of the description, at rest'
        page.section(title)
        add_figure(page, joint_figure(title, arm, comparison_panels(
            np.array([hold.start for hold in holds]), effort, RigidBody(arm).gravity_batch(q))),
            title)
    return page.html()
