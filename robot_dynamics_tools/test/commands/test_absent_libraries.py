# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Tools name the library that is missing before they start a node."""

import os
import sys

from absent_libraries import environment_without
import children
import pytest


@pytest.mark.parametrize('name', ['demo', 'viewer'])
def test_a_tool_says_what_is_missing_before_it_starts_a_node(tmp_path, name):
    library = {'demo': 'rosbags', 'viewer': 'viser'}[name]
    (site := tmp_path / 'site').mkdir()
    (place := tmp_path / 'here').mkdir()
    done = children.run(
        [sys.executable, '-m', f'robot_dynamics_tools.{name}'], capture_output=True, text=True,
        cwd=place, env={**os.environ, **environment_without(site, [library])})
    assert done.returncode in (1, 2)
    assert done.stdout == ''
    line, = done.stderr.splitlines()
    assert line.startswith(f'{name}: ')
    assert f'needs the library {library}, which cannot be imported. Install it: ' in line
    assert f' -m pip install {library}' in line or f'--break-system-packages {library}' in line
    assert not list(place.iterdir())  # no log of a node, no recording
