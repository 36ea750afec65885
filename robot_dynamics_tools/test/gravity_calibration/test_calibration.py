# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The calibration of gravity: its laws without noise, its accuracy and coverage with noise."""

from dataclasses import replace

from arm_motions import with_inertial_parameters
from calibration_bench import exact_drives, load_on, noisy_drives, poses_of, TOOL_LINKS
from identification_bench import changed_arm
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.payload import make_payload
from robot_dynamics.model.regressor import inertial_parameters
from robot_dynamics.model_check.html_page import Grade
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.estimation.effort_fit import estimated_weights
from robot_dynamics_tools.gravity_calibration.calibration import (
    calibrate_holds,
    Calibration,
    ScaleReference,
)
from robot_dynamics_tools.gravity_calibration.report import joint_verdicts
from robot_dynamics_tools.gravity_calibration.scale_fit import Tool
from robots import arm_without_gripper

EXACT = 1e-9


@pytest.fixture(params=[
    name if name in ('default', 'xarm7') else pytest.param(name, marks=pytest.mark.soak)
    for name in TOOL_LINKS])
def name(request: pytest.FixtureRequest) -> str:
    return request.param


def assert_exact(found, drives) -> None:
    """Compare scale and offset where the scale is observable: not at a vertical first axis."""
    seen = found.is_observable
    assert seen.sum() >= len(seen) - 1
    np.testing.assert_allclose(found.scale[seen], drives.scale[seen], rtol=0.0, atol=EXACT)
    np.testing.assert_allclose(found.offset[seen], drives.offset[seen], rtol=0.0, atol=EXACT)
    assert (found.scale[~seen] == 1.0).all()


def assert_same_tool(found, tool) -> None:
    """Compare what is observable: a planar arm does not determine a moment along its axes."""
    truth = np.array([tool.mass, *(tool.mass * tool.com)])
    seen = np.isfinite(found.tool.deviations)
    assert seen.sum() >= 3
    np.testing.assert_allclose(found.tool.values[seen], truth[seen], rtol=0.0, atol=EXACT)


@pytest.mark.parametrize('given', [None, 1.5])
def test_a_known_weight_gives_exact_scales_offsets_and_tool(name, given):
    arm = arm_without_gripper(name)
    drives, q = exact_drives(arm), poses_of(arm)
    tool, weight = load_on(name, 1.5), load_on(name, 2.0, (0.1, 0.0, 0.05))
    found = calibrate_holds(
        arm, drives.holds(q, arm.with_payloads([tool])),
        drives.holds(q, arm.with_payloads([tool, weight])), weight, Tool(tool.link, given))
    assert found.reference is ScaleReference.WEIGHT
    assert_exact(found, drives)
    assert_same_tool(found, tool)
    assert (found.tool.deviations[0] == 0.0) == (given is not None)


def test_a_known_tool_gives_exact_scales_offsets_and_moments(name):
    arm = arm_without_gripper(name)
    drives, tool = exact_drives(arm), load_on(name, 1.5)
    found = calibrate_holds(
        arm, drives.holds(poses_of(arm), arm.with_payloads([tool])), tool=Tool(tool.link, 1.5))
    assert found.reference is ScaleReference.TOOL
    assert_exact(found, drives)
    assert_same_tool(found, tool)
    assert found.tool.deviations[0] == 0.0


def test_without_a_reference_scale_and_mass_are_confounded():
    """All masses that are 1.1 times those of the URDF divide the scales by 1.1, exactly."""
    arm = arm_without_gripper('xarm7')
    drives = exact_drives(arm)
    heavier = with_inertial_parameters(arm, 1.1 * inertial_parameters(arm))
    found = calibrate_holds(arm, drives.holds(poses_of(arm), heavier))
    assert found.reference is ScaleReference.URDF
    assert_exact(found, replace(drives, scale=drives.scale / 1.1))


def test_a_known_weight_makes_scales_independent_of_masses_of_the_urdf():
    """The poses with the weight are others than those without it."""
    arm = arm_without_gripper('xarm7')
    drives, q, weight = exact_drives(arm), poses_of(arm, 20), load_on('xarm7', 2.0)
    found = calibrate_holds(
        changed_arm(arm, 0.3), drives.holds(q[:10]),
        drives.holds(q[10:], arm.with_payloads([weight])), weight)
    assert_exact(found, drives)


def test_a_tilted_base_makes_the_first_scale_observable():
    arm = arm_without_gripper('ur10').with_gravity((3.0, 0.0, -9.0))
    drives, tool = exact_drives(arm), load_on('ur10', 1.5)
    found = calibrate_holds(
        arm, drives.holds(poses_of(arm), arm.with_payloads([tool])), tool=Tool(tool.link, 1.5))
    assert found.is_observable.all()
    assert_exact(found, drives)


def test_a_joint_that_came_from_one_side_only_is_left_as_it_is():
    """The first joint of an upright arm has an offset and no scale."""
    arm = arm_without_gripper('xarm7')
    drives = exact_drives(arm)
    holds = [hold._replace(approach=np.where(np.arange(7) == 3, 1, hold.approach))
             for hold in drives.holds(poses_of(arm))]
    found = calibrate_holds(arm, holds)
    assert found.pose_count.tolist() == [12, 12, 12, 0, 12, 12, 12]
    assert (found.scale[3], found.offset[3]) == (1.0, 0.0)
    assert np.isinf([found.scale_interval[3], found.offset_interval[3]]).all()
    others = np.array([1, 2, 4, 5, 6])
    np.testing.assert_allclose(found.scale[others], drives.scale[others], atol=EXACT)
    assert found.is_observable.tolist() == [False, True, True, False, True, True, True]
    assert (found.scale[0], found.scale_interval[0]) == (1.0, np.inf)
    assert abs(found.offset[0] - drives.offset[0]) < EXACT


