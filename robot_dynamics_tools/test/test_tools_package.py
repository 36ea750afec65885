# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The names that `import robot_dynamics_tools` provides, and the wheel of the package."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

from package_contents import executables, imports_within, names_for_type_checkers, unpacked_wheel
import pytest
import robot_dynamics_tools

PROJECT = Path(__file__).parents[1]
PACKAGE = PROJECT / 'robot_dynamics_tools'


def test_every_name_is_that_of_its_subpackage():
    assert {'Recording', 'analyze_recording', 'identify'} <= set(robot_dynamics_tools.__all__)
    for name in robot_dynamics_tools.__all__:
        assert name in dir(robot_dynamics_tools)
        assert getattr(robot_dynamics_tools, name).__name__ == name
    with pytest.raises(AttributeError, match="has no attribute 'load_arm'"):
        robot_dynamics_tools.load_arm  # noqa: B018


def test_type_checkers_see_the_same_names():
    assert names_for_type_checkers(robot_dynamics_tools) == robot_dynamics_tools._MODULES


@pytest.mark.parametrize('folder', sorted(path.parent for path in PACKAGE.rglob('__init__.py')),
                         ids=lambda path: path.name)
def test_a_folder_says_what_it_is_for_and_has_no_circle_of_imports(folder):
    doc = ast.get_docstring(ast.parse((folder / '__init__.py').read_text(encoding='utf-8')))
    assert doc
    list(TopologicalSorter(imports_within(PROJECT, folder)).static_order())  # raises CycleError


def test_a_wheel_has_the_licence_and_puts_no_names_of_others_on_the_path(tmp_path):
    wheel = unpacked_wheel(PROJECT, ('robot_dynamics_tools', 'resource', 'launch'), tmp_path)
    names = executables(wheel)
    assert len(names) == 15
    assert all(name.startswith('robot_dynamics_') for name in names)
    assert list(wheel.rglob('LICENSE'))
