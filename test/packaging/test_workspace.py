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

"""The commands of ROS tools that the README documents, in a new workspace."""

from pathlib import Path
import re
import subprocess
import sys

import pytest
from workspace import PACKAGES, Workspace

ROOT = Path(__file__).resolve().parents[2]
pytest.importorskip('colcon_core', reason='colcon is not installed')

SELECTION = 'test/planar'
"""Tests that need no ROS and take a few seconds."""
FAILING = """
import pytest


def test_passes():
    pass


def test_fails():
    assert 1 == 2


@pytest.mark.skip(reason='to be counted')
def test_is_skipped():
    pass
"""


def documented(start: str) -> str:
    """Return the one command of README.md that starts so."""
    lines = (ROOT / 'README.md').read_text(encoding='utf-8').splitlines()
    command, = {line for line in lines if line.startswith(f'{start} ')}
    return command


@pytest.fixture(scope='module')
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Return a workspace in which both packages are built with the command of the README."""
    made = Workspace(tmp_path_factory.mktemp('workspace'))
    built = made.run(documented('colcon build'))
    assert built.returncode == 0, built.stdout
    return made


def run_tests(workspace: Workspace, selection: str) -> 'subprocess.CompletedProcess[str]':
    """Run `colcon test` as documented, with some tests only; return its result."""
    return workspace.run(
        documented('colcon test'), '--return-code-on-test-failure', '--pytest-args', selection)


def test_the_build_has_both_packages(workspace: Workspace) -> None:
    for name in PACKAGES:
        assert (workspace.directory / 'install' / name / 'share' / name / 'package.xml').exists()


def test_colcon_test_runs_the_tests_that_pytest_runs(workspace: Workspace) -> None:
    tested = run_tests(workspace, SELECTION)
    assert tested.returncode == 0, tested.stdout
    result = workspace.run(documented('colcon test-result'))
    assert result.returncode == 0, result.stdout
    passed = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', SELECTION], cwd=workspace.source,
        capture_output=True, text=True, check=True).stdout
    count = int(re.findall(r'^(\d+) passed', passed, re.MULTILINE)[0])
    assert count > 0
    assert f'Summary: {count} tests, 0 errors, 0 failures, 0 skipped' in result.stdout


def test_a_failing_test_fails_colcon_test(workspace: Workspace) -> None:
    (workspace.source / 'test' / 'test_that_fails.py').write_text(FAILING, encoding='utf-8')
    tested = run_tests(workspace, 'test/test_that_fails.py')
    assert tested.returncode != 0, tested.stdout
    result = workspace.run(documented('colcon test-result'))
    assert result.returncode != 0, result.stdout
    assert 'Summary: 3 tests, 0 errors, 1 failure, 1 skipped' in result.stdout
