# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Tools name the library that is missing before they start a node."""

import os
import sys

from absent_libraries import environment_without
import children
import pytest
from robot_dynamics.dependencies import LIBRARIES
from robot_dynamics.planar.urdf import default_arm_urdf

RECORDED = ['rosbags', 'PyYAML', 'scipy', 'matplotlib']
TOOLS = {
    'analyze': (['BAG', '--output', 'out'], RECORDED),
    'identify': (['BAG', '--urdf', 'arm.urdf'], RECORDED),
    'animate': ([], ['matplotlib', 'Pillow']),
    'animate BAG': (['BAG'], ['Pillow', *RECORDED]),
    'torque_map': ([], ['matplotlib']),
    'demo': ([], ['ROS 2 Jazzy']),
    'status': ([], ['ROS 2 Jazzy']),
}
"""Arguments of tools, and what they need beyond numpy and Pinocchio."""


@pytest.mark.parametrize('name', TOOLS)
def test_a_tool_names_all_missing_libraries_before_its_work(name, tmp_path):
    arguments, missing = TOOLS[name]
    (site := tmp_path / 'site').mkdir()
    (place := tmp_path / 'here').mkdir()
    environment = environment_without(site, [*LIBRARIES, 'rclpy'])
    done = children.run(
        [sys.executable, '-m', 'robot_dynamics_tools', name.partition(' ')[0], *arguments],
        capture_output=True, text=True, cwd=place, env={**os.environ, **environment})
    assert done.stdout == ''
    line, = done.stderr.splitlines()
    assert all(library in line for library in missing), line
    assert ('Install' if len(missing) > 1 or missing == ['matplotlib'] else 'source ') in line
    assert done.returncode in (1, 2)
    assert not list(place.iterdir())


def test_excite_needs_neither_ros_nor_a_library(tmp_path):
    (tmp_path / 'arm.urdf').write_text(default_arm_urdf(), encoding='utf-8')
    (site := tmp_path / 'site').mkdir()
    done = children.run(
        [sys.executable, '-m', 'robot_dynamics_tools', 'excite', '--urdf', 'arm.urdf',
         '--duration', '2', '--harmonics', '2'], capture_output=True, text=True, cwd=tmp_path,
        env={**os.environ, **environment_without(site, [*LIBRARIES, 'rclpy'])})
    assert done.returncode == 0, done.stderr
