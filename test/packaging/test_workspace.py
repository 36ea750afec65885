# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The commands of ROS tools that docs/installation.md documents, in a new workspace."""

import re
import shlex
import subprocess

import pytest
from workspace import documented, PACKAGES, Workspace

pytest.importorskip('colcon_core', reason='colcon is not installed')


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
