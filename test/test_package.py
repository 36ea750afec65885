# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What `import robot_dynamics` offers, and what it loads."""

import ast
from pathlib import Path
import subprocess
import sys

import pytest
import robot_dynamics
from robot_dynamics.exceptions import RobotDynamicsError

FOLDERS = sorted(
    path.parent.name for path in Path(robot_dynamics.__file__).parent.glob('*/__init__.py')
    if path.parent.name not in ('ros', 'tools'))


def test_every_name_is_that_of_its_subpackage() -> None:
    assert len(robot_dynamics.__all__) >= 15
    for name in robot_dynamics.__all__:
        assert name in dir(robot_dynamics)
        assert getattr(robot_dynamics, name).__name__ == name
    assert robot_dynamics.RobotDynamicsError is RobotDynamicsError


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse(Path(robot_dynamics.__file__).read_text(encoding='utf-8'))
    block, = (node for node in tree.body if isinstance(node, ast.If))
    seen = {alias.asname: node.module for node in block.body
            if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert seen == robot_dynamics._MODULES


def test_another_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'load_robot'"):
        robot_dynamics.load_robot  # noqa: B018


def test_the_package_alone_loads_no_library() -> None:
    program = 'import sys, robot_dynamics; print(*sorted({n.split(".")[0] for n in sys.modules}))'
    loaded = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=True).stdout.split()
    assert 'robot_dynamics' in loaded
    assert not {'numpy', 'pinocchio', 'scipy', 'matplotlib', 'rclpy'} & set(loaded)


@pytest.mark.parametrize('folder', FOLDERS)
def test_a_subpackage_offers_what_it_lists(folder: str) -> None:
    module = __import__(f'robot_dynamics.{folder}', fromlist=['__all__'])
    assert module.__doc__
    assert sorted(module.__all__, key=str.lower) == module.__all__
    assert all(hasattr(module, name) for name in module.__all__)


def test_no_name_of_a_subpackage_hides_a_module() -> None:
    root = Path(robot_dynamics.__file__).parent
    hidden = [f'{folder}.{name}' for folder in FOLDERS
              for name in __import__(f'robot_dynamics.{folder}', fromlist=['__all__']).__all__
              if (root / folder / f'{name}.py').exists()]
    assert not hidden
