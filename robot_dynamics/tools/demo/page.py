# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The HTML reports of both kinds of demo."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np
from robot_dynamics.analysis.report import joint_verdict as comparison_verdict
from robot_dynamics.analysis.report import RULE as COMPARISON_RULE
from robot_dynamics.analysis.residual import residual_statistics
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.reporting.html_page import (
    Grade,
    image,
    Origin,
    report_page,
    table,
    Verdict,
)
from robot_dynamics.reporting.interactive import zoomable_figures
from robot_dynamics.tools.demo.loop import LoopRun
from robot_dynamics.tools.demo.replay import Comparison, comparison_panels, comparison_rows
from robot_dynamics.tools.demo.report import (
    error_rows,
    FEW_ANSWERS,
    LARGEST_RMS,
    loop_panels,
    LoopReport,
    rate_lines,
)

AT_LIMIT = 0.98
"""Fraction of an effort limit from which the effort is at its limit."""
RULE = (f'Rule: good if the RMS of the tracking error is below {LARGEST_RMS:g} rad or m, bad '
        'otherwise.')
FASTER = ('raise `gains.natural_frequency` in steps of 20 %, or check friction and masses in '
          '`--parameters`')


def write_loop_page(
    report: LoopReport, run: LoopRun, arm: ArmModel, picture: Path, path: Path, origin: Origin,
) -> None:
    """Write the report of a closed loop, with the figure in `picture`; raise OSError."""
    figures = zoomable_figures(
        report.joint_names, report.joint_kinds, loop_panels(report, arm), None,
        image(picture.read_bytes(), 'Position, tracking error and effort by term'))
    lines = ''.join(f'<li>{escape(" ".join(line.split()))}</li>'
                    for line in rate_lines(report, run))
    path.write_text(report_page(
        f'{arm.name}: closed loop', loop_verdicts(report, arm), RULE, origin, [
            '<h2>Tracking error</h2>', table(error_rows(report)),
            '<h2>Rates</h2>', f'<ul>{lines}</ul>',
            '<h2>Position, tracking error and effort over time</h2>', figures.figures],
        figures.head), encoding='utf-8')


def loop_verdicts(report: LoopReport, arm: ArmModel) -> list[Verdict]:
    """Return the verdict on the tracking of each joint."""
    efforts = np.abs(report.terms['effort']).max(axis=0, initial=0.0)
    return [
        tracking_verdict(name, kind, rms, effort / limit, report.answered)
        for name, kind, rms, effort, limit in zip(
            report.joint_names, report.joint_kinds, report.rms.tolist(), efforts.tolist(),
            arm.limits.effort.tolist())]


def tracking_verdict(
    name: str, kind: str, rms: float, effort_ratio: float, answered: float,
) -> Verdict:
    """Return the verdict on one joint from its RMS error [rad] or [m] and its effort / limit."""
    unit = 'mm' if kind == 'prismatic' else 'mrad'
    size = f'RMS error {1e3 * rms:.3g} {unit}, limit {1e3 * LARGEST_RMS:g} {unit}'
    if rms < LARGEST_RMS:
        return Verdict(name, Grade.GOOD, f'the joint tracks: {size}', 'no change needed')
    if effort_ratio > AT_LIMIT:
        return Verdict(name, Grade.BAD, f'the effort reaches its limit: {size}',
                       'use a slower trajectory (`--duration`) or a smaller payload')
    if answered < FEW_ANSWERS:
        return Verdict(
            name, Grade.BAD, f'{100.0 * answered:.0f} % of the states were answered: {size}',
            'use a lower `--rate`')
    return Verdict(name, Grade.BAD, f'the joint does not track: {size}', FASTER)


def write_comparison_page(
    comparison: Comparison, picture: Path, path: Path, origin: Origin,
) -> None:
    """Write the report of a replay, with the figure in `picture`; raise OSError."""
    arm = comparison.arm
    figures = zoomable_figures(
        arm.joint_names, arm.joint_kinds, comparison_panels(comparison), None,
        image(picture.read_bytes(), 'Measured effort and model'))
    path.write_text(report_page(
        f'{arm.name}: replay of a recording', comparison_verdicts(comparison), COMPARISON_RULE,
        origin, [
            '<h2>Effort</h2>', table(comparison_rows(comparison)),
            '<p>relative: RMS of the residual / RMS of the measured effort; gravity only: the '
            'same with g(q) as the model.</p>',
            '<h2>Effort over time</h2>', figures.figures], figures.head), encoding='utf-8')


def comparison_verdicts(comparison: Comparison) -> Sequence[Verdict]:
    """Return the verdict on the model at each joint."""
    names, used = comparison.arm.joint_names, comparison.motion.usable
    measured = comparison.motion.effort
    if measured is None:
        return [Verdict(name, Grade.UNKNOWN, 'there is no measured effort',
                        'record joint states with effort') for name in names]
    model, velocity = comparison.terms['effort'][used], comparison.motion.velocity[used]
    relative = residual_statistics(measured[used], model, names).relative.tolist()
    return [
        comparison_verdict(
            name, relative[j], measured[used][:, j] - model[:, j], velocity[:, j], model[:, j])
        for j, name in enumerate(names)]
