# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The checks of a connection, a printed line each, and what they give: parameters and a report."""

from collections.abc import Sequence
from datetime import datetime
import json
from textwrap import indent

import numpy as np
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model_check.html_page import Grade, Origin, Page, Verdict
from robot_dynamics_tools.gravity_calibration.holds import Hold
from robot_dynamics_tools.reporting.figures import comparison_panels, joint_figure
from robot_dynamics_tools.reporting.interactive import add_figure
from robot_dynamics_tools.yaml_output import dump_yaml

GOOD, CHECK, BAD, UNKNOWN = Grade.GOOD, Grade.CHECK, Grade.BAD, Grade.UNKNOWN
Settings = dict[str, tuple[object, str]]
"""Values of parameters by their full names, each with a comment."""
DESCRIPTION = 'robot_description'
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
    start = (f'# By `ros2 dynamics connect`, {datetime.now():%Y-%m-%d %H:%M}.\n#\n#   ros2 run '
             f'robot_dynamics dynamics_node --ros-args --params-file {name}{options}\n'
             '/**/dynamics:\n  ros__parameters:\n')
    return start + ''.join(
        indent(dump_yaml({key: value}, [comment], 'a parameter file'), '    ')
        for key, (value, comment) in sorted(
            settings.items(), key=lambda item: (item[0] == DESCRIPTION, item[0])))


def report_page(
    arm: ArmModel, checks: Checklist, settings: Settings, holds: Sequence[Hold], origin: Origin,
) -> str:
    """Return the report of the checks; with figures if the arm reported efforts."""
    page = Page(f'{arm.name}: connection', checks, RULE, origin, 'checks')
    page.section('Parameters')
    page.table([('parameter', 'value', 'from'), *(
        (name, json.dumps(value), comment) for name, (value, comment) in settings.items()
        if name != DESCRIPTION)],
        kind='text')
    if holds:
        q, effort = (np.array([getattr(hold, name) for hold in holds])
                     for name in ('position', 'effort'))
        times = np.array([[hold.start, hold.end, hold.end] for hold in holds]).ravel()
        measured, model = (np.repeat(one, 3, axis=0)
                           for one in (effort, RigidBody(arm).gravity_batch(q)))
        measured[2::3] = model[2::3] = np.nan  # no line between two holds
        title = 'Reported effort and g(q), at rest'
        page.section(title)
        add_figure(page, joint_figure(
            title, arm, comparison_panels(times, measured, model)), title)
    return page.html()
