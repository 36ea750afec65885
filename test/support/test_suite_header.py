# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The header of a test run, as a process prints it."""

import subprocess
import sys

import pytest
from suite_header import DURATION, missing_tools, Tool

FILE = 'test/support/test_suite_header.py'


def run_of(*arguments, root):
    """Return what pytest prints into a pipe."""
    result = subprocess.run(
        [sys.executable, '-m', 'pytest', '-p', 'no:cacheprovider', *map(str, arguments)],
        cwd=root, capture_output=True, text=True, timeout=120.0)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


@pytest.mark.parametrize(('arguments', 'says_duration'), [
    (['-o', f'testpaths={FILE}'], True),
    (['-o', f'testpaths={FILE}', '-m', 'not fault'], False),
    ([FILE], False),
])
def test_only_the_default_run_says_how_long_it_takes(arguments, says_duration, pytestconfig):
    out = run_of('--collect-only', *arguments, root=pytestconfig.rootpath)
    assert (DURATION in out) == says_duration
    assert ('left out by mark: soak: ' in out) == ('-m' not in arguments)


def test_a_missing_tool_is_named_with_the_files_that_need_it():
    sources = {  # formatted, so that the header does not find these names in this file
        'test_a.py': 'numpy = pytest.importorskip({!r})'.format('numpy'),
        'test_b.py': 'x = pytest.importorskip({!r}, reason="")'.format('no_such_module.part'),
        'test_c.py': 'has_it = find_spec({!r})'.format('no_such_module')}
    tools = (Tool('hammer', lambda: False, 'numpy'), Tool('nail', lambda: True, 'numpy'))
    assert list(missing_tools(sources, tools)) == [
        'missing: hammer; tests in test_a.py that need it are skipped',
        'missing: no_such_module; tests in test_b.py, test_c.py that need it are skipped']
