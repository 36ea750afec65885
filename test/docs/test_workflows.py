# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The workflow for hosted CI fits the repository: paths of the packages, files, actions."""

from pathlib import Path
import re

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
BOTH_PATHS = 'src src/robot_dynamics/robot_dynamics_interfaces'


@pytest.fixture(scope='module')
def jobs():
    """Return the jobs; BaseLoader keeps the key `on` and the version 3.10 as texts."""
    path, = (ROOT / '.github' / 'workflows').glob('*.yml')
    return yaml.load(path.read_text(encoding='utf-8'), yaml.BaseLoader)['jobs']


def test_only_two_actions_are_used_each_with_its_major_version(jobs):
    used = [step['uses'] for job in jobs.values() for step in job['steps'] if 'uses' in step]
    assert {action.partition('@')[0] for action in used} == {
        'actions/checkout', 'actions/setup-python'}
    assert all(re.fullmatch(r'[\w/-]+@v\d+', action) for action in used)


def test_every_package_is_on_the_paths_of_each_command_of_the_workspace(jobs):
    package, = (path.parent.relative_to(ROOT) for path in ROOT.glob('*/package.xml'))
    assert BOTH_PATHS.split() == ['src', f'src/robot_dynamics/{package.as_posix()}']
    commands = '\n'.join(step.get('run', '') for step in jobs['workspace']['steps'])
    for command in ('rosdep install --from-paths', 'colcon build --base-paths',
                    'colcon test --base-paths'):
        assert commands.count(f'{command} {BOTH_PATHS}') == 1


def test_the_requirements_that_the_job_with_ros_installs_exist(jobs):
    step, = (step for step in jobs['workspace']['steps'] if 'working-directory' in step)
    folder = ROOT / Path(step['working-directory']).relative_to('src/robot_dynamics')
    files = re.findall(r'-[cr] (\S+)', step['run'])
    assert {'apt.txt', 'python.txt', 'test.txt', 'viewer.txt'} == set(files)
    assert all((folder / file).is_file() for file in files)


def test_the_readme_states_that_the_workflow_was_not_run():
    line, = (line for line in (ROOT / 'README.md').read_text(encoding='utf-8').splitlines()
             if '.github/workflows' in line)
    assert '**not run**' in line
