# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""docs/architecture.md names what exists, performance.md has figures of benchmarks.md."""

import importlib
from pathlib import Path
import re

import pytest
import robot_dynamics

PACKAGE = Path(robot_dynamics.__file__).parent
TEXT = (PACKAGE.parent / 'docs' / 'architecture.md').read_text(encoding='utf-8')
DOCS = PACKAGE.parent / 'docs'
PAGE = (DOCS / 'evidence' / 'benchmarks.md').read_text(encoding='utf-8')
GUIDE = (DOCS / 'evidence' / 'performance.md').read_text(encoding='utf-8')
CONDITIONS = re.compile(r'\b(?:7 joints|10,000 samples|p99|100 calls per second)')
THREAD = re.compile(r"name=f?'([^']+)'")


def rows(heading: str) -> list[str]:
    """Return the first cells of the table below a row of headings."""
    table = TEXT.partition(f'| {heading} |')[2].partition('\n\n')[0]
    return [line.split('|')[1].strip(' `') for line in table.splitlines()[2:]]


def test_every_folder_stands_in_the_table_in_the_order_of_the_layers():
    folders = rows('folder')
    assert sorted(folders) == sorted(path.parent.name for path in PACKAGE.glob('*/__init__.py'))
    project = (PACKAGE.parent / 'pyproject.toml').read_text(encoding='utf-8')
    layers = re.findall(r'^    "([\w : ]+)",$', project.partition('layers = [')[2].partition(
        ']')[0], re.MULTILINE)
    rank = {name: i for i, layer in enumerate(layers) for name in layer.split(' : ')}
    assert [rank[name] for name in folders] == sorted(rank[name] for name in folders)


def test_every_thread_stands_in_the_table():
    found = set()
    for path in (PACKAGE / 'ros').rglob('*.py'):
        text = path.read_text(encoding='utf-8')
        for call in re.findall(r'threading\.Thread\((.*?)daemon', text, re.DOTALL):
            found |= set(THREAD.findall(call))
    names = {name.replace('{topic}', 'joint_states').replace('{name}', '~/stop') for name in found}
    assert names == set(rows('thread')) - {'main'}


# --- performance ---------------------------------------------------------------------------------

def printed(name: str) -> str:
    found = re.search(rf'^<!-- {name} -->\n(.*?)^<!-- end -->$', PAGE, re.MULTILINE | re.DOTALL)
    assert found is not None, name
    return found[1]


def test_each_benchmark_has_its_figures(monkeypatch):
    monkeypatch.syspath_prepend(str(PACKAGE.parent))
    catalogue = importlib.import_module('benchmarks.catalogue')
    names = [*catalogue.BENCHMARKS, *catalogue.LONG_BENCHMARKS]
    marks = re.findall(r'^<!-- (\w+) -->$', PAGE, re.MULTILINE)
    assert sorted(set(marks) - {'end'}) == sorted(names)
    for name in names:
        assert re.match(r'```text\n# \d{4}-\d\d-\d\d, .*CPython 3.*\n.+\n', printed(name)), name


def rows_of_the_guide() -> list[tuple[str, str]]:
    """Return the result and the benchmark of each row of the table of performance.md."""
    cells = [[cell.strip() for cell in line.strip('|').split('|')]
             for line in GUIDE.splitlines() if line.startswith('|')][2:]
    return [(result, benchmark.strip('`')) for _, result, benchmark in cells]


def numbers_in(text: str) -> set[float]:
    return {float(number) for number in re.findall(r'(?<![\w.])\d+(?:\.\d+)?', text)}


@pytest.mark.parametrize(('result', 'benchmark'), rows_of_the_guide())
def test_the_figures_of_the_guide_are_those_of_the_benchmark(result, benchmark):
    figures = numbers_in(CONDITIONS.sub('', result))
    assert figures
    assert figures <= numbers_in(printed(benchmark))
