# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A term of friction that is added in one module acts everywhere; every term is complete."""

import json
import os
from pathlib import Path
import sys
from typing import Any

import added_term
from added_term import COULOMB, extended_package, PEAK, SPEEDS, VELOCITY
import children
import numpy as np
import pytest
from robot_dynamics.joints.friction_terms import TERMS
from robot_dynamics_tools.identification.friction_regressor import columns_of


@pytest.fixture(scope='module')
def findings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return what a program finds with the package that has a second Stribeck peak."""
    folder = tmp_path_factory.mktemp('extended')
    extended_package(folder)
    path = os.pathsep.join([
        str(folder), str(Path(children.__file__).parent), os.environ.get('PYTHONPATH', '')])
    result = children.run(
        [sys.executable, added_term.__file__], env={**os.environ, 'PYTHONPATH': path},
        cwd=folder, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def peak(v: float | np.ndarray) -> np.ndarray:
    """Return the new term by its formula."""
    return np.asarray(PEAK * np.exp(-(np.asarray(v) / VELOCITY)**2) * np.sign(v))


def test_it_acts_in_the_model(findings):
    expected = COULOMB * np.sign(SPEEDS) + peak(np.array(SPEEDS))
    assert findings['effort'] == pytest.approx(expected, rel=1e-12)
    assert findings['forward'] == pytest.approx([0.3, 0.4], rel=1e-9)
    # without an error of position, the compensation has tanh(v / 0.01) instead of the sign
    smooth = expected * np.abs(np.tanh(np.array(SPEEDS) / 0.01))
    assert findings['tracking'] == pytest.approx(smooth, rel=1e-12)
    assert findings['at_rest'] == [COULOMB + PEAK] * 2


def test_it_acts_in_the_simulation(findings):
    assert findings['sticks_at'] == [0.0, 0.0]
    assert findings['slips_to'][0] > 0.0
    assert abs(findings['energy_error']) < 1e-6 * findings['energy']


def test_it_has_columns_and_is_identified(findings):
    assert findings['column'] == pytest.approx(peak(np.array(SPEEDS)) / PEAK, rel=1e-12)
    assert findings['written']['friction.peak'] == pytest.approx([PEAK] * 2, rel=0.1)
    assert findings['written']['friction.peak_velocity'] == [VELOCITY] * 2
    assert 'peak' in findings['reported']


def test_uncertainty_export_and_nodes_have_its_name(findings):
    assert {'peak(joint1)', 'peak(joint2)'} <= set(findings['uncertain'])
    assert 'coulomb(joint1)' not in findings['uncertain']
    assert findings['deviation'] == pytest.approx([0.0, np.exp(-0.25)], rel=1e-12)
    assert 'Without counterpart in MuJoCo: the second Stribeck peak F_2.' in findings['export']
    assert 'frictionloss="1.0"' in findings['export']
    declared = findings['declared']
    assert declared['friction.peak'].startswith('Second Stribeck peak F_2 [N·m] or [N]; one value')
    assert declared['friction.peak_velocity'].endswith('If empty, 0.3.')


# --- what every term has -------------------------------------------------------------------------

@pytest.mark.parametrize('term', TERMS, ids=lambda term: term.fields[0].name)
def test_a_term_has_a_column_and_a_counterpart_or_its_absence(term):
    names = [column.name for column in columns_of(term)]
    assert names
    assert all(names)
    for field in term.fields:
        assert field.needs or field.counterpart or field.omitted, field.name
