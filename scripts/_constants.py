# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Mutants of the constants of modules and classes, which mutmut does not make.

Usage: _constants.py DIRECTORY
Each number is doubled and halved. DIRECTORY is that in which mutmut ran, whose statistics contain
the tests that reach each module. Writes constants.json there: the exit code of pytest by mutant,
by module.
"""

import ast
from collections.abc import Iterator
import json
import os
from pathlib import Path
import subprocess
import sys

TIMEOUT = 600.0
"""[s] for the tests of one mutant; a mutant whose tests take longer survives."""
CHANGES = ('2 * ({})', '0.5 * ({})')
CHANGES_OF_INTEGERS = ('2 * ({}) + ({} == 0)', '({}) // 2 - ({} == 0)')


def number(node: ast.expr | None) -> float | None:
    """Return the value of an expression of numbers, None for others."""
    try:
        value = eval(compile(ast.Expression(node), '', 'eval'), {'__builtins__': {}}, {})
    except Exception:
        return None
    return value if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def mutants(source: str) -> Iterator[tuple[str, str]]:
    """Yield a label and the mutated source for each change of a constant."""
    tree = ast.parse(source)
    for scope in (tree, *(node for node in tree.body if isinstance(node, ast.ClassDef))):
        for node in scope.body:
            names = getattr(node, 'targets', [getattr(node, 'target', None)])
            value = number(getattr(node, 'value', None))
            if value is None or not all(
                    isinstance(name, ast.Name) and name.id.isupper() for name in names):
                continue
            old = ast.get_source_segment(source, node.value)
            for change in CHANGES_OF_INTEGERS if isinstance(value, int) else CHANGES:
                lines = source.splitlines(keepends=True)
                first, last = node.value.lineno - 1, node.value.end_lineno - 1
                head = lines[first].encode()[:node.value.col_offset].decode()
                tail = lines[last].encode()[node.value.end_col_offset:].decode()
                new = change.format(old, old)
                lines[first:last + 1] = [f'{head}{new}{tail}']
                yield f'{names[0].id} = {new}', ''.join(lines)


def tests_of(module: str, statistics: dict[str, dict[str, object]]) -> list[str]:
    """Return the tests that reach a function of a module, the quick ones first."""
    tests = {
        test for name, found in statistics['tests_by_mangled_function_name'].items()
        if name.rpartition('.')[0] == module for test in found}
    return sorted(tests, key=lambda test: statistics['duration_by_test'].get(test, 0.0))


def main(directory: Path) -> None:
    """Run the tests of each mutant until one fails."""
    work = directory / 'mutants'
    statistics = json.loads((work / 'mutmut-stats.json').read_text(encoding='utf-8'))
    results = {}
    for meta in sorted(work.rglob('*.py.meta')):
        file = meta.with_suffix('')
        module = '.'.join(file.relative_to(work).with_suffix('').parts)
        source, tests = file.read_text(encoding='utf-8'), tests_of(module, statistics)
        if not tests:
            continue
        results[file.stem] = {}
        for label, changed in mutants(source):
            file.write_text(changed, encoding='utf-8')
            try:
                results[file.stem][label] = subprocess.run(
                    [sys.executable, '-m', 'pytest', '-x', '-q', '-p', 'no:cacheprovider', *tests],
                    cwd=work, env={**os.environ, 'MUTANT_UNDER_TEST': ''}, timeout=TIMEOUT,
                    stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode
            except subprocess.TimeoutExpired:
                results[file.stem][label] = -1
            finally:
                file.write_text(source, encoding='utf-8')
            print(f'{file.stem}: {label}: {results[file.stem][label]}', flush=True)
    (directory / 'constants.json').write_text(json.dumps(results, indent=1), encoding='utf-8')


if __name__ == '__main__':
    main(Path(sys.argv[1]))
