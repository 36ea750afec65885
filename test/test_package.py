# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The names that `import robot_dynamics` provides, and the modules that it loads."""

from graphlib import TopologicalSorter
from pathlib import Path
import subprocess
import sys

from package_contents import executables, imports_within, names_for_type_checkers, unpacked_wheel
import pytest
import robot_dynamics
from robot_dynamics.exceptions import RobotDynamicsError

PROJECT = Path(robot_dynamics.__file__).parents[1]
FOLDERS = sorted(
    path.parent.name for path in Path(robot_dynamics.__file__).parent.glob('*/__init__.py')
    if path.parent.name not in ('ros', 'tools'))


def test_every_name_is_that_of_its_subpackage():
    assert len(robot_dynamics.__all__) >= 15
    for name in robot_dynamics.__all__:
        assert name in dir(robot_dynamics)
        assert getattr(robot_dynamics, name).__name__ == name
    assert robot_dynamics.RobotDynamicsError is RobotDynamicsError
    with pytest.raises(AttributeError, match="has no attribute 'load_robot'"):
        robot_dynamics.load_robot  # noqa: B018


def test_type_checkers_see_the_same_names():
    assert names_for_type_checkers(robot_dynamics) == robot_dynamics._MODULES


def test_the_package_alone_loads_no_library():
    program = 'import sys, robot_dynamics; print(*sorted({n.split(".")[0] for n in sys.modules}))'
    loaded = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=True).stdout.split()
    assert 'robot_dynamics' in loaded
    assert not {'numpy', 'pinocchio', 'scipy', 'matplotlib', 'rclpy'} & set(loaded)


@pytest.mark.parametrize('folder', FOLDERS)
def test_a_subpackage_offers_what_it_lists(folder):
    module = __import__(f'robot_dynamics.{folder}', fromlist=['__all__'])
    assert module.__doc__
    assert sorted(module.__all__, key=str.lower) == module.__all__
    assert all(hasattr(module, name) for name in module.__all__)
    # no name hides a module
    assert not set(module.__all__) & {path.stem for path in Path(module.__file__).parent.iterdir()}


@pytest.mark.parametrize('folder', [
    path.parent for path in sorted(Path(robot_dynamics.__file__).parent.rglob('__init__.py'))],
    ids=lambda path: path.name)
def test_no_circle_of_imports_in_a_folder(folder):
    list(TopologicalSorter(imports_within(PROJECT, folder)).static_order())  # raises CycleError


def test_a_wheel_has_the_licence_and_puts_no_names_of_others_on_the_path(tmp_path):
    wheel = unpacked_wheel(
        PROJECT, ('robot_dynamics', 'resource', 'config', 'launch', 'rviz'), tmp_path)
    names = executables(wheel)
    assert len(names) == 4
    assert all(name.startswith('robot_dynamics_') for name in names)
    assert list(wheel.rglob('LICENSE'))
