# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The effort of the model at a motion, by term, and the statistics of the residual.

The verdict of `analyze` on a joint names the cause that made the residual.
"""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model_check.html_page import Grade
from robot_dynamics_tools.analysis.bag_analysis import merged_statistics, residual_statistics
from robot_dynamics_tools.analysis.report import joint_verdict
from robot_dynamics_tools.estimation.model_terms import model_terms
from robots import robot_urdf

# A warning of numpy indicates a number that the code did not check.
pytestmark = pytest.mark.filterwarnings('error::RuntimeWarning')

FIELDS = ('rms_measured', 'mean_measured', 'rms', 'mean', 'largest', 'relative', 'r_squared')


@pytest.mark.parametrize('robot', ['panda', 'tiago_no_hand'])
def test_terms_of_many_states_are_those_of_each(robot):
    """Includes mimic, continuous and prismatic joints; single states use another code path."""
    arm = load_arm(robot_urdf(robot))
    n = arm.joint_count
    dynamics = ArmDynamics(arm)
    q, v, a = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 30, n))
    terms = model_terms(dynamics, q, v, a)
    for i in range(len(q)):
        one = dynamics.unchecked.terms(q[i], v[i], a[i], friction=arm.friction.smooth_effort(v[i]))
        for name, values in terms.by_name.items():
            np.testing.assert_allclose(values[i], getattr(one, name), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(terms.effort[i], one.effort, rtol=1e-9, atol=1e-9)
        assert terms.kinetic_energy[i] == pytest.approx(one.kinetic_energy, rel=1e-9, abs=1e-9)
        assert terms.potential_energy[i] == pytest.approx(one.potential_energy, rel=1e-9)


def test_statistics_of_a_known_residual():
    t = np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False)
    measured = np.column_stack([3.0 + np.sqrt(2.0) * np.sin(t), np.full(1000, 2.0), 0.0 * t])
    model = measured - np.column_stack([0.5 * np.sqrt(2.0) * np.cos(t), np.ones(1000), -t])
    found = residual_statistics(measured, model, ('a', 'b', 'c'))
    np.testing.assert_allclose(found.rms_measured, [np.sqrt(10.0), 2.0, 0.0])
    np.testing.assert_allclose(found.rms[:2], [0.5, 1.0])
    np.testing.assert_allclose(found.mean[:2], [0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(found.largest, [0.5 * np.sqrt(2.0), 1.0, t[-1]])
    np.testing.assert_allclose(found.relative, [0.5 / np.sqrt(10.0), 0.5, np.nan])
    np.testing.assert_allclose(found.r_squared, [0.75, np.nan, np.nan])
    assert found.sample_count == 1000


@settings(deadline=None, derandomize=True, max_examples=50)
@given(st.lists(st.integers(1, 40), min_size=1, max_size=5), st.integers(0, 2**32 - 1))
def test_parts_merge_to_the_whole(sizes, seed):
    rng = np.random.default_rng(seed)
    measured = [rng.normal(rng.uniform(-5, 5), 2.0, (m, 2)) for m in sizes]
    model = [values + rng.normal(0.3, 0.5, values.shape) for values in measured]
    parts = [residual_statistics(*pair, ('a', 'b')) for pair in zip(measured, model)]
    merged = merged_statistics(parts)
    whole = residual_statistics(np.concatenate(measured), np.concatenate(model), ('a', 'b'))
    assert merged.sample_count == whole.sample_count
    if whole.sample_count > 1:
        for field in FIELDS:
            np.testing.assert_allclose(
                getattr(merged, field), getattr(whole, field), rtol=1e-9, atol=1e-9)


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
