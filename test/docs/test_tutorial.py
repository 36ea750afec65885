# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""docs/tutorial.md from top to bottom: its files, its commands, and the expected results."""

from pathlib import Path
import re

from page_commands import files_and_commands, printed_by, run_page

PAGE = Path(__file__).parents[2] / 'docs' / 'tutorial.md'
DATA_SHEET_LEAVES = (4.1, 1.8)
"""[N·m] that the last program of the page prints where the node has the data sheet for a model."""


def relative_residuals(out: str) -> list[float]:
    """Return the column `relative` of the output of analyze_bag [%]."""
    return [float(fraction) for fraction in re.findall(
        r'^joint\d +\S+ N·m +\S+ N·m +(\S+) %', out, re.MULTILINE)]


def table_headings(text: str) -> set[str]:
    """Return the heading of each table, with single spaces."""
    return {' '.join(line.split()) for line in re.findall(r'^joint .*', text, re.MULTILINE)}


def test_the_tutorial(tmp_path):
    page = PAGE.read_text(encoding='utf-8')
    printed = run_page(page, tmp_path)
    assert table_headings(page) <= table_headings('\n'.join(out for _, out in printed))
    used = {command[3] for command in files_and_commands(page)[1] if command[0] == 'ros2'}
    assert used >= {'excite', 'demo', 'analyze_bag', 'identify', 'dynamics_node', 'simulated_arm'}
    analyze = 'ros2 run robot_dynamics analyze_bag '
    before = relative_residuals(printed_by(printed, analyze, '--output before'))
    after = relative_residuals(printed_by(printed, analyze, '--no-report'))
    assert len(before) == len(after) == 2
    assert min(before) > 15.0
    for left, there_was in zip(after, before):
        assert left < 0.4 * there_was
    live = printed_by(printed, 'python watch_residual.py')
    numbers = [float(number) for number in re.findall(r'\d+\.\d*', live)]
    assert len(numbers) == 2
    for left, with_data_sheet in zip(numbers, DATA_SHEET_LEAVES):
        assert left < 0.4 * with_data_sheet


def test_files_that_the_tutorial_names_are_there_when_it_names_them():
    """The input of each command is on the page, or was written by an earlier command."""
    files, commands = files_and_commands(PAGE.read_text(encoding='utf-8'))
    known = set(files)
    for command in commands:
        for option, value in zip(command, command[1:]):
            if option in ('--output', '--out'):
                known.add(value)
        for word in command[1:]:
            name = word.rpartition(':=')[2]
            if re.fullmatch(r'[\w/]+\.(urdf|yaml|py)', name):
                assert name in known or name.split('/')[0] in known, f'{name} in {command}'
