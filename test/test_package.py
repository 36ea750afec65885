# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The names that `import robot_dynamics` provides, and the modules that it loads."""

import ast
from configparser import ConfigParser
from graphlib import TopologicalSorter
from pathlib import Path
import re
import shutil
import subprocess
import sys
import zipfile

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
    tree = ast.parse(Path(robot_dynamics.__file__).read_text(encoding='utf-8'))
    block, = (node for node in tree.body if isinstance(node, ast.If))
    seen = {alias.asname: node.module for node in block.body
            if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert seen == robot_dynamics._MODULES


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


def test_few_annotations_have_any_type():
    """Of parameters, fields and variables; the modules of ROS have no types."""
    found = [words for path in Path(robot_dynamics.__file__).parent.rglob('*.py')
             for words in re.findall(
                 r'\b\w+: [^=\n#]*\bAny\b', path.read_text(encoding='utf-8'))]
    assert 0 < len(found) <= 230, found


def imports_within(folder: Path) -> dict[str, set[str]]:
    """Return the modules of a folder with those that each imports, also only for types."""
    name = '.'.join(folder.relative_to(PROJECT).parts)
    return {
        path.stem: {
            node.module.removeprefix(f'{name}.')
            for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith(f'{name}.')}
        for path in folder.glob('*.py') if path.name != '__init__.py'}


@pytest.mark.parametrize('folder', [
    path.parent for path in sorted(Path(robot_dynamics.__file__).parent.rglob('__init__.py'))],
    ids=lambda path: path.name)
def test_no_circle_of_imports_in_a_folder(folder):
    list(TopologicalSorter(imports_within(folder)).static_order())  # raises CycleError


@pytest.fixture(scope='module')
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the unpacked wheel that `pip install .` makes of this package."""
    directory = tmp_path_factory.mktemp('wheel')
    source = directory / 'source'
    for name in ('robot_dynamics', 'resource', 'config', 'launch', 'rviz'):
        shutil.copytree(
            PROJECT / name, source / name, ignore=shutil.ignore_patterns('__pycache__'))
    for name in ('LICENSE', 'setup.py', 'setup.cfg', 'package.xml'):
        shutil.copy(PROJECT / name, source)
    subprocess.run(
        [sys.executable, 'setup.py', '-q', 'bdist_wheel', '--dist-dir', directory],
        cwd=source, check=True, capture_output=True)
    file, = directory.glob('*.whl')
    zipfile.ZipFile(file).extractall(directory / 'unpacked')
    return directory / 'unpacked'


def test_a_wheel_puts_no_names_of_others_on_the_path(wheel):
    entries = ConfigParser()
    entries.optionxform = str  # type: ignore[assignment,method-assign]
    entries.read(next(wheel.glob('*.dist-info')) / 'entry_points.txt')
    names = list(entries['console_scripts'])
    assert len(names) == 4
    assert all(name.startswith('robot_dynamics_') for name in names)


def test_the_library_of_a_wheel_needs_no_ros_and_has_version_licence_and_author(wheel):
    metadata = next(wheel.glob('*.dist-info')) / 'METADATA'
    text = metadata.read_text(encoding='utf-8')
    fields = dict(re.findall(r'^([\w-]+): (.+)$', text, re.MULTILINE))
    program = '\n'.join([
        'import sys', f'sys.path.insert(0, {str(wheel)!r})',
        "sys.modules['rclpy'] = sys.modules['robot_dynamics_interfaces'] = None",
        'import numpy, robot_dynamics', 'from robot_dynamics.planar import default_arm_urdf',
        'arm = robot_dynamics.load_arm(default_arm_urdf())',
        'gravity = robot_dynamics.ArmDynamics(arm).rigid_body.gravity',
        'print(robot_dynamics.__file__, robot_dynamics.__version__,',
        '      all(getattr(robot_dynamics, name) for name in robot_dynamics.__all__),',
        '      *gravity(numpy.array([numpy.pi / 4, numpy.pi / 6])).round(6))'])
    file, version, *more = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=True).stdout.split()
    assert file.startswith(str(wheel))
    assert more == ['True', '-49.522825', '-11.370879']
    assert version == fields['Version'] == robot_dynamics.__version__
    assert fields['Author'] == 'The robot_dynamics authors'
    assert list(metadata.parent.rglob('LICENSE'))
