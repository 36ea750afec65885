# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Print the results of mutmut and `_constants.py` per module; write the survivors as changed lines.

Usage: _mutants.py DIRECTORY [--write] [--sample] [MODULE...]
DIRECTORY is that in which mutmut ran. A mutant that no test reaches counts as a survivor, and one
whose tests timed out too: on a loaded machine, it may be equivalent.
With --write the rows replace those of the same modules in docs/evidence/mutation.md.
"""

import ast
from collections.abc import Iterator
from datetime import date
import difflib
import json
from pathlib import Path
import sys

KILLED = (1, 3)
"""Exit codes of pytest: a test failed, or pytest itself."""
TIMEOUTS = (-24, 24, 36, 152, 255)
NO_TESTS = 33
PAGE = Path(__file__).parents[1] / 'docs' / 'evidence' / 'mutation.md'
HEAD = ('| module | mutants | killed | survived | killed [%] | time [s] | measured |\n'
        '| --- | --- | --- | --- | --- | --- | --- |\n')
BEGIN, END = '<!-- table: begin -->\n\n', '\n<!-- table: end -->\n'


def survivors(code: str, results: dict[str, int]) -> Iterator[str]:
    """Yield the changed lines of each survivor; `code` contains all mutants of a module."""
    lines = code.splitlines()
    bodies = {
        node.name: lines[node.lineno:node.end_lineno]
        for node in ast.walk(ast.parse(code)) if isinstance(node, ast.FunctionDef)}
    for mutant, result in results.items():
        if result in KILLED:
            continue
        name = mutant.rpartition('.')[2]
        function, _, number = name.partition('__mutmut_')
        changes = difflib.unified_diff(
            bodies[f'{function}__mutmut_orig'], bodies[name], n=0, lineterm='')
        note = ', which no test reaches' if result == NO_TESTS else (
            ', whose tests timed out' if result in TIMEOUTS else '')
        title = function.lstrip('x').strip('ǁ_').replace('ǁ', '.')
        yield '\n'.join([
            f'{title} {number}{note}',
            *(line for line in changes if not line.startswith(('---', '+++', '@@')))])


def with_rows(text: str, rows: dict[str, str]) -> str:
    """Return the text of the page with these rows, by module, in place of the present ones."""
    before, rest = text.split(BEGIN)
    table, after = rest.split(END)
    there = {line.split(' | ')[0].strip('| '): f'{line}\n' for line in table.splitlines()[2:]}
    return f'{before}{BEGIN}{HEAD}{"".join({**there, **rows}.values())}{END}{after}'


def _count(results: dict[str, int | None], constants: int) -> str:
    """Return how many mutants were run, and of how many if it was a sample."""
    run = constants + sum(result is not None for result in results.values())
    total = constants + len(results)
    return str(total) if run == total else f'{run} of {total}'


def main(directory: Path, modules: list[str], is_written: bool) -> None:
    """Print one line per module."""
    report, file = directory / 'survivors.txt', directory / 'constants.json'
    constants = json.loads(file.read_text(encoding='utf-8')) if file.exists() else {}
    texts, rows = [], {}
    print(HEAD, end='')
    for meta in sorted((directory / 'mutants').rglob('*.py.meta')):
        source = meta.with_suffix('')
        data = json.loads(meta.read_text(encoding='utf-8'))
        results = {
            name: result for name, result in data['exit_code_by_key'].items()
            if result is not None}
        if not results or modules and source.stem not in modules:
            continue
        found = list(survivors(source.read_text(encoding='utf-8'), results))
        numbers = constants.get(source.stem, {})
        found += [label for label, result in numbers.items() if result not in KILLED]
        killed = len(results) + len(numbers) - len(found)
        seconds = sum(data['durations_by_key'].values())
        rows[source.stem] = (
            f'| {source.stem} | {_count(data["exit_code_by_key"], len(numbers))} | {killed} | '
            f'{len(found)} | {100.0 * killed / (killed + len(found)):.1f} | {seconds:.0f} | '
            f'{date.today()} |\n')
        print(rows[source.stem], end='')
        texts += [f'== {source.stem}', *found]
    report.write_text('\n\n'.join([*texts, '']), encoding='utf-8')
    print(f'Survivors: {report}')
    if is_written:
        PAGE.write_text(with_rows(PAGE.read_text(encoding='utf-8'), rows), encoding='utf-8')


if __name__ == '__main__':
    main(Path(sys.argv[1]), [name for name in sys.argv[2:] if not name.startswith('--')],
         '--write' in sys.argv)
