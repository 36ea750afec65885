# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The table of docs/evidence/fault_tests.md has every fault test of both packages."""

from itertools import chain
import json
from pathlib import Path
import re
import sys

import children
import fault_table
from fault_table import rows_of_page
import pytest

ROOT = Path(__file__).parents[3]
TESTS = ROOT / 'test', ROOT / 'robot_dynamics_tools' / 'test'


@pytest.fixture(scope='module')
def collected(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory,
) -> list[tuple[str, str, str]]:
    """Return group, injected and expected of each fault test of the suite."""
    if {Path(argument).resolve() for argument in request.config.args} == set(TESTS):
        return [(row.group, row.injected, row.expected)
                for row in request.config.stash[fault_table.COLLECTED]]
    file = tmp_path_factory.mktemp('faults') / 'faults.json'
    result = children.run(
        [sys.executable, '-m', 'pytest', '--collect-only', '-q', '-p', 'no:cacheprovider',
         '-m', 'fault', '--list-faults', str(file), *(
             str(path) for tests in TESTS for path in tests.rglob('test_*.py')
             if re.search(r'\bfault\(', path.read_text(encoding='utf-8')))],
        cwd=ROOT, capture_output=True, text=True, timeout=300.0)
    assert result.returncode == 0, result.stdout + result.stderr
    return [tuple(row) for row in json.loads(file.read_text(encoding='utf-8'))]


def test_the_table_has_every_fault_of_the_suite_and_no_other(collected):
    listed = [(row.group, row.injected, row.expected) for row in rows_of_page()]
    assert listed, 'the table is empty: scripts/test -m fault --write-fault-table writes it'
    assert sorted(listed) == sorted(collected)
    for cell in chain(*collected):
        assert re.fullmatch(r'(?=\S)[^|\n]*\S', cell), f'not for a table: {cell!r}'
