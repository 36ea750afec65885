# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The verdict on the model at each joint of a recording: the main cause of the residual.

The residual r = measured − model is compared with three simple causes: a constant offset, friction
(a viscous and a Coulomb coefficient), and a factor between measured and modelled effort. A cause
dominates if its least-squares fit explains at least half of the mean square of r; of several, the
one that explains most is named.
"""

import numpy as np
from robot_dynamics.analysis.bag_analysis import BagAnalysis
from robot_dynamics.arrays import FloatArray
from robot_dynamics.reporting.html_page import Grade, Verdict
from robot_dynamics.reporting.text_table import percent

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
          '`identify` fits the offset as `friction.effort_offset`')
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
        return Verdict(name, Grade.UNKNOWN, 'the measured effort is zero',
                       'check that the driver publishes the effort of this joint')
    size = f'residual {percent(relative)} of the effort'
    if relative <= GOOD:
        return Verdict(
            name, Grade.GOOD, f'the model predicts the effort: {size}', 'use the model')
    grade = Grade.CHECK if relative <= POOR else Grade.BAD
    text, step = _cause(residual, velocity, model)
    return Verdict(name, grade, f'{text}; {size}', step)


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
