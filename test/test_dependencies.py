# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What the package imports is declared, and a missing library is named with its command."""

import ast
import itertools
import os
from pathlib import Path
import re
import shlex
import subprocess
import sys

from absent_libraries import environment_without
import children
import pytest
from robot_dynamics.dependencies import install_command, LIBRARIES, optional, require
from robot_dynamics.exceptions import MissingDependencyError

ROOT = Path(__file__).parents[1]
PACKAGES = {'robot_dynamics': ROOT, 'robot_dynamics_tools': ROOT / 'robot_dynamics_tools'}
"""The directories of the packages."""
SYSTEM_PYTHON = Path('/usr/bin/python3')
ROSDEP_KEYS = {
    'PIL': 'python3-pil', 'argcomplete': 'python3-argcomplete', 'matplotlib': 'python3-matplotlib',
    'numpy': 'python3-numpy', 'scipy': 'python3-scipy', 'yaml': 'python3-yaml'}
"""The rosdep keys of modules that no package of ROS has."""
DISTRIBUTIONS = {
    'PIL': 'pillow', 'backports': 'backports.zstd', 'imageio_ffmpeg': 'imageio-ffmpeg',
    'yaml': 'pyyaml'}
"""The names on PyPI of modules that have another one there."""
OF_NEWER_PYTHON = {'compression'}
"""Modules of the standard library of Python 3.14."""


def required_by_setup(package: str) -> set[str]:
    """Return the packages of PyPI that setup.py requires, also in an extra."""
    found: list[str] = []
    for node in ast.walk(ast.parse((PACKAGES[package] / 'setup.py').read_text('utf-8'))):
        if isinstance(node, ast.keyword) and node.arg == 'install_requires':
            found += ast.literal_eval(node.value)
        elif isinstance(node, ast.keyword) and node.arg == 'extras_require':
            found += itertools.chain(*ast.literal_eval(node.value).values())
    return {re.split(r'[~=<>;]', required)[0].strip() for required in found}


def imported_modules(path: Path) -> set[str]:
    """Return the modules outside of the standard library that a file imports, also if needed."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.append(node.module)
        elif isinstance(node, ast.Call) and getattr(node.func, 'id', '') == 'optional':
            names += [part.value for part in node.args[:1] if isinstance(part, ast.Constant)]
    return ({name.partition('.')[0] for name in names}
            - set(sys.stdlib_module_names) - OF_NEWER_PYTHON)


IMPORTED = sorted({
    (package, module) for package, directory in PACKAGES.items()
    for path in [*(directory / package).rglob('*.py'), *(directory / 'launch').glob('*.py')]
    for module in imported_modules(path) - {package}})


@pytest.mark.parametrize(('package', 'module'), IMPORTED)
def test_every_import_is_declared(package, module):
    """A module has a package of ROS or a rosdep key in package.xml, or is in setup.py."""
    manifest = (PACKAGES[package] / 'package.xml').read_text(encoding='utf-8')
    assert (ROSDEP_KEYS.get(module, module) in re.findall(r'<(?:exec_)?depend>(.+?)</', manifest)
            or DISTRIBUTIONS.get(module, module) in required_by_setup(package)), module


@pytest.mark.parametrize('library', LIBRARIES)
def test_a_missing_library_is_named_with_its_command(library, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    name, _, packages = LIBRARIES[library]
    words = f'a test needs the library {name}, which cannot be imported. Install it: '
    with pytest.raises(MissingDependencyError) as caught:
        optional(f'{library}.part', 'a test')
    assert str(caught.value) == words + install_command(library)
    assert set(packages) <= set().union(*map(required_by_setup, PACKAGES))


def test_all_missing_libraries_are_named_with_one_command(monkeypatch):
    for module in ('rosbags', 'scipy'):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingDependencyError) as caught:
        require('a test', 'rosbags', 'yaml', 'scipy')
    assert str(caught.value) == (
        'a test needs the libraries rosbags and scipy, which cannot be imported. Install them: '
        + install_command('rosbags', 'scipy'))
    assert install_command('rosbags', 'scipy').count('pip install') == 1
    assert optional('yaml.nodes', 'a test').__name__ == 'yaml.nodes'


@pytest.mark.parametrize(('name', 'arguments'), [
    ('check_model', ['package://arm/arm.urdf']), ('planar_urdf', ['-o', 'x.urdf'])])
def test_other_tools_need_neither_ros_nor_a_library(name, arguments, tmp_path):
    """A description of a package is found without the modules of ROS."""
    from robot_dynamics.planar.urdf import default_arm_urdf
    (tmp_path / 'arm.urdf').write_text(default_arm_urdf(), encoding='utf-8')
    share = tmp_path / 'share'
    for directory in (share / 'arm', share / 'ament_index/resource_index/packages'):
        directory.mkdir(parents=True)
    (share / 'ament_index/resource_index/packages/arm').touch()
    (share / 'arm/arm.urdf').write_text(default_arm_urdf(), encoding='utf-8')
    environment = environment_without(tmp_path, [*LIBRARIES, 'rclpy', 'ament_index_python'])
    done = children.run(
        [sys.executable, '-m', f'robot_dynamics.tools.{name}', *arguments], capture_output=True,
        text=True, cwd=tmp_path,
        env={**os.environ, **environment, 'AMENT_PREFIX_PATH': str(tmp_path)})
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize('absent', ['rclpy', 'robot_dynamics_interfaces'])
def test_a_node_without_ros_names_the_command(absent, tmp_path):
    environment = environment_without(tmp_path, [absent])
    done = children.run(
        [sys.executable, '-c', 'from robot_dynamics.ros import entry_points; '
         'entry_points.dynamics_node()'], capture_output=True, text=True,
        env={**os.environ, **environment})
    assert done.returncode == 1
    line, = done.stderr.splitlines()
    command = {'rclpy': 'source /opt/ros/jazzy/setup.bash',
               'robot_dynamics_interfaces': 'colcon build --base-paths src '}[absent]
    assert f'(the module {absent}), which cannot be imported. ' in line
    assert command in line


@pytest.mark.skipif(
    sys.prefix == sys.base_prefix, reason='not in a virtual environment, as scripts/test is')
def test_the_command_in_a_virtual_environment_is_that_of_its_pip():
    assert shlex.split(install_command('viser')) == [
        sys.executable, '-m', 'pip', 'install', 'viser', 'pycollada']


@pytest.mark.skipif(
    not list(Path('/usr/lib').glob('python3*/EXTERNALLY-MANAGED')),
    reason='no Python of Debian or Ubuntu that refuses a plain pip install (PEP 668)')
def test_the_system_python_gets_a_command_that_it_does_not_refuse():
    program = ('from robot_dynamics.dependencies import *; print(install_command("scipy")); '
               'print(install_command("rosbags"))')
    apt, pip = subprocess.run(
        [SYSTEM_PYTHON, '-c', program], cwd=ROOT, env={'PATH': '/usr/bin'}, check=True,
        capture_output=True, text=True).stdout.splitlines()
    assert apt == 'sudo apt install python3-scipy'
    assert shlex.split(pip.rpartition(' && ')[2]) == [
        str(SYSTEM_PYTHON), '-m', 'pip', 'install', '--user', '--break-system-packages', 'rosbags',
        'numpy<2']
