# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The verdict on the identified model at each joint, from its residual on the test samples.

The residual of the physically consistent set, which is written to the files, is compared with that
of the URDF and of the URDF with friction.
"""

import numpy as np
from robot_dynamics.identification.pipeline import Identification
from robot_dynamics.reporting.html_page import Grade, Verdict
from robot_dynamics.reporting.text_table import percent

GOOD, POOR = 0.1, 0.5
"""Relative residuals up to which a model is good, and above which it is bad."""
BETTER = 1.05
"""Ratio of residuals above which another model is better."""
DOMINANT = 0.5
"""Fraction of the mean square of the residual of the URDF that friction alone removes."""
RULE = (
    f'Rule: residual of the consistent set on the test samples, RMS relative to the RMS of the '
    f'effort: good up to {100.0 * GOOD:g} %, check up to {100.0 * POOR:g} %, bad above. It is not '
    f'good if the residual of the URDF, with or without friction, is lower by more than '
    f'{100.0 * (BETTER - 1.0):.0f} %. Friction dominates if it alone removes more than half of '
    'the mean square of the residual of the URDF.')
USE = 'use `identified.yaml`'
RECORD = 'record a longer motion, or a trajectory generated with `excite`'
UNIT = ('check the unit of the effort (`--effort current`), the joint names (`--map`) and the '
        'payload (`--payload`)')
TEST = 'run `identify` with a smaller `--train-fraction`, or test with `analyze_bag`'
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
    return [
        joint_verdict(name, float(urdf[j]), float(simple[j]), float(consistent[j]))
        for j, name in enumerate(identification.arm.joint_names)]


def joint_verdict(name: str, urdf: float, simple: float, consistent: float) -> Verdict:
    """
    Return the verdict on one joint from relative residuals on the test samples.

    They are those of the URDF, of the URDF with friction (`simple`), and of the consistent set.
    """
    if np.isnan(consistent):
        return Verdict(name, Grade.UNKNOWN, 'the measured effort is zero',
                       'check that the driver publishes the effort of this joint')
    size = f'residual {percent(consistent)} of the effort (URDF: {percent(urdf)})'
    if simple**2 < (1.0 - DOMINANT) * urdf**2:
        size += f'; friction dominates (URDF with friction: {percent(simple)})'
    if consistent > BETTER * min(urdf, simple):
        which = 'the URDF with friction' if simple <= urdf else 'the URDF'
        return Verdict(name, Grade.CHECK if consistent <= POOR else Grade.BAD,
                       f'{which} predicts the effort better than the identified model: {size}',
                       RECORD)
    if consistent <= GOOD:
        return Verdict(
            name, Grade.GOOD, f'the identified model predicts the effort: {size}', USE)
    if consistent > POOR:
        return Verdict(name, Grade.BAD, f'the model explains less than half of the effort: {size}',
                       UNIT)
    is_friction = simple <= BETTER * consistent
    return Verdict(name, Grade.CHECK, (
        f'identified masses do not improve the model: {size}' if is_friction
        else f'the model predicts most of the effort: {size}'),
        REVERSALS if is_friction else RECORD)
