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

"""The control law of docs/control_laws.md."""

from pathlib import Path
import re
from typing import Any

PAGE = Path(__file__).parents[2] / 'docs' / 'control_laws.md'
PAGE_MODULE, = re.findall(r'```python\n(# impedance.py\n.*?)```', PAGE.read_text(), re.DOTALL)


def page_law() -> dict[str, Any]:
    """Return the names of the module of the page."""
    scope: dict[str, Any] = {}
    exec(compile(PAGE_MODULE, 'impedance.py', 'exec'), scope)
    return scope
