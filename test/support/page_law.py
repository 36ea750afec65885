# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

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
