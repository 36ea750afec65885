# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
docs/evidence/benchmarks.md: the output of each benchmark, inserted between its marks.

A benchmark NAME has its place between `<!-- NAME -->` and `<!-- end -->`.
"""

from datetime import date
from importlib.metadata import version
import os
from pathlib import Path
import platform
import re

PAGE = Path(__file__).parents[1] / 'docs' / 'evidence' / 'benchmarks.md'


def names() -> list[str]:
    """Return the benchmarks that have a place in the page."""
    marks = re.findall(r'^<!-- (\w+) -->$', PAGE.read_text(encoding='utf-8'), re.MULTILINE)
    return [mark for mark in marks if mark != 'end']


def write(name: str, printed: str) -> None:
    """Insert the output of a benchmark in its place; raise ValueError if it has no place."""
    text = PAGE.read_text(encoding='utf-8')
    mark = f'<!-- {name} -->\n'
    if mark not in text:
        raise ValueError(f'{PAGE.name} has no place for {name!r}, expected one of {names()}')
    before, after = text.split(mark)
    rest = after[after.index('<!-- end -->'):]
    when = f'{date.today():%Y-%m-%d}, {machine()}'
    PAGE.write_text(f'{before}{mark}```text\n# {when}\n{printed.rstrip()}\n```\n{rest}', 'utf-8')


def machine() -> str:
    """Return a description of the machine, its software and the other work on it."""
    libraries = ', '.join(f'{name} {version(name)}' for name in ('numpy', 'pin'))
    return (f'{_processor()}, {os.cpu_count()} cores; CPython {platform.python_version()}, '
            f'{libraries}; load average {os.getloadavg()[1]:.1f}')


def _processor() -> str:
    try:
        found = re.search(r'^model name\s*: (.*)$', Path('/proc/cpuinfo').read_text('ascii'), re.M)
    except OSError:
        found = None
    return found[1] if found else platform.machine()
