# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The HTML report of a map: a verdict and a next step per joint, then the figure."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model_check.html_page import Grade, Origin, Page, Verdict
from robot_dynamics_tools.pictures.torque_map import MapPanel
from robot_dynamics_tools.pictures.workspace_map import WorkspaceGravity
from robot_dynamics_tools.reporting.interactive import add_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESERVE = 0.8
"""Fraction of the effort limit up to which the reserve for motion is sufficient."""
VARIATION = 3.0
"""Ratio of the largest and the smallest inertia up to which constant gains are suitable."""
RULE = (
    f'Rule: effort is good up to {100.0 * RESERVE:g} % of its limit, check up to 100 %, bad '
    f'above. Inertia is good if its largest value is at most {VARIATION:g} times its smallest.')
REDUCE = ('reduce the payload, exclude these positions, or check the masses and limits with '
          '`check_model`')


def map_page(title: str, verdicts: Sequence[Verdict], figure: 'Figure', origin: Origin) -> str:
    """Return the report."""
    page = Page(title, verdicts, RULE, origin, subject='quantities')
    page.section('Map')
    add_figure(page, figure, title)
    return page.html()


def panel_verdict(panel: MapPanel) -> Verdict:
    """Return the verdict on the effort or the inertia of one joint."""
    low, high = float(panel.values.min()), float(panel.values.max())
    size = f'{low:.4g} to {high:.4g} {panel.unit}'
    if not panel.signed:
        ratio = high / low if low > 0.0 else np.inf
        is_constant = ratio <= VARIATION
        return Verdict(
            panel.title, Grade.GOOD if is_constant else Grade.CHECK,
            f'{size}: varies by a factor of {ratio:.3g}',
            'constant gains are suitable' if is_constant else
            'use computed torque, or tune constant gains at the largest inertia')
    if not np.isfinite(panel.limit):
        return Verdict(panel.title, Grade.UNKNOWN, f'{size}; the joint has no effort limit',
                       'add the effort limit to <limit> of the URDF')
    ratios = np.abs(panel.values) / panel.limit
    largest = float(ratios.max())
    size += f': at most {100.0 * largest:.0f} % of the limit of {panel.limit:.4g} {panel.unit}'
    if largest > 1.0:
        share = 100.0 * float((ratios > 1.0).mean())
        return Verdict(panel.title, Grade.BAD,
                       f'{size}; above the limit at {share:.1f} % of the positions', REDUCE)
    if largest > RESERVE:
        return Verdict(panel.title, Grade.CHECK, size, 'plan slow motion near these positions')
    return Verdict(panel.title, Grade.GOOD, size, 'no change needed')


def workspace_verdicts(arm: ArmModel, found: WorkspaceGravity) -> list[Verdict]:
    """Return the verdict on the arm over its workspace."""
    held = f'{100.0 * found.held:.1f} % of the positions tried can be held'
    largest = float(np.nanmax(found.most))
    grade = Grade.BAD if largest > 1.0 else Grade.CHECK if largest > RESERVE else Grade.GOOD
    return [Verdict(
        arm.name, grade, f'{held}; gravity is at most {100.0 * largest:.0f} % of an effort limit',
        REDUCE if largest > 1.0 else 'no change needed')]
