# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Descriptions of real robots for the tests: those of `example-robot-data`.

Without that package, the tests that need it are skipped with the reason. If the environment
variable CI is set, on x86-64 Linux, they fail instead.
"""

import os
from pathlib import Path
import platform
import sys
from typing import NoReturn

import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.urdf.sample_robots import PACKAGE, robot_directories, SAMPLE_ROBOTS

_FILES = {
    **SAMPLE_ROBOTS,
    'baxter': 'baxter_description/urdf/baxter.urdf',
    'pr2': 'pr2_description/urdf/pr2.urdf',
    'so100': 'so_arm_description/urdf/so100.urdf',
    'talos_full_v2': 'talos_data/robots/talos_full_v2.urdf',
    'tiago': 'tiago_description/robots/tiago.urdf',
    'tiago_no_hand': 'tiago_description/robots/tiago_no_hand.urdf',
    'tiago_pro': 'tiago_pro_description/robots/tiago_pro.urdf',
}

JOINTS = {
    'panda': [f'panda_joint{i + 1}' for i in range(7)], 'z1': [f'joint{i + 1}' for i in range(6)]}
"""Joints of an arm without its gripper."""


def must_have_everything() -> bool:
    """Return whether a missing optional package is a failure here, not a reason to skip."""
    return bool(os.environ.get('CI')) and (
        sys.platform == 'linux' and platform.machine() == 'x86_64')


def missing(reason: str) -> NoReturn:
    """Skip the test for this reason, or fail it if all optional packages are required."""
    if must_have_everything():
        pytest.fail(f'{reason}; with CI set this is a failure')
    pytest.skip(reason, allow_module_level=True)


def robot_path(name: str) -> Path:
    """Return the path of the URDF of a robot; skip the test if it is not installed."""
    for directory in robot_directories():
        path = directory / _FILES[name]
        if path.is_file():
            return path
    missing(f'{PACKAGE} is not installed: no description of {name}')


def arm_without_gripper(name: str) -> ArmModel:
    """Return `default` or another robot, without the joints of a gripper."""
    return load_arm(robot_urdf(name), JOINTS.get(name, ()))


def effort_limit(arm: ArmModel) -> FloatArray:
    """Return the effort limits (n,) [N·m]; 50 N·m without a limit."""
    limit = arm.limits.effort
    return np.where(np.isfinite(limit) & (limit > 0.0), limit, 50.0)


def robot_urdf(name: str) -> str:
    """Return the URDF of `default` or of another robot; skip the test if it is missing."""
    if name == 'default':
        return default_arm_urdf()
    return robot_path(name).read_text(encoding='utf-8')
