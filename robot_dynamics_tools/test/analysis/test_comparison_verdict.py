# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The verdict of `analyze` on a joint names the cause that made the residual."""

import numpy as np
import pytest
from robot_dynamics.model_check.html_page import Grade
from robot_dynamics_tools.analysis.report import joint_verdict

TIMES = np.linspace(0.0, 20.0, 4001)
VELOCITY = 0.8 * np.cos(1.3 * TIMES) + 0.3 * np.cos(3.1 * TIMES)
MODEL = 10.0 * np.sin(0.9 * TIMES) + 2.0


def verdict(residual, model=MODEL):
    measured = model + residual
    relative = np.sqrt(np.mean(residual**2) / np.mean(measured**2))
    return joint_verdict('joint', float(relative), residual, VELOCITY, model)


@pytest.mark.parametrize(('residual', 'words', 'step'), [
    (3.0 * np.sign(VELOCITY) + 2.0 * VELOCITY, 'friction dominates: it explains', '`identify`'),
    (np.full_like(TIMES, 4.0), 'a constant offset dominates: it explains 100 %', 'zero of the'),
    (0.9 * MODEL, 'measured effort is 1.9 times the model', 'payload'),
    (1.1 * MODEL, 'measured effort is 2.1 times the model', 'unit of the effort'),
    (-0.9 * MODEL, 'measured effort is 0.1 times the model', 'unit of the effort'),
    (5.0 * np.sin(7.0 * TIMES), 'no single cause dominates', '`excite`'),
    (np.sin(7.0 * TIMES) + 0.65, 'no single cause dominates', '`excite`'),  # 46 % of it
    (np.sin(7.0 * TIMES) + 0.75, 'a constant offset dominates: it explains 53 %', 'zero of the'),
])
def test_the_cause_of_a_residual(residual, words, step):
    found = verdict(residual)
    assert found.text.startswith(words)
    assert step in found.next_step
    assert found.grade in (Grade.CHECK, Grade.BAD)


@pytest.mark.parametrize(('relative', 'grade'), [
    (0.099, Grade.GOOD), (0.101, Grade.CHECK), (0.499, Grade.CHECK), (0.501, Grade.BAD),
    (float('nan'), Grade.UNKNOWN)])
def test_the_grade_follows_the_relative_residual(relative, grade):
    assert joint_verdict('joint', relative, 0.3 * MODEL, VELOCITY, MODEL).grade is grade


def test_a_joint_at_rest_has_no_friction():
    found = joint_verdict('joint', 0.5, np.full(9, 2.0), np.zeros(9), np.linspace(-1.0, 1.0, 9))
    assert found.text.startswith('a constant offset dominates')
