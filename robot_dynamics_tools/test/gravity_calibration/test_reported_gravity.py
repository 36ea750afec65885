# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What the efforts of an arm at rest say about drives and mount."""

from typing import Any

import numpy as np
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.urdf.values import rotation
from robot_dynamics_tools.gravity_calibration.holds import Hold
from robot_dynamics_tools.gravity_calibration.recorded_holds import tilt
from robot_dynamics_tools.gravity_calibration.reported_gravity import explanations

ARM = load_arm('ur10')
LIFT, ELBOW = 'shoulder_lift_joint', 'elbow_joint'


def said(rpy: Any = (0.0, 0.0, 0.0), friction: float = 0.01, **ratios: float) -> list[str]:
    """Return what explains the efforts of an arm with these ratios, whose base is turned."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-2.0, 2.0, (6, 6))
    true = ARM.with_gravity(rotation(np.array(rpy)).T @ ARM.gravity)
    ratio = np.array([ratios.get(name, 1.0) for name in ARM.joint_names])
    side = rng.choice([-1.0, 1.0], q.shape)
    effort = ratio * (RigidBody(true).gravity_batch(q) + friction * ARM.limits.effort * side)
    return list(dict.fromkeys(
        one.words(ARM.joint_names) for one in explanations(ARM, q, effort)))


@pytest.mark.parametrize('friction', [0.0, 0.01, 0.03])
def test_a_right_arm_is_not_accused(friction):
    assert said(friction=friction)[0] == 'effort is g(q)'


@pytest.mark.parametrize(('rpy', 'degrees'), [
    ((0.0, np.pi / 2, 0.0), 90.0), ((np.pi / 2, 0.0, 0.0), 90.0), ((-2.2, 0.0, 0.0), 126.0),
    ((0.0, 0.25, 0.0), 14.0)])
def test_a_tilted_base_is_measured(rpy, degrees):
    words, = said(rpy)
    assert words.startswith('the base is tilted by ')
    assert abs(float(words.split('by ')[1].split('°')[0]) - degrees) <= 4.0


def test_wrong_scales_at_two_joints_of_a_tilted_arm_are_found():
    words, = said((0.0, 1.2, 0.0), **{LIFT: -0.7, ELBOW: 2.0})
    ratios, tilt = words.split(' and ')
    assert tilt.startswith('the base is tilted by 6')
    found = dict(text.rsplit(' ', 1) for text in ratios.removeprefix(
        'effort / g(q) is ').split(', '))
    np.testing.assert_allclose([float(found[LIFT]), float(found[ELBOW])], [-0.7, 2.0], rtol=0.12)
    assert set(found) == {LIFT, ELBOW}


def test_upside_down_and_all_reports_reversed_are_named_together():
    words = ' or '.join(said(friction=0.0, **dict.fromkeys(ARM.joint_names, -1.0)))
    assert 'tilted by 180°' in words
    assert f'{LIFT} -1.00, {ELBOW} -1.00' in words


@pytest.mark.parametrize(('gravity', 'said'), [
    ((0.0, 9.81, 0.0), 'the base is tilted by 90°'), ((0.0, 0.0, -9.81), '')])
def test_calibrate_gravity_says_how_the_base_is_mounted(gravity, said):
    q = np.random.default_rng(1).uniform(-2.0, 2.0, (8, 6))
    efforts = RigidBody(ARM.with_gravity(gravity)).gravity_batch(q)
    words = tilt(ARM, [Hold(0.0, 1.0, *each, np.ones(6, int)) for each in zip(q, efforts)])
    assert said in words
    assert bool(said) == bool(words)
