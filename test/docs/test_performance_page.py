# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""docs/performance.md has a place for each benchmark, with its output."""

import importlib
from pathlib import Path
import re

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / 'docs' / 'performance.md').read_text(encoding='utf-8')


def printed(name: str) -> str:
    found = re.search(rf'^<!-- {name} -->\n(.*?)^<!-- end -->$', PAGE, re.MULTILINE | re.DOTALL)
    assert found is not None, name
    return found[1]


def test_each_benchmark_has_its_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT))
    catalogue = importlib.import_module('benchmarks.catalogue')
    names = [*catalogue.BENCHMARKS, *catalogue.LONG_BENCHMARKS]
    marks = re.findall(r'^<!-- (\w+) -->$', PAGE, re.MULTILINE)
    assert sorted(set(marks) - {'end'}) == sorted(names)
    for name in names:
        assert re.match(r'```text\n# \d{4}-\d\d-\d\d, .*CPython 3.*\n.+\n', printed(name)), name
