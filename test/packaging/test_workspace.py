# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The commands of ROS tools that docs/installation.md documents, in a new workspace."""

import re
import shlex
import subprocess

import pytest
from workspace import documented, PACKAGES, Workspace

pytest.importorskip('colcon_core', reason='colcon is not installed')



@pytest.fixture(scope='module')
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """
    Return a workspace in which the packages are built with the documented command.

    The build takes a minute; the test of it is a long run (mark `soak`).
    """
    made = Workspace(tmp_path_factory.mktemp('workspace'))
    built = made.run(documented('colcon build'))
    assert built.returncode == 0, built.stdout
    return made


@pytest.mark.soak
def test_the_build_has_all_packages_in_the_version_of_the_manifest(workspace):
    for name in PACKAGES:
        assert (workspace.directory / 'install' / name / 'share' / name / 'package.xml').exists()
    program = 'import robot_dynamics as r; print(r.__file__, r.__version__)'
    installed, = (workspace.directory / 'install' / 'robot_dynamics').glob('lib/*/site-packages')
    shown = workspace.run('python -c', program, PYTHONPATH=str(installed)).stdout.split()
    assert shown[0].startswith(str(installed))
    manifest = (workspace.source / 'package.xml').read_text(encoding='utf-8')
    assert shown[1:] == re.findall('<version>(.+)</', manifest)


def test_a_build_without_the_interfaces_stops_with_the_command(tmp_path):
    """With links to the nested packages, a workspace needs no paths."""
    plain = Workspace(tmp_path)
    built = plain.run('colcon build')
    assert built.returncode != 0, built.stdout
    command, = re.findall('robot_dynamics needs the package .* Run: (.*)', built.stdout)
    start, paths = command.split(' --base-paths ')
    assert start == 'colcon build'
    listed = plain.run('colcon list --names-only --base-paths', *paths.split())
    assert listed.stdout.split()[-3:] == list(PACKAGES)
    assert [(tmp_path / path).resolve() for path in documented(start).split()[3:]] == [
        (tmp_path / path).resolve() for path in paths.split()]
    subprocess.run(shlex.split(documented('ln -s')), cwd=tmp_path, check=True)
    assert plain.run('colcon list --names-only').stdout.split()[-3:] == list(PACKAGES)
