# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The package `robot_dynamics` in an environment with its own dependencies only, without the tools.

The environment is a new virtual one. It has the wheel of the package, and of the libraries that
are installed here those that the package requires, with theirs. Its tests get pytest
and hypothesis.
"""

from importlib import metadata
import json
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree

import children
from closed_loop import receiving
from package_contents import unpacked_wheel
import pytest
import robot_dynamics
from robot_dynamics_interfaces.srv import InverseDynamics
from ros_harness import DYNAMICS, NodeProcess, running, SIMULATED_ARM, UNHURRIED
from workspace import is_of_this_project

ROOT = Path(__file__).resolve().parents[2]
REQUIRED = ('numpy', 'pin', 'pyyaml', 'setuptools')
TEST_TOOLS = ('hypothesis', 'pytest')
LIBRARY_TESTS = (
    'control/test_controller.py', 'joints/test_friction.py', 'model/test_engines.py',
    'model/test_public_input.py', 'model_check/test_model_check.py',
    'monitoring/test_state_age.py', 'planar/test_two_link.py', 'references/test_jerk_profile.py',
    'simulation/test_command_timeout.py', 'task_space', 'trajectories/test_goal_limits.py',
    'urdf/test_parser.py', 'urdf/test_sample_robots.py')
"""Quick tests of each folder of the library, and those that compare with other libraries."""
ABSENT = ('scipy', 'mujoco', 'pydrake', 'ruckig', 'example-robot-data')
"""What tests compare with, one of them in each reason to skip."""
OF_TOOLS = (
    'matplotlib', 'scipy', 'PIL', 'rosbags', 'viser', 'trimesh', 'xacro', 'mujoco', 'bokeh',
    'pytest', 'robot_dynamics_tools.recordings')
IMPORTABLE = """
import importlib, json, sys
found = []
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
        found.append(name)
    except ImportError:
        pass
