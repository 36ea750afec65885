# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Scripts reject arguments that they do not know, before they do anything."""

from pathlib import Path

import children
import pytest

SCRIPTS = Path(__file__).parents[2] / 'scripts'


@pytest.mark.parametrize(('script', 'argument'), [
    ('mutate', '--help'), ('mutate', '--simple'), ('mutate', 'supervisors'), ('setup', 'tests')])
def test_an_unknown_argument_ends_a_script(script, argument):
    ended = children.run([str(SCRIPTS / script), argument], capture_output=True, text=True)
    assert ended.returncode == 1
    assert argument in ended.stderr
    assert 'expected' in ended.stderr
