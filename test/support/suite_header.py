# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The header of a test run: the duration of the whole suite, and the skipped tests."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
import re
import shutil
from typing import NamedTuple

import pytest
from robot_dynamics.animation.video import check_format
from robot_dynamics.exceptions import MissingDependencyError
from robots import is_installed, PACKAGE

DURATION = 'duration: about 7 minutes in four processes on two idle cores'
"""Duration of the default run; measure again after adding many tests (last line of output)."""

TESTS = Path(__file__).parents[1]
UR10 = TESTS.parents[1] / 'shared' / 'data' / 'ur10'
ROSBAG2 = UR10.with_name('rosbag2')
CHROMIUM = ('chromium', 'chromium-browser', 'google-chrome')
"""Names of the browser executable; the first on the PATH is used."""
MODULE_OR_SKIP = r"(?:importorskip|find_spec|= load)\('({})\b"
"""Patterns of libraries whose absence skips tests."""
MOST_NAMES = 4
"""Largest number of files that a line names; for more it gives the number."""


class Tool(NamedTuple):
    """An optional tool that tests need; `used_in` finds it in the text of a test file."""

    name: str
    is_there: Callable[[], bool]
    used_in: str | re.Pattern[str]


def chromium_program() -> str | None:
    """Return the path of the browser, or None without one."""
    return next(filter(None, map(shutil.which, CHROMIUM)), None)


def has_module(name: str) -> bool:
    """Return whether a library can be imported."""
    return find_spec(name) is not None


def has_ffmpeg() -> bool:
    """Return whether an MP4 can be written."""
    try:
        check_format(Path('x.mp4'))
    except MissingDependencyError:
        return False
    return True


TOOLS = (
    Tool('Chromium', lambda: chromium_program() is not None, '(?m)^from browser import'),
    Tool('playwright', lambda: has_module('playwright'), '(?m)^from browser import'),
    Tool('ffmpeg', has_ffmpeg, r"check_format\(Path\('x.mp4'\)\)"),
    Tool(PACKAGE, is_installed, '(?m)^from robots import .*robot_'),
    Tool('../shared/data/rosbag2', ROSBAG2.exists, r'(?m)^from recordings import .*\b\w+_of\b'),
    Tool('../shared/data/ur10', UR10.exists, "'shared' / 'data' / 'ur10'|shared/data/ur10"),
)


def optional_modules(sources: Mapping[str, str]) -> Iterator[Tool]:
    """Yield the libraries whose absence skips tests, as named in the tests."""
    names = {name for text in sources.values()
             for name in re.findall(MODULE_OR_SKIP.format(r'\w+'), text)}
    for name in sorted(names):
        yield Tool(name, partial(has_module, name), MODULE_OR_SKIP.format(name))


def missing_tools(sources: Mapping[str, str], tools: Sequence[Tool] = TOOLS) -> Iterator[str]:
    """Yield one line per missing tool, with the files that need it; `sources` are their texts."""
    for tool in (*tools, *optional_modules(sources)):
        if not tool.is_there():
            files = [name for name, text in sources.items() if re.search(tool.used_in, text)]
            names = ', '.join(files) if len(files) <= MOST_NAMES else f'{len(files)} files'
            yield f'missing: {tool.name}; tests in {names} that need it are skipped'


def has_no_files(config: pytest.Config) -> bool:
    """Return whether the command names no files, so that pytest collects all files."""
    return config.args_source is not config.ArgsSource.ARGS


def is_default_run(config: pytest.Config) -> bool:
    """Return whether the command selects nothing: no files, no marks, no names."""
    addopts, option = config.getini('addopts'), config.option
    marks = dict(zip(addopts, addopts[1:])).get('-m', '')
    return has_no_files(config) and option.markexpr == marks and not option.keyword


class SuiteHeader:
    """The pytest plugin that prints the header; `more` are additional tools."""

    def __init__(self, *more: Tool) -> None:
        self._tools = (*more, *TOOLS)

    def pytest_report_header(self, config: pytest.Config) -> list[str]:
        """Return the lines of the header."""
        left_out = re.findall(r'not (\w+)', config.option.markexpr)
        lines = [f'left out by mark: {mark}' for mark in config.getini('markers')
                 if mark.partition(':')[0] in left_out]
        if has_no_files(config):
            paths = [path for path in sorted(TESTS.rglob('*.py')) if path != Path(__file__)]
            sources = {path.name: path.read_text(encoding='utf-8') for path in paths}
            lines += missing_tools(sources, self._tools)
        if is_default_run(config):
            lines.insert(0, DURATION)
        return lines
