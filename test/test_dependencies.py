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

"""The libraries that the package can do without: each is named with an extra that contains it."""

import ast
from pathlib import Path
import sys

import pytest
from robot_dynamics.dependencies import LIBRARIES, optional
from robot_dynamics.exceptions import MissingDependencyError

SETUP = Path(__file__).parents[1] / 'setup.py'


def extras() -> dict[str, list[str]]:
    """Return the requirements of each extra in setup.py."""
    for node in ast.walk(ast.parse(SETUP.read_text(encoding='utf-8'))):
        if isinstance(node, ast.keyword) and node.arg == 'extras_require':
            return ast.literal_eval(node.value)
    raise ValueError('setup.py has no extras_require')


@pytest.mark.parametrize('library', LIBRARIES)
def test_a_missing_library_is_named_with_its_extra(
        library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    name, _, extra = LIBRARIES[library]
    words = rf'^a test needs the library {name} \(.*robot_dynamics\[{extra}\]\)$'
    with pytest.raises(MissingDependencyError, match=words):
        optional(f'{library}.part', 'a test')
    assert any(required.startswith(name.lower()) for required in extras()[extra])


def test_a_module_inside_a_library_is_returned() -> None:
    assert optional('yaml.nodes', 'a test').__name__ == 'yaml.nodes'
