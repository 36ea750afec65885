# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The checks of a connection, a printed line each, and what they give: parameters and a report."""

from collections.abc import Sequence
from datetime import datetime
import json

import numpy as np
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model_check.html_page import Grade, Origin, Page, Verdict
from robot_dynamics_tools.gravity_calibration.holds import Hold
from robot_dynamics_tools.reporting.figures import comparison_panels, joint_figure
from robot_dynamics_tools.reporting.interactive import add_figure

GOOD, CHECK, BAD, UNKNOWN = Grade.GOOD, Grade.CHECK, Grade.BAD, Grade.UNKNOWN
Settings = dict[str, tuple[object, str]]
"""Values of parameters by their full names, each with a comment."""
USUAL = 'joint_states:=/joint_states', 'effort_command:=/effort_command'
"""Remappings that change nothing."""
RULE = ('Rule: bad forbids the parameter file, check changes a parameter or needs a look, unknown '
        'is not shown by this robot in these poses.')


class Checklist(list[Verdict]):
    """The checks so far; each is printed when it is added."""

    def add(
        self, name: str, grade: Grade | bool, value: str, expected: str, remedy: str = '',
    ) -> None:
        """Add a check; a grade True is GOOD, False CHECK. GOOD has no remedy."""
        if not isinstance(grade, Grade):
            grade = GOOD if grade else CHECK
        self.append(Verdict(name, grade, f'{value} (expected: {expected})', (
            '' if grade is GOOD else remedy)))
        print(f'{grade.value[0]:8} {name}: {self[-1].text}' + (
            f'; to do: {self[-1].next_step}' if self[-1].next_step else ''), flush=True)

    @property
    def bad(self) -> list[Verdict]:
        """The checks that forbid a parameter file."""
        return [check for check in self if check.grade is BAD]


def parameter_file(settings: Settings, remaps: Sequence[str], name: str) -> str:
    """Return the parameter file `name` of `dynamics_node`, with a comment per value."""
    options = ''.join(f' -r {remap}' for remap in remaps if remap not in USUAL)
    lines = [
        f'# By `ros2 dynamics connect`, {datetime.now():%Y-%m-%d %H:%M}.', '#',
        f'#   ros2 run robot_dynamics dynamics_node --ros-args --params-file {name}{options}',
        '/**/dynamics:', '  ros__parameters:']
    for key, (value, comment) in sorted(settings.items()):
        lines += [f'    # {comment}', f'    {key}: {json.dumps(value)}']
    return '\n'.join(lines) + '\n'


def report_page(
    arm: ArmModel, checks: Checklist, settings: Settings, holds: Sequence[Hold], origin: Origin,
) -> str:
    """Return the report of the checks; with figures if the arm reported efforts."""
    page = Page(f'{arm.name}: connection', checks, RULE, origin, 'checks')
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
