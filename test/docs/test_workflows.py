# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The workflows for hosted CI contain the jobs and the commands that are documented."""

from pathlib import Path
import re
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
WORKFLOWS = sorted((ROOT / '.github' / 'workflows').glob('*.yml'))
BOTH_PATHS = 'src src/robot_dynamics/robot_dynamics_interfaces'
WORKFLOW_KEYS = {'name', 'on', 'permissions', 'jobs'}
JOB_KEYS = {
    'name', 'runs-on', 'container', 'timeout-minutes', 'defaults', 'strategy', 'env', 'steps'}
STEP_KEYS = {'name', 'uses', 'with', 'run', 'if', 'working-directory'}
ACTIONS = ('actions/checkout', 'actions/setup-python')


def read(path: Path) -> dict[str, Any]:
    """Return a workflow; BaseLoader keeps the key `on` and the version 3.10 as texts."""
    workflow: dict[str, Any] = yaml.load(path.read_text(encoding='utf-8'), yaml.BaseLoader)
    return workflow


def steps() -> list[dict[str, Any]]:
    return [step for path in WORKFLOWS for job in read(path)['jobs'].values()
            for step in job['steps']]


def commands_of(job: dict[str, Any]) -> list[str]:
    """Return the commands of a job, in their order."""
    return [line for step in job['steps'] for line in step.get('run', '').splitlines()]


@pytest.fixture(scope='module')
def jobs() -> dict[str, Any]:
    path, = WORKFLOWS
    found: dict[str, Any] = read(path)['jobs']
    assert list(found) == ['workspace', 'wheels']
    return found


@pytest.mark.parametrize('path', WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_has_the_structure_of_one(path: Path) -> None:
    workflow = read(path)
    assert set(workflow) == WORKFLOW_KEYS
    assert set(workflow['on']) == {'push', 'pull_request'}
    assert workflow['permissions'] == {'contents': 'read'}
    for job in workflow['jobs'].values():
        assert {'runs-on', 'steps', 'timeout-minutes'} <= set(job) <= JOB_KEYS
        assert job['runs-on'] == 'ubuntu-24.04'
        for step in job['steps']:
            assert set(step) <= STEP_KEYS
            assert ('run' in step) != ('uses' in step)


def test_only_two_actions_are_used_each_with_its_major_version() -> None:
    used = [step['uses'] for step in steps() if 'uses' in step]
    assert {action.partition('@')[0] for action in used} == set(ACTIONS)
    assert all(re.fullmatch(r'[\w/-]+@v\d+', action) for action in used)


def test_the_job_with_ros_runs_the_commands_of_a_workspace(jobs: dict[str, Any]) -> None:
    job = jobs['workspace']
    assert job['container'] == 'ros:jazzy'
    assert job['steps'][0]['with'] == {'path': 'src/robot_dynamics'}
    wanted = (
        rf'rosdep install --from-paths {BOTH_PATHS} .*-y',
        rf'colcon build --base-paths {BOTH_PATHS}',
        rf'colcon test --base-paths {BOTH_PATHS} --return-code-on-test-failure',
        r'colcon test-result --all --verbose')
    commands = commands_of(job)
    places = [
        [i for i, command in enumerate(commands) if re.fullmatch(pattern, command)]
        for pattern in wanted]
    assert all(len(found) == 1 for found in places), places
    assert places == sorted(places)
    assert job['steps'][-1]['if'] == 'always()'  # the results of failed tests are shown too


def test_every_package_is_on_the_paths_of_the_workspace() -> None:
    packages = {path.parent.relative_to(ROOT).as_posix() for path in ROOT.glob('*/package.xml')}
    assert packages == {'robot_dynamics_interfaces'}
    assert BOTH_PATHS.split() == ['src', f'src/robot_dynamics/{packages.pop()}']


def test_the_requirements_that_the_job_with_ros_installs_exist(jobs: dict[str, Any]) -> None:
    step, = (step for step in jobs['workspace']['steps'] if 'working-directory' in step)
    folder = ROOT / Path(step['working-directory']).relative_to('src/robot_dynamics')
    files = re.findall(r'-[cr] (\S+)', step['run'])
    assert {'apt.txt', 'python.txt', 'test.txt', 'viewer.txt'} == set(files)
    assert all((folder / file).is_file() for file in files)


def test_the_job_with_wheels_runs_the_tests_with_two_interpreters(jobs: dict[str, Any]) -> None:
    job = jobs['wheels']
    assert job['strategy']['matrix'] == {'python': ['3.10', '3.13']}
    assert commands_of(job) == ['scripts/test']
    assert job['env'] == {'ROBOT_DYNAMICS_PYTHON': 'python${{ matrix.python }}'}
    assert job['steps'][1]['with'] == {'python-version': '${{ matrix.python }}'}
    setup = (ROOT / 'scripts' / 'setup').read_text(encoding='utf-8')
    assert '${ROBOT_DYNAMICS_PYTHON:-' in setup


def test_the_readme_states_that_the_workflow_was_not_run() -> None:
    line, = (line for line in (ROOT / 'README.md').read_text(encoding='utf-8').splitlines()
             if '.github/workflows' in line)
    assert '**not run**' in line
