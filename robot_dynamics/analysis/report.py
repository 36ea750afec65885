# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The report of an analysis: a figure, and one self-contained HTML page."""

from pathlib import Path
from typing import Any

import numpy as np
from robot_dynamics.analysis.bag_analysis import BagAnalysis
from robot_dynamics.analysis.summary import facts, limit_rows, residual_rows
from robot_dynamics.analysis.verdict import joint_verdicts, RULE
from robot_dynamics.arrays import FloatArray
from robot_dynamics.reporting.figures import (
    effort_panel,
    joint_figure,
    Panel,
    residual_panel,
    scatter_figure,
)
from robot_dynamics.reporting.html_page import image, items, Origin, png, report_page, table
from robot_dynamics.reporting.interactive import zoomable_figures


def effort_panels(analysis: BagAnalysis) -> list[Panel]:
    """Return the panels of measured and modelled effort, and of the modelled effort by term."""
    times, terms = analysis.motion.times, analysis.terms
    panels: list[Panel] = []
    measured, residual = analysis.measured, analysis.residual
    if measured is not None and residual is not None:
        panels.append(effort_panel('Measured and model', times, {
            'measured': _with_gaps(analysis, measured),
            'model': _with_gaps(analysis, terms.effort)}))
        panels.append(residual_panel(times, _with_gaps(analysis, residual)))
    by_term = {name: values for name, values in terms.by_name.items()
               if name != 'friction' or np.any(values)}
    panels.append(effort_panel('Model by term', times, {
        name: _with_gaps(analysis, values)
        for name, values in {**by_term, 'effort': terms.effort}.items()}))
    return panels


def effort_figure(analysis: BagAnalysis) -> Any:
    """Return the figure of `effort_panels`."""
    arm = analysis.arm
    compared = (
        'measured and modelled effort' if analysis.measured is not None else 'effort of the model')
    return joint_figure(
        f'{arm.name}: {compared} at the recorded motion', arm.joint_names, arm.joint_kinds,
        effort_panels(analysis))


def friction_figure(analysis: BagAnalysis) -> Any | None:
    """Return the figure of residual over velocity, or None if no effort was measured."""
    if analysis.residual is None:
        return None
    arm, counts = analysis.arm, analysis.motion.usable
    return scatter_figure(
        'Residual over velocity: effects of velocity only appear as a line or a step',
        arm.joint_names, arm.joint_kinds, analysis.motion.velocity[counts],
        analysis.residual[counts])


def _with_gaps(analysis: BagAnalysis, values: FloatArray) -> FloatArray:
    """Return the values with NaN at the last sample before each gap, where lines break."""
    broken = values.copy()
    broken[:-1][np.diff(analysis.motion.segment) > 0] = np.nan
    return broken


def write_report(analysis: BagAnalysis, path: Path, origin: Origin) -> None:
    """
    Write the page, and the figure of efforts as PNG next to the page, with the same name.

    Raises OSError, MissingDependencyError without matplotlib.
    """
    efforts = png(effort_figure(analysis))
    path.with_suffix('.png').write_bytes(efforts)
    scatter = friction_figure(analysis)
    path.write_text(
        _page(analysis, origin, efforts, None if scatter is None else png(scatter)),
        encoding='utf-8')


def _page(analysis: BagAnalysis, origin: Origin, efforts: bytes, scatter: bytes | None) -> str:
    read, arm = analysis.recording, analysis.arm
    title = f'{read.path.name}: measured effort and model' if analysis.measured is not None else (
        f'{read.path.name}: effort of the model')
    body = ['<h2>Recording</h2>', table(facts(analysis), has_head=False, kind='text')]
    if read.losses:
        body += ['<h2>Lost data</h2>', items(read.losses, 'loss')]
    if read.remarks:
        body += ['<h2>Remarks</h2>', items(read.remarks)]
    if analysis.statistics is not None:
        body += ['<h2>Residual: measured − model</h2>',
                 table(residual_rows(analysis.statistics, arm.joint_kinds)),
                 '<p>relative: RMS of the residual / RMS of the measured effort; R²: fraction of '
                 'the variance that the model explains.</p>']
    figures = zoomable_figures(
        arm.joint_names, arm.joint_kinds, effort_panels(analysis), None,
        image(efforts, 'Measured and model effort'))
    body += ['<h2>Use of limits</h2>', table(limit_rows(analysis)),
             '<h2>Effort over time</h2>', figures.figures]
    if scatter is not None:
        body += ['<h2>Residual over velocity</h2>', image(scatter, 'Residual over velocity')]
    return report_page(title, joint_verdicts(analysis), RULE, origin, body, figures.head)
