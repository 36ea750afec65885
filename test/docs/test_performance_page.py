# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""docs/evidence/benchmarks.md has the output of each benchmark, docs/performance.md figures."""

import importlib
from pathlib import Path
import re

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / 'docs' / 'evidence' / 'benchmarks.md').read_text(encoding='utf-8')
GUIDE = (ROOT / 'docs' / 'performance.md').read_text(encoding='utf-8')
CONDITIONS = re.compile(r'\b(?:7 joints|10,000 samples|p99|100 calls per second)')


def printed(name: str) -> str:
    found = re.search(rf'^<!-- {name} -->\n(.*?)^<!-- end -->$', PAGE, re.MULTILINE | re.DOTALL)
    assert found is not None, name
    return found[1]


def test_each_benchmark_has_its_figures(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT))
    catalogue = importlib.import_module('benchmarks.catalogue')
    names = [*catalogue.BENCHMARKS, *catalogue.LONG_BENCHMARKS]
    marks = re.findall(r'^<!-- (\w+) -->$', PAGE, re.MULTILINE)
    assert sorted(set(marks) - {'end'}) == sorted(names)
    for name in names:
        assert re.match(r'```text\n# \d{4}-\d\d-\d\d, .*CPython 3.*\n.+\n', printed(name)), name


def rows_of_the_guide() -> list[tuple[str, str]]:
    """Return the result and the benchmark of each row of the table of docs/performance.md."""
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


def test_the_guide_names_each_faster_engine():
    faster = re.findall(r'^Faster than robot_dynamics: (\S+)', printed('peers'), re.MULTILINE)
    result, = (result for result, benchmark in rows_of_the_guide() if benchmark == 'peers')
    assert faster
    for engine in faster:
        assert engine in result
