# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The names that `import robot_dynamics_tools` provides, and the wheel of the package."""

import ast
from configparser import ConfigParser
from graphlib import TopologicalSorter
from pathlib import Path
import shutil
import subprocess
import sys
import zipfile

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
    tree = ast.parse(Path(robot_dynamics_tools.__file__).read_text(encoding='utf-8'))
    block, = (node for node in tree.body if isinstance(node, ast.If))
    seen = {alias.asname: node.module for node in block.body
            if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert seen == robot_dynamics_tools._MODULES


@pytest.mark.parametrize('folder', sorted(path.parent for path in PACKAGE.rglob('__init__.py')),
                         ids=lambda path: path.name)
def test_a_folder_says_what_it_is_for_and_has_no_circle_of_imports(folder):
    doc = ast.get_docstring(ast.parse((folder / '__init__.py').read_text(encoding='utf-8')))
    assert doc
    name = '.'.join(folder.relative_to(PROJECT).parts)
    imports = {
        path.stem: {
            node.module.removeprefix(f'{name}.')
            for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith(f'{name}.')}
        for path in folder.glob('*.py') if path.name != '__init__.py'}
    list(TopologicalSorter(imports).static_order())  # raises CycleError


def test_a_wheel_puts_no_names_of_others_on_the_path(tmp_path):
    source = tmp_path / 'source'
    shutil.copytree(PROJECT, source, ignore=shutil.ignore_patterns(
        '__pycache__', 'test', 'build', '*.egg-info'))
    subprocess.run(
        [sys.executable, 'setup.py', '-q', 'bdist_wheel', '--dist-dir', tmp_path],
        cwd=source, check=True, capture_output=True)
    wheel, = tmp_path.glob('*.whl')
    zipfile.ZipFile(wheel).extractall(tmp_path / 'unpacked')
    entries = ConfigParser()
    entries.optionxform = str  # type: ignore[assignment,method-assign]
    about, = (tmp_path / 'unpacked').glob('*.dist-info')
    entries.read(about / 'entry_points.txt')
    names = list(entries['console_scripts'])
    assert len(names) == 14
    assert all(name.startswith('robot_dynamics_') for name in names)
    assert list(about.rglob('LICENSE'))
