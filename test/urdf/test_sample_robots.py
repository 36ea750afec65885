# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Robots by name: their descriptions, and unknown names."""

from pathlib import Path

import pytest
from robot_dynamics.exceptions import MissingDependencyError, ModelError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.urdf import sample_robots
from robot_dynamics.urdf.description_file import description_path, read_description_file
from robot_dynamics.urdf.sample_robots import SAMPLE_ROBOTS
from robots import robot_path


@pytest.mark.parametrize('name', SAMPLE_ROBOTS)
def test_each_name_is_an_arm(name):
    robot_path(name)  # skips the test without the package
    arm = load_arm(read_description_file(name, '--urdf'))
    assert arm.joint_count >= 6
    assert (arm.limits.effort > 0.0).all()


def test_a_file_of_that_name_is_read_instead(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path('ur10').write_text('<robot/>', encoding='utf-8')
    assert description_path('ur10', '--urdf') == Path('ur10')


def test_another_name_is_rejected_with_the_names():
    with pytest.raises(ModelError, match=r"is 'ur99', which .* one of \['kinova', 'panda'"):
        read_description_file('ur99', '--urdf')


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setattr(sample_robots, 'robot_directories', lambda: iter(()))
    with pytest.raises(MissingDependencyError, match='needs the library example-robot-data'):
        read_description_file('ur10', '--urdf')
