# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Tools that need ROS name it before they start a node; the others run without it."""

import os
import sys

from absent_libraries import environment_without
import children
import pytest
from robot_dynamics.dependencies import LIBRARIES
from robot_dynamics.planar.urdf import default_arm_urdf


@pytest.mark.parametrize('name', ['demo', 'status'])
def test_a_tool_that_needs_ros_names_it_before_its_work(name, tmp_path):
    (site := tmp_path / 'site').mkdir()
    (place := tmp_path / 'here').mkdir()
    environment = environment_without(site, [*LIBRARIES, 'rclpy'])
    done = children.run(
        [sys.executable, '-m', 'robot_dynamics_tools', name],
        capture_output=True, text=True, cwd=place, env={**os.environ, **environment})
    assert done.stdout == ''
    line, = done.stderr.splitlines()
    assert 'ROS 2 Jazzy' in line
    assert 'source ' in line
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
