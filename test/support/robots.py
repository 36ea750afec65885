# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Descriptions of real robots for the tests: those of `example-robot-data`.

Without that package, the tests that need it are skipped with the reason. If the environment
variable CI is set, on x86-64 Linux, they fail instead.
"""

from collections.abc import Sequence
from importlib import metadata
import os
from pathlib import Path
import platform
import sys
from typing import Any, NoReturn

import pytest
from robot_dynamics.planar.urdf import default_arm_urdf

PACKAGE = 'example-robot-data'

_FILES = {
    'baxter': 'baxter_description/urdf/baxter.urdf',
    'kinova': 'kinova_description/robots/kinova.urdf',
    'panda': 'panda_description/urdf/panda.urdf',
    'pr2': 'pr2_description/urdf/pr2.urdf',
    'so100': 'so_arm_description/urdf/so100.urdf',
    'talos_full_v2': 'talos_data/robots/talos_full_v2.urdf',
    'talos_left_arm': 'talos_data/robots/talos_left_arm.urdf',
    'tiago': 'tiago_description/robots/tiago.urdf',
    'tiago_dual': 'tiago_description/robots/tiago_dual.urdf',
    'tiago_no_hand': 'tiago_description/robots/tiago_no_hand.urdf',
    'tiago_pro': 'tiago_pro_description/robots/tiago_pro.urdf',
    'ur10': 'ur_description/urdf/ur10_robot.urdf',
    'ur3': 'ur_description/urdf/ur3_robot.urdf',
    'ur5': 'ur_description/urdf/ur5_robot.urdf',
    'xarm7': 'xarm_description/urdf/xarm7.urdf',
    'z1': 'z1_description/urdf/z1.urdf',
}

ROBOTS = tuple(_FILES)
"""Every robot by the name that `robot_urdf` takes."""

ARMS = ('kinova', 'panda', 'so100', 'talos_left_arm', 'ur3', 'ur5', 'ur10', 'xarm7', 'z1')
"""Single arms, six to eight actuated joints each."""

MIMIC = ('baxter', 'panda', 'pr2', 'talos_full_v2', 'tiago_pro')
"""Robots with mimic joints."""

JOINTS = {
    'panda': [f'panda_joint{i + 1}' for i in range(7)], 'z1': [f'joint{i + 1}' for i in range(6)]}
"""Joints of an arm without its gripper."""

KINDS = {
    'ur5': 'serial, revolute joints',
    'kinova': 'serial, continuous joints',
    'panda': 'prismatic fingers, one of them a mimic joint',
    'so100': 'axes along x, y and z, a link with the name of a joint',
    'talos_left_arm': 'mimic elements at fixed joints',
    'tiago_no_hand': 'branches, prismatic lift, wheels, inertias that no body has',
    'talos_full_v2': 'many branches, revolute mimic joints',
    'pr2': 'negative axes, and all of the above in one tree',
}
"""One robot per kind of tree, with the kind; tests of all robots run these by default."""


def by_kind(names: Sequence[str] = ROBOTS) -> list[Any]:
    """Return these robots as parameters of a test, those not in `KINDS` with the mark `soak`."""
    return [
        pytest.param(name, marks=() if name in KINDS else pytest.mark.soak) for name in names]


def must_have_everything() -> bool:
    """Return whether a missing optional package is a failure here, not a reason to skip."""
    return bool(os.environ.get('CI')) and (
        sys.platform == 'linux' and platform.machine() == 'x86_64')


def missing(reason: str) -> NoReturn:
    """Skip the test for this reason, or fail it if all optional packages are required."""
    if must_have_everything():
        pytest.fail(f'{reason}; with CI set this is a failure')
    pytest.skip(reason)


def robot_path(name: str) -> Path:
    """Return the path of the URDF of one of `ROBOTS`; skip the test if it is not installed."""
    for directory in _robot_directories():
        path = directory / _FILES[name]
        if path.is_file():
            return path
    missing(f'{PACKAGE} is not installed: no description of {name}')


def is_installed() -> bool:
    """Return whether there is a directory with the robots."""
    return any(directory.is_dir() for directory in _robot_directories())


def robot_urdf(name: str) -> str:
    """Return the URDF of `default` or of one of `ROBOTS`; skip the test if it is missing."""
    if name == 'default':
        return default_arm_urdf()
    return robot_path(name).read_text(encoding='utf-8')


def _robot_directories() -> list[Path]:
    """Return the possible directories of the robots: in the wheel, or in a ROS installation."""
    share = Path('share', PACKAGE, 'robots')
    prefixes = [Path(p) for p in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if p]
    try:
        distribution = metadata.distribution(PACKAGE)
    except metadata.PackageNotFoundError:
        pass
    else:
        prefixes.insert(0, Path(str(distribution.locate_file('cmeel.prefix'))))
    return [prefix / share for prefix in prefixes]
