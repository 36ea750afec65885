# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters on docs/safety.md and the pages it leads to; docs/evidence/fault_tests.md."""

from collections.abc import Iterator
from pathlib import Path
import re

from fault_table import rows_of_page
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.ros.dynamics.parameters import SAFETY_SPECS, SPECS

DOCS = Path(__file__).parents[2] / 'docs'
PAGES = 'safety.md', 'command.md', 'control_laws.md', 'effort_semantics.md'
TEXT = ''.join((DOCS / name).read_text(encoding='utf-8') for name in PAGES)


def tables() -> Iterator[list[dict[str, str]]]:
    """Yield each table of the page as rows of cells by heading."""
    for block in re.findall(r'(?:^\|.*\n)+', TEXT, re.MULTILINE):
        lines = [[cell.strip() for cell in line.strip('|').split('|')]
                 for line in block.splitlines()]
        yield [dict(zip(lines[0], cells)) for cells in lines[2:]]


# --- the faults ----------------------------------------------------------------------------------


def test_every_row_has_a_result_none_failed_and_the_readme_states_their_number():
    rows, readme = rows_of_page(), (DOCS.parent / 'README.md').read_text(encoding='utf-8')
    assert not [row for row in rows if '**failed**' in row.seen or not row.seen]
    assert f'each of {len(rows)} injected faults' in ' '.join(readme.split())


# --- the figures ---------------------------------------------------------------------------------

def test_every_default_that_is_quoted_is_that_of_the_node():
    defaults = {spec.name: spec.default for spec in SPECS}
    quoted = [  # `[]` for a default without a literal
        (row['parameter'].strip('`'), [*re.findall('`([^`]*)`', row['default']), '[]'][0])
        for table in tables() for row in table if row.get('parameter') and 'default' in row]
    assert len(quoted) >= 6
    for name, default in quoted:
        value = defaults[name]
        assert default == (str(value).lower() if isinstance(value, bool) else str(value)), name


def test_every_parameter_of_safety_is_explained():
    for spec in SAFETY_SPECS:
        assert f'`{spec.name}' in TEXT, spec.name
        for choice in spec.choices:
            assert f'`{choice}`' in TEXT or f'`{spec.name}: {choice}`' in TEXT, choice
    assert [mode.value for mode in Mode if mode.value not in TEXT] == []


def test_each_message_that_troubleshooting_quotes_is_in_the_code():
    code = ''.join(file.read_text(encoding='utf-8') for file in (
        DOCS.parent / 'setup.py', *(DOCS.parent / 'robot_dynamics').rglob('*.py'),
        *(DOCS.parent / 'robot_dynamics_tools' / 'robot_dynamics_tools').rglob('*.py')))
    page = (DOCS / 'troubleshooting.md').read_text(encoding='utf-8')
    cells = [line.split(' | ')[0] for line in page.splitlines() if line.startswith('| ')]
    quoted = {text for cell in cells for text in re.findall('`([^`]+)`', cell)}
    assert len(quoted) > 13
    assert not {text for text in quoted if text not in code}
