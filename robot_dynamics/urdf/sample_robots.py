# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Names of well-known arms, whose URDFs are in the package example-robot-data."""

from collections.abc import Iterator
from contextlib import suppress
from importlib import metadata
import os
from pathlib import Path

from robot_dynamics.dependencies import missing

PACKAGE = 'example-robot-data'
SAMPLE_ROBOTS = {
    'kinova': 'kinova_description/robots/kinova.urdf',
    'panda': 'panda_description/urdf/panda.urdf',
    'talos_left_arm': 'talos_data/robots/talos_left_arm.urdf',
    'ur10': 'ur_description/urdf/ur10_robot.urdf',
    'ur3': 'ur_description/urdf/ur3_robot.urdf',
    'ur5': 'ur_description/urdf/ur5_robot.urdf',
    'xarm7': 'xarm_description/urdf/xarm7.urdf',
    'z1': 'z1_description/urdf/z1.urdf',
}
"""Files in the directory `robots` of the package, by name."""


def sample_robot_path(name: str) -> Path:
    """Return the URDF of a name of SAMPLE_ROBOTS; raise MissingDependencyError without it."""
    for directory in robot_directories():
        path = directory / SAMPLE_ROBOTS[name]
        if path.is_file():
            return path
    raise missing(f'the robot {name!r}', 'example_robot_data')


def robot_directories() -> Iterator[Path]:
    """Yield the directories that may contain the robots: in the wheel, in ROS installations."""
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    with suppress(metadata.PackageNotFoundError):
        prefixes.insert(0, str(metadata.distribution(PACKAGE).locate_file('cmeel.prefix')))
    yield from (Path(prefix, 'share', PACKAGE, 'robots') for prefix in prefixes if prefix)
