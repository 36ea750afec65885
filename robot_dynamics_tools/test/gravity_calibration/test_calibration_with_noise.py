# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Accuracy and coverage of a calibration with dry friction that does not cancel, and noise."""

from calibration_bench import load_on, noisy_drives, poses_of
import numpy as np
import pytest
from robot_dynamics.model_check.html_page import Grade
from robot_dynamics_tools.gravity_calibration.calibration import calibrate_holds, Calibration
from robot_dynamics_tools.gravity_calibration.report import joint_verdicts
from robot_dynamics_tools.gravity_calibration.scale_fit import Tool
from robots import arm_without_gripper

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
