# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The verdict of `identify` on a joint, from the residuals of three models."""

from arm_motions import fourier_motion
from identification_bench import rigid_effort, series_of
import numpy as np
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model_check.html_page import Grade
from robot_dynamics_tools.analysis.motion_filter import filter_motion
from robot_dynamics_tools.identification.page import in_other_poses, joint_verdict, joint_verdicts
from robot_dynamics_tools.identification.pipeline import identify
from robots import robot_urdf


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


def test_a_good_joint_is_uncertain_if_its_effort_in_other_poses_is():
    good, bad = (joint_verdict('joint', 1.0, 0.95, one) for one in (0.05, 0.9))
    assert in_other_poses(good, 0.1) is good
    assert in_other_poses(bad, 9.9) is bad
    found = in_other_poses(good, 0.2)
    assert found.grade is Grade.CHECK
    assert found.text == (
        f'{good.text}; in other poses its effort at rest is known within ± 40.0 % of this effort')
    assert 'more poses' in found.next_step


@pytest.mark.parametrize(('size', 'names'), [(1.0, []), (0.08, ['shoulder_lift_joint'])])
def test_a_small_motion_leaves_other_poses_uncertain(size, names):
    """A recording of one pose says little about the others, however small its residuals are."""
    arm = load_arm(robot_urdf('ur10'))
    states = fourier_motion(arm, 125.0, 30.0, 0)
    centre = states.q.mean(axis=0)
    states = states._replace(
        q=centre + size * (states.q - centre), v=size * states.v, a=size * states.a)
    rng = np.random.default_rng(0)
    effort = rigid_effort(arm, states) + 0.004 * arm.limits.effort * rng.normal(
        size=states.q.shape)
    verdicts = joint_verdicts(identify(arm, [filter_motion(series_of(arm, states, effort))]))
    uncertain = [one.name for one in verdicts if 'in other poses' in one.text]
    assert set(names) <= set(uncertain)
    assert not names or all(one.grade is Grade.CHECK for one in verdicts if one.name in uncertain)
    assert bool(names) == bool(uncertain)
