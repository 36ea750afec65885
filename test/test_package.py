# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The names that `import robot_dynamics` provides, and the modules that it loads."""

import ast
from collections.abc import Iterator
from configparser import ConfigParser
from graphlib import CycleError, TopologicalSorter
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


def test_type_checkers_see_the_same_names():
    tree = ast.parse(Path(robot_dynamics.__file__).read_text(encoding='utf-8'))
    block, = (node for node in tree.body if isinstance(node, ast.If))
    seen = {alias.asname: node.module for node in block.body
            if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert seen == robot_dynamics._MODULES


def test_another_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="has no attribute 'load_robot'"):
        robot_dynamics.load_robot  # noqa: B018


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


def test_no_name_of_a_subpackage_hides_a_module():
    root = Path(robot_dynamics.__file__).parent
    hidden = [f'{folder}.{name}' for folder in FOLDERS
              for name in __import__(f'robot_dynamics.{folder}', fromlist=['__all__']).__all__
              if (root / folder / f'{name}.py').exists()]
    assert not hidden


MOST_ANY = 40
"""Largest number of parameters of public functions and methods whose type is, or has, `Any`."""


def public_functions(body: list[ast.stmt]) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Yield the functions and methods without a leading underscore, and constructors."""
    for node in body:
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            if not node.name.startswith('_') or node.name in ('__init__', '__call__'):
                yield node
        elif isinstance(node, ast.ClassDef) and not node.name.startswith('_'):
            yield from public_functions(node.body)


def has_any(annotation: ast.expr) -> bool:
    """Return whether `Any` is the type, or a part of it, also of a type in quotes."""
    return any(
        isinstance(node, ast.Name) and node.id == 'Any'
        or isinstance(node, ast.Constant) and re.search(r'\bAny\b', str(node.value)) is not None
        for node in ast.walk(annotation))


def test_few_public_parameters_have_any_type():
    package = Path(robot_dynamics.__file__).parent
    found, count = [], 0
    for path in sorted(package.rglob('*.py')):
        if path.name.startswith('_') and path.name != '__init__.py':
            continue
        for function in public_functions(ast.parse(path.read_text(encoding='utf-8')).body):
            given = function.args
            count += len(given.args)
            found += [
                f'{path.relative_to(package)}: {function.name}({parameter.arg})'
                for parameter in (*given.posonlyargs, *given.args, *given.kwonlyargs,
                                  *filter(None, (given.vararg, given.kwarg)))
                if parameter.annotation is not None and has_any(parameter.annotation)]
    assert count > 1000
    assert len(found) <= MOST_ANY, '\n'.join(found)
    assert has_any(ast.parse("Sequence['Any | None']", mode='eval').body)
    assert not has_any(ast.parse('Sequence[object]', mode='eval').body)


def imports_within(folder: Path, root: Path = PROJECT) -> dict[str, set[str]]:
    """Return the modules of a folder with those that each imports, also only for types."""
    name = '.'.join(folder.relative_to(root).parts)
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


def test_imports_for_types_count_in_a_circle(tmp_path):
    (tmp_path / 'one').mkdir()
    (tmp_path / 'one' / 'a.py').write_text('from one.b import B\n', encoding='utf-8')
    (tmp_path / 'one' / 'b.py').write_text(
        'if TYPE_CHECKING:\n    from one.a import A\n', encoding='utf-8')
    with pytest.raises(CycleError):
        list(TopologicalSorter(imports_within(tmp_path / 'one', tmp_path)).static_order())


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
    assert len(names) >= 12
    assert all(name.startswith('robot_dynamics_') for name in names)


def test_the_library_of_a_wheel_needs_no_ros(wheel):
    program = '\n'.join([
        'import sys', f'sys.path.insert(0, {str(wheel)!r})',
        "sys.modules['rclpy'] = sys.modules['robot_dynamics_interfaces'] = None",
        'import numpy, robot_dynamics', 'from robot_dynamics.planar import default_arm_urdf',
        f'assert robot_dynamics.__file__.startswith({str(wheel)!r})',
        'arm = robot_dynamics.load_arm(default_arm_urdf())',
        'gravity = robot_dynamics.ArmDynamics(arm).rigid_body.gravity',
        'print(all(getattr(robot_dynamics, name) for name in robot_dynamics.__all__),',
        '      gravity(numpy.array([numpy.pi / 4, numpy.pi / 6])).round(6).tolist())'])
    out = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=True).stdout
    assert out == 'True [-49.522825, -11.370879]\n'


def test_a_wheel_has_version_licence_and_author(wheel):
    metadata = next(wheel.glob('*.dist-info')) / 'METADATA'
    text = metadata.read_text(encoding='utf-8')
    fields = dict(re.findall(r'^([\w-]+): (.+)$', text, re.MULTILINE))
    program = f'import sys; sys.path.insert(0, {str(wheel)!r}); import robot_dynamics; ' \
        'print(robot_dynamics.__file__, robot_dynamics.__version__)'
    file, version = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=True).stdout.split()
    assert file.startswith(str(wheel))
    assert version == fields['Version'] == robot_dynamics.__version__
    assert fields['Author'] == 'The robot_dynamics authors'
    assert list(metadata.parent.rglob('LICENSE'))