print(json.dumps(found))
"""


def installed_distributions() -> dict[str, metadata.Distribution]:
    return {re.sub('[-_.]+', '-', one.metadata['Name']).lower(): one
            for one in metadata.distributions() if one.metadata['Name']}


def required_by(*names: str) -> dict[str, metadata.Distribution]:
    """Return the distributions of these names, and what they require."""
    installed, left = installed_distributions(), list(names)
    found: dict[str, metadata.Distribution] = {}
    while left:
        name = left.pop()
        if name in found or name not in installed:
            continue
        found[name] = installed[name]
        for requirement in found[name].requires or []:
            if 'extra ==' not in requirement:
                word = re.split(r'[^\w.-]', requirement)[0]
                left.append(re.sub('[-_.]+', '-', word).lower())
    return found


def link(one: metadata.Distribution, site: Path) -> None:
    """Link the files of a distribution into the site-packages of another environment."""
    for name in {file.parts[0] for file in one.files or [] if file.parts[0] != '..'}:
        target = Path(str(one.locate_file(name)))
        if target.exists() and not (site / name).exists():
            (site / name).symlink_to(target)


class Environment:
    """A virtual environment, and variables for its processes."""

    def __init__(self, directory: Path) -> None:
        self.python = directory / 'venv' / 'bin' / 'python'
        subprocess.run(
            [sys.executable, '-m', 'venv', '--without-pip', directory / 'venv'], check=True)
        site, = (directory / 'venv').glob('lib/python*/site-packages')
        ros = [name for name in installed_distributions() if name.startswith('ros-jazzy-')]
        for one in required_by(*ros, *REQUIRED).values():
            link(one, site)
        self.test_tools = directory / 'test_tools'
        self.test_tools.mkdir()
        for one in required_by(*TEST_TOOLS).values():
            link(one, self.test_tools)
        wheel = unpacked_wheel(
            ROOT, ('robot_dynamics', 'resource', 'config', 'launch', 'rviz'), directory)
        shutil.copytree(wheel, site, dirs_exist_ok=True)
        paths = {name: os.pathsep.join(
            path for path in os.environ.get(name, '').split(os.pathsep)
            if path and ('robot_dynamics_interfaces' in path
                         or not is_of_this_project(Path(path)) and path != str(ROOT)))
            for name in ('PYTHONPATH', 'AMENT_PREFIX_PATH')}
        self.tests = directory / 'tests'
        for name in ('test', 'docs'):
            shutil.copytree(
                ROOT / name, self.tests / name, ignore=shutil.ignore_patterns('__pycache__'))
        for name in ('README.md', 'conftest.py', 'pyproject.toml'):
            shutil.copy(ROOT / name, self.tests)
        # without the current directory, which may be that of the source
        self.variables = {**os.environ, **paths, 'PYTHONSAFEPATH': '1'}

    def run(self, *arguments: str) -> 'subprocess.CompletedProcess[str]':
        """Run the interpreter."""
        return children.run(
            [self.python, *arguments], capture_output=True, text=True, env=self.variables,
            cwd=self.python.parent)

    def run_tests(self, *files: str) -> Path:
        """Run tests of the library, with the installed package; return the results as XML."""
        results = self.tests / 'results.xml'
        variables = {**self.variables, 'PYTHONPATH': os.pathsep.join(
            [str(self.test_tools), self.variables['PYTHONPATH']])}
        variables.pop('CI', None)  # without the libraries to compare with, tests are skipped
        done = children.run(
            [self.python, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', '--junit-xml', results,
             *(f'test/{file}' for file in files)],
            capture_output=True, text=True, env=variables, cwd=self.tests, timeout=children.LONG)
        assert done.returncode == 0, done.stdout + done.stderr
        return results

    def importable(self, *names: str) -> list[str]:
        """Return which of these modules can be imported."""
        done = self.run('-c', IMPORTABLE, *names)
        assert done.returncode == 0, done.stderr
        found: list[str] = json.loads(done.stdout)
        return found


@pytest.fixture(scope='module')
def alone(tmp_path_factory: pytest.TempPathFactory) -> Environment:
    if 'ros-jazzy-rclpy' not in installed_distributions():
        pytest.skip('ROS is not installed from wheels, whose metadata name their files')
    return Environment(tmp_path_factory.mktemp('alone'))


def test_no_module_names_the_tools():
    """In an import, or as the text of one."""
    named = [path for folder in ('robot_dynamics', 'launch')
             for path in (ROOT / folder).rglob('*.py')
             if re.search(r'robot_dynamics_tools\.|import robot_dynamics_tools', path.read_text())]
    assert named == []


def test_the_environment_has_nothing_of_the_tools(alone):
    needed = ['numpy', 'pinocchio', 'rclpy', 'yaml', 'robot_dynamics_interfaces.srv']
    assert alone.importable(*needed, *OF_TOOLS) == needed


def test_every_module_is_imported(alone):
    """Except for those of launch files, which need launch."""
    names = ['.'.join(path.relative_to(ROOT).with_suffix('').parts)
             for path in (ROOT / 'robot_dynamics').rglob('*.py')
             if path.stem not in ('__init__', 'launch_actions')]
    assert set(names) - set(alone.importable(*names)) == set()
    done = alone.run('-c', 'import robot_dynamics as r; print(r.__file__, r.__version__, all('
                           'getattr(r, name) for name in r.__all__))')
    assert done.stdout.split()[1:] == [robot_dynamics.__version__, 'True'], done.stderr
    assert str(alone.python.parents[1]) in done.stdout


def test_the_tests_of_the_library_run(alone):
    """Those that compare with another library are skipped, and name it."""
    passed, reasons = set(), []
    for case in ElementTree.parse(alone.run_tests(*LIBRARY_TESTS)).iter('testcase'):
        skipped = case.find('skipped')
        if skipped is None:
            passed.add(case.attrib['classname'].split('.')[1])
        else:
            reasons.append(skipped.attrib['message'])
    assert passed == {path.parent.name for path in (ROOT / 'robot_dynamics').glob('*/__init__.py')
                      } - {'ros', 'tools'}
    assert [reason for reason in reasons if not any(name in reason for name in ABSENT)] == []


def test_both_nodes_close_the_loop(client, alone):
    nodes = [
        NodeProcess(DYNAMICS, UNHURRIED, environment=alone.variables, python=alone.python),
        NodeProcess(SIMULATED_ARM, {'initial_position': [0.5, 0.2]},
                    environment=alone.variables, python=alone.python)]
    with running(*nodes), receiving(client, '', 'effort_command', 'joint_states') as (
            efforts, states):
        effort = efforts.wait_for(lambda message: len(message.effort) == 2)
        state = states.wait_for(lambda message: any(message.effort))  # the brakes are released
        response = client.call(
            InverseDynamics, '/dynamics/inverse_dynamics',
            InverseDynamics.Request(position=[0.785398, 0.523599]))
    assert list(effort.name) == list(state.name) == ['joint1', 'joint2']
    assert response.success, response.message
    assert list(response.effort) == pytest.approx([-49.5228, -11.3709], abs=1e-3)


def test_the_tools_of_the_package_run(alone, tmp_path):
    file = tmp_path / 'arm.urdf'
    made = alone.run('-m', 'robot_dynamics.tools.planar_urdf', '-o', str(file))
    assert made.returncode == 0, made.stderr
    checked = alone.run(
        '-m', 'robot_dynamics.tools.check_model', str(file), '--report', str(tmp_path / 'a.html'))
    assert checked.returncode == 0, checked.stderr
    assert 'no errors' in checked.stdout
    assert '<h1>arm.urdf: model check</h1>' in (tmp_path / 'a.html').read_text(encoding='utf-8')
