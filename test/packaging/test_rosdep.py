# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""rosdep and catkin_pkg with all packages; the index of rosdep is local."""

import re
import shlex
import subprocess

from catkin_pkg.packages import find_packages
import pytest
from workspace import documented, PACKAGES, Workspace

pytest.importorskip('rosdep2', reason='rosdep is not installed')

KEYS = (
    'python3-argcomplete', 'python3-hypothesis', 'python3-matplotlib', 'python3-numpy',
    'python3-pil', 'python3-pytest', 'python3-scipy', 'python3-yaml')
"""Keys of rosdep/python.yaml with a package of Ubuntu, in ros/rosdistro of 22 August 2026."""
ROS_PACKAGES = (
    'ament_cmake', 'builtin_interfaces', 'coal', 'control_msgs', 'diagnostic_msgs',
    'geometry_msgs', 'launch', 'launch_ros', 'lifecycle_msgs', 'pinocchio',
    'rcl_interfaces', 'rclpy', 'robot_state_publisher', 'ros2cli', 'ros2launch', 'rosgraph_msgs',
    'rosidl_default_generators', 'rosidl_default_runtime', 'sensor_msgs', 'std_msgs', 'std_srvs',
    'trajectory_msgs', 'visualization_msgs', 'xacro')
"""Packages of jazzy/distribution.yaml, as above."""
INDEX = """%YAML 1.1
---
distributions:
  jazzy:
    distribution: [distribution.yaml]
    distribution_status: active
    distribution_type: ros2
    python_version: 3
type: index
version: 4
"""
RELEASED = (
    "  {0}: {{release: {{packages: [{0}], tags: {{release: x}}, version: 1.0.0-1,\n"
    "    url: 'https://localhost/{0}.git'}}}}\n")
DISTRIBUTION = """%YAML 1.1
---
release_platforms: {{ubuntu: [noble]}}
repositories:
{0}type: distribution
version: 2
"""
SIMULATED = ('--simulate', '--reinstall', '--os=ubuntu:noble')
"""rosdep then prints what it would install on Ubuntu 24.04, also what is installed here."""


@pytest.fixture(scope='module')
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Return a workspace whose rosdep knows KEYS and ROS_PACKAGES, and needs no network."""
    directory = tmp_path_factory.mktemp('rosdep')
    made, index = Workspace(directory), directory / 'index'
    (index / 'sources').mkdir(parents=True)
    (index / 'python.yaml').write_text(
        ''.join(f'{key}: {{ubuntu: [{key}]}}\n' for key in KEYS), encoding='utf-8')
    (index / 'sources' / '10-local.list').write_text(f'yaml file://{index}/python.yaml\n')
    (index / 'index.yaml').write_text(INDEX)
    (index / 'distribution.yaml').write_text(
        DISTRIBUTION.format(''.join(map(RELEASED.format, ROS_PACKAGES))))
    made.environment.update(
        AMENT_PREFIX_PATH=str(index),  # rosdep leaves out packages that it finds there
        HOME=str(directory), ROS_HOME=str(directory / 'ros'), ROS_DISTRO='jazzy',
        ROSDEP_SOURCE_PATH=str(index / 'sources'), ROSDISTRO_INDEX_URL=f'file://{index}/index.yaml')
    updated = made.run('rosdep update --rosdistro jazzy')
    assert updated.returncode == 0, updated.stdout
    return made


def check_installed(workspace: Workspace, command: str) -> None:
    """Check that this command of rosdep installs all that the packages need."""
    installed = workspace.run(command, *SIMULATED)
    assert installed.returncode == 0, installed.stdout
    names = re.findall('apt-get install -y.* (.+)', installed.stdout)
    expected = [f'ros-jazzy-{name.replace("_", "-")}' for name in ROS_PACKAGES]
    assert sorted(names) == sorted([*KEYS, *expected])


def test_rosdep_and_catkin_pkg_find_the_nested_packages_by_paths_or_links(workspace):
    """Rosdep does not look inside packages; if it did, no command would need the other paths."""
    check_installed(workspace, documented('rosdep install'))
    one_path = 'rosdep install --from-paths src -y --ignore-src'
    source = str(workspace.directory / 'src')
    installed = workspace.run(one_path, *SIMULATED)
    assert installed.returncode != 0
    assert 'Cannot locate rosdep definition for [robot_dynamics_interfaces]' in installed.stdout
    assert [package.name for package in find_packages(source).values()] == ['robot_dynamics']
    subprocess.run(shlex.split(documented('ln -s')), cwd=workspace.directory, check=True)
    check_installed(workspace, one_path)
    assert {package.name for package in find_packages(source).values()} == set(PACKAGES)
