# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The HTML report of an identification.

The verdict on the identified model at each joint compares the residual of the physically
consistent set, which is written to the files, on the test samples with that of the URDF and of the
URDF with friction.
"""

from itertools import repeat

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.regressor import body_names, COUNT, inertial_parameters
from robot_dynamics.model_check.html_page import Grade, Origin, Page, Verdict
from robot_dynamics_tools.analysis.report import GOOD, POOR, without_effort
from robot_dynamics_tools.identification import summary
from robot_dynamics_tools.identification.bag_identification import BagIdentification
from robot_dynamics_tools.identification.pipeline import Identification
from robot_dynamics_tools.identification.written_uncertainty import holding_deviation
from robot_dynamics_tools.reporting.figures import comparison_panels, scatter_figure, TimeBoundary
from robot_dynamics_tools.reporting.interactive import add_figure, add_time_figures
from robot_dynamics_tools.reporting.text_table import cells, column_rows, percent, Rows

BETTER = 1.05
"""Ratio of residuals above which another model is better."""
DOMINANT = 0.5
"""Fraction of the mean square of the residual of the URDF that friction alone removes."""
RULE = (
    f'Rule: residual of the consistent set on the test samples, RMS relative to the RMS of the '
    f'effort: good up to {100.0 * GOOD:g} %, check up to {100.0 * POOR:g} %, bad above. It is not '
    f'good if the residual of the URDF, with or without friction, is lower by more than '
    f'{100.0 * (BETTER - 1.0):.0f} %, or if the covariance leaves a deviation above '
    f'{100.0 * GOOD:g} % at rest in other poses. Friction dominates if it alone removes more than '
    'half of the mean square of the residual of the URDF.')
USE = 'use `identified.yaml`'
CONTRADICTED = 'resolve the contradictions of the recordings first'
RECORD = 'record a longer motion, or a trajectory generated with `excite`'
UNIT = ('check the unit of the effort (`--effort current`), the joint names (`--map`) and the '
        'payload (`--payload`)')
TEST = 'run `identify` with a smaller `--train-fraction`, or test with `analyze`'
POSES = 'record more poses of this joint, for example with `excite`'
REVERSALS = ('record this joint with faster motion and fewer standstills, for example a '
             'trajectory generated with `excite`')


def joint_verdicts(identification: Identification) -> list[Verdict]:
    """Return the verdict on each joint."""
    tests = identification.tests
    urdf, simple, consistent = (
        tests[model].relative() for model in ('urdf', 'urdf and friction', 'consistent'))
    if identification.is_cross_validated:
        return [Verdict(
            name, Grade.UNKNOWN, 'not tested: all samples were used for training', TEST)
            for name in identification.arm.joint_names]
    effort = np.sqrt(tests['consistent'].test_effort / max(tests['consistent'].samples[1], 1))
    verdicts = [
        in_other_poses(joint_verdict(name, *residuals), deviation / max(size, 1e-12))
        for name, deviation, size, *residuals in zip(
            identification.arm.joint_names, holding_deviation(identification).tolist(),
            effort.tolist(), urdf.tolist(), simple.tolist(), consistent.tolist())]
    if not any(recording.contradictions for recording in identification.recordings):
        return verdicts
    return [verdict._replace(grade=Grade.CHECK, next_step=CONTRADICTED)
            if verdict.grade == Grade.GOOD else verdict for verdict in verdicts]


def in_other_poses(verdict: Verdict, deviation: float) -> Verdict:
    """
    Return the verdict, not good if the effort at rest has a larger deviation than GOOD.

    `deviation` is relative to the RMS of the measured effort, by the covariance of the parameters.
    """
    if verdict.grade != Grade.GOOD or deviation <= GOOD:
        return verdict
    return verdict._replace(
        grade=Grade.CHECK, next_step=POSES,
        text=f'{verdict.text}; in other poses its effort at rest is known within ± '
        f'{percent(2.0 * deviation)} of this effort')


def joint_verdict(name: str, urdf: float, simple: float, consistent: float) -> Verdict:
    """
    Return the verdict on one joint from relative residuals on the test samples.

    They are those of the URDF, of the URDF with friction (`simple`), and of the consistent set.
    """
    if np.isnan(consistent):
        return without_effort(name)
    size = f'residual {percent(consistent)} of the effort (URDF: {percent(urdf)})'
    if simple**2 < (1.0 - DOMINANT) * urdf**2:
        size += f'; friction dominates (URDF with friction: {percent(simple)})'
    if consistent > BETTER * min(urdf, simple):
        which = 'the URDF with friction' if simple <= urdf else 'the URDF'
        return Verdict(name, Grade.CHECK if consistent <= POOR else Grade.BAD,
                       f'{which} predicts the effort better than the identified model: {size}',
                       RECORD)
    if consistent <= GOOD:
        return Verdict(name, Grade.GOOD, f'the identified model predicts the effort: {size}', USE)
    if consistent > POOR:
        return Verdict(name, Grade.BAD, f'the model explains less than half of the effort: {size}',
                       UNIT)
    is_friction = simple <= BETTER * consistent
    return Verdict(name, Grade.CHECK, (
        f'identified masses do not improve the model: {size}' if is_friction
        else f'the model predicts most of the effort: {size}'),
        REVERSALS if is_friction else RECORD)


_CHANGE = 1e-3
"""Relative change of a mass [1] or of a centre of mass [mm] that is displayed as none."""


def identification_page(found: BagIdentification, origin: Origin) -> str:
    """Return the report; raise MissingDependencyError without matplotlib."""
    identification = found.identification
    arm = identification.arm
    page = Page(f'{arm.name}: identified model', joint_verdicts(identification), RULE, origin)
    _add_lists(page, found)
    page.section('Links: mass and centre of mass before and after')
    page.table(link_rows(identification))
    page.text(
        'Before: URDF. After: identified, as in identified.urdf. Each row is a link with all '
        'links that are fixed to it, in the frame of the link. Efforts determine only the '
        'combinations of these values that are listed below as base parameters; the other '
        'combinations stay near the URDF.')
    page.section(summary.residual_title(identification))
    page.table(summary.residual_rows(identification))
    page.text(
        'RMS of the residual (measured − model), relative to the RMS of the measured effort. '
        'The last column is the consistent set without presliding hysteresis, like an answer of '
        'the node to a single state.')
    page.section('Residual by the noise of the effort')
    page.table(summary.noise_rows(found))
    page.section(summary.FRICTION_TITLE)
    page.table(summary.friction_rows(identification))
    page.text('docs/friction.md has the equations.')
    if identification.gains is not None:
        page.section(summary.GAIN_TITLE)
        page.table(summary.gain_rows(identification, identification.gains))
    page.section('Effort over time' + (
        f': the first of {len(found.bags)} recordings' if len(found.bags) > 1 else ''))
    shown = identification.recordings[0]
    motion, measured = shown.motion, shown.motion.measured_effort
    add_time_figures(
        page, arm, f'{found.bags[0].name}: {summary.MODELS["consistent"]} model',
        comparison_panels(motion.times, measured, shown.model), 'Measured and model effort',
        None if np.isnan(shown.test_from) else TimeBoundary(shown.test_from, 'training', 'test'))
    page.section('Residual over velocity')
    add_figure(page, scatter_figure(
        f'{found.bags[0].name}: residual over velocity', arm, motion.velocity,
        measured - shown.model), 'Residual over velocity')
    page.section('Base parameters')
    page.table(parameter_rows(identification), kind='long')
    page.text('By least squares without regularisation; * marks regrouped parameters. Masses in '
              'kg, first moments in kg·m, inertias in kg·m², others as in the table of friction.')
    return page.html()


def _add_lists(page: Page, found: BagIdentification) -> None:
    """Add facts, warnings, and remarks on the recordings."""
    page.section('Identification')
    page.table(summary.fact_rows(found), has_head=False, kind='text')
    for title, lines, kind in (
            ('Contradictions, with their likely causes',
             summary.recording_lines(found, 'contradictions'), 'loss'),
            ('Warnings', summary.warnings(found.identification), 'loss'),
            ('Recordings that could not be used',
             [f'{bag}: {error}' for bag, error in found.failed], 'loss'),
            ('Recordings', summary.recording_lines(found, 'remarks'), '')):
        if lines:
            page.section(title)
            page.items(lines, kind)


def link_rows(identification: Identification) -> Rows:
    """Return mass [kg] and centre of mass [mm] of each link, of the URDF and as identified."""
    arm = identification.arm
    before = inertial_parameters(arm.with_payloads(())).reshape(-1, COUNT)
    after = identification.models.consistent.parameters.reshape(-1, COUNT)
    rows: Rows = [(
        'link', 'mass before [kg]', 'after [kg]', 'change',
        'centre of mass before: x, y, z [mm]', 'after [mm]', 'distance [mm]')]
    for name, old, new in zip(body_names(arm), before, after):
        change = new[0] / old[0] - 1.0 if old[0] > 0.0 else np.nan
        moved = np.linalg.norm(_centre(new) - _centre(old))
        rows.append((
            name, f'{old[0]:.3f}', f'{new[0]:.3f}',
            '-' if np.isnan(change) else 'none' if abs(change) < _CHANGE else f'{change:+.1%}',
            _point(_centre(old)), _point(_centre(new)),
            '-' if np.isnan(moved) else 'none' if moved < _CHANGE else f'{moved:.1f}'))
    return rows


def _centre(parameters: FloatArray) -> FloatArray:
    """Return the centre of mass (3,) [mm]; NaN without mass."""
    mass = float(parameters[0])
    return np.asarray(1e3 * parameters[1:4] / mass if mass > 0.0 else np.full(3, np.nan))


def _point(point: FloatArray) -> str:
    return '-' if np.isnan(point).any() else ', '.join(f'{x + 0.0:.1f}' for x in point.round(1))


def parameter_rows(identification: Identification) -> Rows:
    """Return the base parameters and the joints' own parameters, with their deviations."""
    estimate, base = identification.estimate, identification.base
    own = len(estimate.names) - estimate.base_count
    return column_rows(
        'parameter', estimate.names,
        ('value', cells(estimate.values, '.4g')), ('deviation', cells(estimate.deviations, '.2g')),
        ('relative', cells(100.0 * estimate.relative_deviations, '.1f', repeat('%'))),
        ('URDF', [*cells(estimate.prior[:estimate.base_count], '.4g'), *own * ['-']]),
        ('definition', [*base.expressions, *own * ['of this joint']]))
