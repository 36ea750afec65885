# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The workflow of hosted CI fits the repository; the set-up adapts CMake files of wheels."""

import os
from pathlib import Path
import re
import sys
import sysconfig

import children
import numpy as np
import yaml

ROOT = Path(__file__).resolve().parents[2]
BOTH_PATHS = 'src src/robot_dynamics/robot_dynamics_interfaces'
HERE = (sysconfig.get_paths()['include'], np.get_include())


def export(python: str, numpy: str) -> str:
    return (
        'set_target_properties(a PROPERTIES\n'
        f'  INTERFACE_INCLUDE_DIRECTORIES "{python};{numpy};${{_IMPORT_PREFIX}}/include/python3"\n'
        ')\n')


def relocate(environment: Path) -> None:
    script = ROOT / 'scripts' / '_relocate_cmake.py'
    children.run([sys.executable, str(script), str(environment)], check=True)


def test_a_file_that_other_environments_share_is_replaced_and_not_changed(tmp_path):
    python = '/opt/python/cp312-cp312/include/python3.12'
    numpy = '/srv/other/.venv/lib/python3.11/site-packages/numpy/_core/include'
    cached, linked = tmp_path / 'cached.cmake', tmp_path / 'venv' / 'share' / 'a' / 'a.cmake'
    linked.parent.mkdir(parents=True)
    cached.write_text(export(python, numpy), encoding='utf-8')
    os.link(cached, linked)
    relocate(tmp_path / 'venv')
    assert linked.read_text(encoding='utf-8') == export(*HERE)
    assert cached.read_text(encoding='utf-8') == export(python, numpy)
    inode = linked.stat().st_ino
    relocate(tmp_path / 'venv')
    assert linked.stat().st_ino == inode


def test_actions_paths_and_requirements():
    """BaseLoader keeps the key `on` and the version 3.10 as texts."""
    path, = (ROOT / '.github' / 'workflows').glob('*.yml')
    jobs = yaml.load(path.read_text(encoding='utf-8'), yaml.BaseLoader)['jobs']
    used = [step['uses'] for job in jobs.values() for step in job['steps'] if 'uses' in step]
    assert all(re.fullmatch(r'actions/(checkout|setup-python)@v\d+', action) for action in used)
    package, = (path.parent.relative_to(ROOT) for path in ROOT.glob('*/package.xml'))
    assert BOTH_PATHS.split() == ['src', f'src/robot_dynamics/{package.as_posix()}']
    commands = '\n'.join(step.get('run', '') for step in jobs['workspace']['steps'])
    for command in ('rosdep install --from-paths', 'colcon build --base-paths',
                    'colcon test --base-paths'):
        assert commands.count(f'{command} {BOTH_PATHS}') == 1
    step, = (step for step in jobs['workspace']['steps'] if 'working-directory' in step)
    folder = ROOT / Path(step['working-directory']).relative_to('src/robot_dynamics')
    files = re.findall(r'-[cr] (\S+)', step['run'])
    assert {'apt.txt', 'python.txt', 'test.txt', 'viewer.txt'} == set(files)
    assert all((folder / file).is_file() for file in files)
    readme = (ROOT / 'README.md').read_text(encoding='utf-8')
    assert re.search(r'\.github/workflows.*\*\*not run\*\*|\*\*not run\*\*.*\.github/w', readme)
