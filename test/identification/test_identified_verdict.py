# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The verdict of `identify` on a joint, from the residuals of three models."""

import pytest
from robot_dynamics.identification.page import joint_verdict
from robot_dynamics.reporting.html_page import Grade


@pytest.mark.parametrize(('residuals', 'grade', 'words', 'step'), [
    ((0.99, 0.08, 0.05), Grade.GOOD, 'friction dominates', 'identified.yaml'),
    ((0.30, 0.25, 0.05), Grade.GOOD, 'predicts the effort: residual 5.0 %', 'identified.yaml'),
    ((1.00, 0.247, 0.246), Grade.CHECK, 'identified masses do not improve', 'standstills'),
    ((1.00, 0.80, 0.30), Grade.CHECK, 'predicts most of the effort', 'longer motion'),
    ((0.50, 0.04, 0.08), Grade.CHECK, 'the URDF with friction predicts the effort better',
     'longer motion'),
    ((0.47, 0.90, 4.25), Grade.BAD, 'the URDF predicts the effort better', 'longer motion'),
    ((1.00, 0.95, 0.90), Grade.BAD, 'explains less than half', '--effort current'),
    ((float('nan'),) * 3, Grade.UNKNOWN, 'measured effort is zero', 'driver'),
])
def test_the_verdict(residuals, grade, words, step):
    found = joint_verdict('joint', *residuals)
    assert found.grade is grade
    assert words in found.text
    assert step in found.next_step


def test_friction_dominates_only_if_it_removes_half_of_the_mean_square():
    assert 'friction' in joint_verdict('joint', 0.4, 0.28, 0.05).text
    assert 'friction' not in joint_verdict('joint', 0.4, 0.29, 0.05).text