@pytest.mark.parametrize(('change', 'message'), [
    ({'count': 3}, r'6 holds without weight have 3 poses that a joint approached from both '
                   r'sides, expected at least 4'),
    ({'gravity': (0.0, 9.81, 0.0)}, r'no effort scale is observable: the gravity torque in the '
                                    r'poses varies by \[0\.0, 0\.0\] N·m'),
    ({'tool': Tool('tool0')}, 'the mass of the tool is not given'),
    ({'tool': Tool('hand', 1.0)}, "link is 'hand', expected one of the links"),
    ({'weight': make_payload('tool0', 1.0)}, 'there are 0 holds with a weight'),
    ({'weight': make_payload('base_link', 1.0), 'is_held': True},
     "'base_link', which is fixed to the base"),
])
def test_what_cannot_be_calibrated_is_refused(change, message):
    arm = load_arm(default_arm_urdf(), gravity=change.get('gravity', (0.0, 0.0, -9.81)))
    q = poses_of(load_arm(default_arm_urdf()))[:change.get('count', 12)]
    holds = exact_drives(arm).holds(q)
    with pytest.raises(InvalidInputError, match=message):
        calibrate_holds(arm, holds, holds if 'is_held' in change else (), change.get('weight'),
                        change.get('tool'))


def test_few_residuals_widen_an_interval_as_student_and_meier_state():
    share, freedom = np.array([[1.0, 0.5], [0.0, 0.5]]), np.array([4.0, 4.0])
    factor, quantile = estimated_weights(share, freedom)
    assert factor == pytest.approx([1.0, np.sqrt(1.5)])  # 1 + 4 (1/16 + 1/16)
    assert quantile == pytest.approx([2.776, 2.306], abs=1e-3)  # of 4 and of 8 degrees of freedom


WEIGHTS = {'default': 2.0, 'ur10': 5.0, 'panda': 2.0, 'xarm7': 2.0}
"""Known weights [kg], about half of the payload of the arms."""


class Case:
    """A seeded case: hidden drives and tool, and the calibration with or without a weight."""

    def __init__(self, name: str, arm, q, seed: int, with_weight: bool) -> None:
        rng = np.random.default_rng(1_000_000 + seed)
        self.drives = noisy_drives(arm, seed)
        tool = load_on(name, rng.uniform(0.5, 3.0), rng.normal([0.0, 0.0, 0.1], 0.05))
        weight = load_on(name, WEIGHTS[name], (0.1, 0.0, 0.05))
        holds = self.drives.holds(q, arm.with_payloads([tool]), rng)
        self.tool = np.array([tool.mass, *(tool.mass * tool.com)])
        self.found: Calibration = calibrate_holds(
            arm, holds, self.drives.holds(q, arm.with_payloads([tool, weight]), rng), weight,
            Tool(tool.link)) if with_weight else (
                calibrate_holds(arm, holds, tool=Tool(tool.link, tool.mass)))

    def inside(self) -> list[bool]:
        """Return whether the truth is within each 95 % interval: scale, offset, tool."""
        found, seen = self.found, self.found.is_observable
        of_tool = np.isfinite(found.tool.intervals) & (found.tool.intervals > 0.0)
        return [
            *(abs(found.scale - self.drives.scale) < found.scale_interval)[seen],
            *(abs(found.offset - self.drives.offset) < found.offset_interval)[seen],
            *(abs(found.tool.values - self.tool) < found.tool.intervals)[of_tool]]


@pytest.mark.parametrize(('name', 'with_weight'), [
    ('default', True), ('panda', True), ('ur10', False), ('xarm7', False)])
def test_scales_are_within_1_percent_and_offsets_within_2_percent_of_the_limit(name, with_weight):
    """With a weight at all joints; with a known tool at those with the verdict good."""
    arm = arm_without_gripper(name)
    q = poses_of(arm)
    for seed in range(3):
        case = Case(name, arm, q, seed, with_weight)
        good = np.array([verdict.grade is Grade.GOOD for verdict in joint_verdicts(case.found)])
        # gravity loads no first joint of an upright arm; wrists bear little without a weight
        assert good.sum() >= (1 if name == 'default' else arm.joint_count - 1 if with_weight
                              else 3)
        assert (abs(case.found.scale / case.drives.scale - 1.0) < 0.01)[good].all()
        assert (abs(case.found.offset - case.drives.offset) < 0.02 * case.drives.limit).all()


def share_inside(name: str, seeds: range, with_weight: bool) -> float:
    arm = arm_without_gripper(name)
    q = poses_of(arm)
    return float(np.mean([
        inside for seed in seeds for inside in Case(name, arm, q, seed, with_weight).inside()]))


def test_intervals_contain_the_truth():
    assert 0.90 < share_inside('default', range(100, 130), True) < 0.99


def test_poses_without_spread_keep_the_scale():
    arm = arm_without_gripper('default')
    drives = noisy_drives(arm, 0)
    q = np.array([0.3, 0.4]) + 0.06 * np.arange(8)[:, None] * np.array([1.0, -1.0])
    found = calibrate_holds(arm, drives.holds(q))
    assert found.is_observable.tolist() == [True, False]
    assert found.scale[1] == 1.0
    verdict = joint_verdicts(found)[1]
    assert verdict.grade is Grade.UNKNOWN
    assert 'scale 1 is kept' in verdict.text
    assert verdict.next_step == 'add poses in which the gravity torque of this joint differs more'
