# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The table of faults in docs/evidence/fault_tests.md.

Each test that injects a fault has a mark with the fault and the expected reaction.
`scripts/test -m fault --write-fault-table` runs these tests and writes the page from the results.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

PAGE = Path(__file__).parents[2] / 'docs' / 'evidence' / 'fault_tests.md'
BEGIN, END = '<!-- faults: begin -->\n', '<!-- faults: end -->\n'
COLLECTED: pytest.StashKey[list['Row']] = pytest.StashKey()
"""The rows of all collected tests, also of those that a mark deselects."""
HEAD = '| injected | expected | seen |\n| --- | --- | --- |\n'


def fault(group: str, injected: str, expected: str) -> pytest.MarkDecorator:
    """Mark a test that injects a fault: section of the table, fault, expected reaction."""
    return pytest.mark.fault(group, injected, expected)


def fault_cases(
    names: str | tuple[str, ...], group: str, injected: str, expected: str,
    rows: Iterable[tuple[Any, ...]],
) -> pytest.MarkDecorator:
    """Parametrize a test over faults: the first entry of each row replaces `{}` in `injected`."""
    return pytest.mark.parametrize(names, [
        pytest.param(*values, id=words, marks=fault(group, injected.format(words), expected))
        for words, *values in rows])


@dataclass
class Row:
    """One row of the table; `seen` is the result of a test run."""

    group: str
    injected: str
    expected: str
    seen: str = ''


def row_of(item: pytest.Item) -> Row | None:
    """Return the row of a test, None if the test injects no fault."""
    mark = item.get_closest_marker('fault')
    return None if mark is None else Row(*mark.args)


def seen_words(report: pytest.TestReport) -> str | None:
    """Return the result of a finished test phase as text; None if the phase has no result."""
    figures = [str(value) for name, value in report.user_properties if name == 'seen']
    if report.failed:
        return '**failed**'
    if report.skipped:
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else ''
        return f'not run: {reason.removeprefix("Skipped: ")}'
    if report.when == 'call':
        return '; '.join(['as expected', *figures])
    return None


def table(rows: Sequence[Row]) -> str:
    """Return the table as Markdown, with one section per group."""
    parts = []
    for group in dict.fromkeys(row.group for row in rows):
        lines = ''.join(
            f'| {row.injected} | {row.expected} | {row.seen} |\n'
            for row in rows if row.group == group)
        parts.append(f'### {group}\n\n{HEAD}{lines}')
    return '\n'.join(parts)


def write_page(rows: Sequence[Row]) -> None:
    """Write the table to the page."""
    text = PAGE.read_text(encoding='utf-8')
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    PAGE.write_text(f'{before}{BEGIN}\n{table(rows)}\n{END}{after}', encoding='utf-8')


def rows_of_page() -> list[Row]:
    """Return the rows of the page."""
    rows, group = [], ''
    text = PAGE.read_text(encoding='utf-8').split(BEGIN)[1].split(END)[0]
    for line in text.splitlines():
        if line.startswith('### '):
            group = line.removeprefix('### ')
        elif line.startswith('| ') and f'{line}\n' not in HEAD:
            cells = line.removeprefix('| ').removesuffix(' |').split(' | ')
            rows.append(Row(group, *cells))
    return rows
