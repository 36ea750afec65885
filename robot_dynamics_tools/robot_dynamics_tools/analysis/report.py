# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The report of an analysis: verdicts, tables, a figure, and one self-contained HTML page.

The verdict on the model at each joint names the main cause of the residual r = measured − model.
Three simple causes are compared: a constant offset, friction (a viscous and a Coulomb
coefficient), and a factor between measured and modelled effort. A cause dominates if its
least-squares fit explains at least half of the mean square of r; of several, the one that explains
most is named.
"""

from collections.abc import Iterable, Sequence
from itertools import repeat
from pathlib import Path

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.units import units_of
from robot_dynamics.model_check.html_page import Grade, Origin, Page, Verdict
from robot_dynamics.tools.command_line import write_file
from robot_dynamics_tools.analysis.bag_analysis import BagAnalysis, LimitUse, ResidualStatistics
from robot_dynamics_tools.reporting import figures
from robot_dynamics_tools.reporting.interactive import add_figure, add_time_figures
from robot_dynamics_tools.reporting.text_table import cells, column_rows, percent, Rows


def facts(analysis: BagAnalysis) -> Rows:
    """Return the facts of the comparison, with a name and a value in each row."""
    read, motion = analysis.recording, analysis.motion
    measured = [field for field in ('position', 'velocity', 'effort')
                if getattr(read.series, field) is not None]
    counted = int(motion.usable.sum())
    return [
        ('recording', str(read.path)),
        ('topic', f'{read.topic}, with {", ".join(measured)}'),
        ('arm', f'{read.arm.name}, {read.arm.joint_count} joints'),
        ('samples', f'{len(read.series.stamps_ns)} in {read.series.times[-1]:.2f} s at '
                    f'{motion.sample_rate_hz:.4g} Hz; {counted} used, without those near gaps '
                    'and ends'),
        ('filter', f'Butterworth, order 4, forward and backward, {motion.cutoff_hz:.3g} Hz: '
                   f'{motion.cutoff_reason}'),
    ]


def residual_rows(statistics: ResidualStatistics, joint_kinds: Sequence[str]) -> Rows:
    """Return the residual of each joint, after a row of titles."""
    units = [units_of(kind).effort for kind in joint_kinds]
    return column_rows(
        'joint', statistics.joint_names,
        ('RMS measured', cells(statistics.rms_measured, '.3f', units)),
        ('RMS residual', cells(statistics.rms, '.3f', units)),
        ('relative', map(percent, statistics.relative)),
        ('mean residual', cells(statistics.mean, '+.3f', units)),
        ('largest residual', cells(statistics.largest, '.3f', units)),
        ('R²', cells(statistics.r_squared, '.3f')))


def limit_use_rows(
    use: LimitUse, joint_names: Sequence[str], joint_kinds: Sequence[str], whose: str,
) -> Rows:
    """Return rows of the use of limits; `whose` names the effort: measured or model."""
    def of_limit(values: Iterable[float], form: str, units: Iterable[str]) -> list[str]:
        return ['no limit' if cell == '-' else cell for cell in cells(values, form, units)]

    return column_rows(
        'joint', joint_names,
        (f'largest {whose} effort', of_limit(100.0 * use.effort, '.0f', repeat('% of limit'))),
        ('largest velocity', of_limit(100.0 * use.velocity, '.0f', repeat('% of limit'))),
        ('margin to position limit', of_limit(
            use.position, '.3f', [units_of(kind).position for kind in joint_kinds])))


GOOD, POOR = 0.1, 0.5
"""Relative residuals up to which a model is good, and above which it is bad."""
DOMINANT = 0.5
"""Fraction of the mean square of the residual that a dominant cause explains."""
UNIT = 2.0
"""A factor between measured and modelled effort beyond this suggests another unit."""
SLOW = 0.02
"""Fraction of the largest velocity over which the fitted sign of Coulomb friction changes."""
RULE = (
    f'Rule: residual, RMS relative to the RMS of the measured effort: good up to {100.0 * GOOD:g} '
    f'%, check up to {100.0 * POOR:g} %, bad above. A cause dominates if its fit explains at '
    f'least {100.0 * DOMINANT:g} % of the mean square of the residual: a constant offset; '
    'viscous and Coulomb friction; a factor between measured and modelled effort.')
MASSES = ('check payload and gravity of the model, then run `identify` with this recording, or '
          'with a trajectory generated with `excite`')
FRICTION = ('run `identify` with this recording: it fits `friction.viscous` and '
            '`friction.coulomb`, among others')
OFFSET = ('check the zero of the effort sensor, the payload, and the direction of gravity; '
          '`identify` fits the offset as `effort.report_offset`')
SCALE = 'check the unit of the effort: parameter `measured_effort`, or `identify --effort current`'


def joint_verdicts(analysis: BagAnalysis) -> list[Verdict]:
    """Return the verdict on each joint."""
    names = analysis.arm.joint_names
    if analysis.measured is None or analysis.statistics is None:
        return [Verdict(
            name, Grade.UNKNOWN, 'the model is not compared, because there is no measured effort',
            'record joint states with effort') for name in names]
    used = analysis.motion.usable
    velocity, model = analysis.motion.velocity[used], analysis.terms.effort[used]
    residual = analysis.measured[used] - model
    return [
        joint_verdict(name, float(analysis.statistics.relative[j]), residual[:, j],
                      velocity[:, j], model[:, j])
        for j, name in enumerate(names)]


def joint_verdict(
    name: str, relative: float, residual: FloatArray, velocity: FloatArray, model: FloatArray,
) -> Verdict:
    """
    Return the verdict on one joint from its residual, velocity and modelled effort, each (m,).

    `relative` is the RMS of the residual divided by that of the measured effort.
    """
    if np.isnan(relative):
        return without_effort(name)
    size = f'residual {percent(relative)} of the effort'
    if relative <= GOOD:
        return Verdict(name, Grade.GOOD, f'the model predicts the effort: {size}', 'use the model')
    grade = Grade.CHECK if relative <= POOR else Grade.BAD
    text, step = _cause(residual, velocity, model)
    return Verdict(name, grade, f'{text}; {size}', step)


def without_effort(name: str) -> Verdict:
    """Return the verdict on a joint whose measured effort is zero."""
    return Verdict(name, Grade.UNKNOWN, 'the measured effort is zero',
                   'check that the driver publishes the effort of this joint')


def _cause(residual: FloatArray, velocity: FloatArray, model: FloatArray) -> tuple[str, str]:
    """Return the dominant cause of a residual, and the next step."""
    fastest = float(np.abs(velocity).max())
    sign = np.tanh(velocity / (SLOW * fastest)) if fastest > 0.0 else velocity
    friction, _ = _explained(residual, np.column_stack([velocity, sign]))
    offset, _ = _explained(residual, np.ones((len(residual), 1)))
    scaled, change = _explained(residual, model[:, None])
    factor = 1.0 + float(change[0])
    causes = [
        (friction, 'friction dominates: it explains', FRICTION),
        (offset, 'a constant offset dominates: it explains', OFFSET),
        (scaled, f'measured effort is {factor:.3g} times the model, which explains',
         MASSES if 1.0 / UNIT <= factor <= UNIT else SCALE)]
    share, text, step = max(causes)
    if share < DOMINANT:
        return 'no single cause dominates: masses, payload or several causes', MASSES
    return f'{text} {100.0 * share:.0f} % of the mean square of the residual', step


def _explained(residual: FloatArray, columns: FloatArray) -> tuple[float, FloatArray]:
    """Return the fraction of the mean square that a fit explains, and its coefficients."""
    fit = np.linalg.lstsq(columns, residual, rcond=None)[0]
    rest = residual - columns @ fit
    return 1.0 - float(rest @ rest / (residual @ residual)), np.asarray(fit, dtype=np.float64)


def effort_panels(analysis: BagAnalysis) -> list[figures.Panel]:
    """Return the panels of measured and modelled effort, and of the modelled effort by term."""
    times, terms = analysis.motion.times, analysis.terms
    panels: list[figures.Panel] = []
    if analysis.measured is not None:
        panels += figures.comparison_panels(times, *(
            _with_gaps(analysis, values) for values in (analysis.measured, terms.effort)))
    by_term = {name: values for name, values in terms.by_name.items()
               if name != 'friction' or np.any(values)}
    panels.append(figures.effort_panel('Model by term', times, {
        name: _with_gaps(analysis, values)
        for name, values in {**by_term, 'effort': terms.effort}.items()}))
    return panels


def _with_gaps(analysis: BagAnalysis, values: FloatArray) -> FloatArray:
    """Return the values with NaN at the last sample before each gap, where lines break."""
    broken = values.copy()
    broken[:-1][np.diff(analysis.motion.segment) > 0] = np.nan
    return broken


def write_report(analysis: BagAnalysis, path: Path, origin: Origin) -> None:
    """
    Write the page, and the figure of efforts as PNG next to the page, with the same name.

    Raises ToolError, MissingDependencyError without matplotlib.
    """
    read, arm = analysis.recording, analysis.arm
    title = f'{read.path.name}: measured effort and model' if analysis.measured is not None else (
        f'{read.path.name}: effort of the model')
    page = Page(title, joint_verdicts(analysis), RULE, origin)
    page.section('Recording')
    page.table(facts(analysis), has_head=False, kind='text')
    if read.remarks:
        page.section('Remarks')
        page.items(read.remarks)
    if analysis.statistics is not None:
        page.section('Residual: measured − model')
        page.table(residual_rows(analysis.statistics, arm.joint_kinds))
        page.text('relative: RMS of the residual / RMS of the measured effort; R²: fraction of '
                  'the variance that the model explains.')
    page.section('Use of limits')
    page.table(limit_use_rows(
        analysis.limit_use, arm.joint_names, arm.joint_kinds,
        'model' if analysis.measured is None else 'measured'))
    page.section('Effort over time')
    compared = (
        'measured and modelled effort' if analysis.measured is not None else 'effort of the model')
    write_file(path.with_suffix('.png'), add_time_figures(
        page, arm, f'{arm.name}: {compared} at the recorded motion', effort_panels(analysis),
        'Measured and model effort'))
    if analysis.residual is not None:
        page.section('Residual over velocity')
        used = analysis.motion.usable
        add_figure(page, figures.scatter_figure(
            'Residual over velocity: effects of velocity only appear as a line or a step', arm,
            analysis.motion.velocity[used], analysis.residual[used]), 'Residual over velocity')
    write_file(path, page.html())
