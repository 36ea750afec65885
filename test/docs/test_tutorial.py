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

"""docs/tutorial.md from top to bottom: its files, its commands, and the expected results."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
import os
from pathlib import Path
import re
import shlex
import signal
import subprocess
import sys

import children
from children import LONG, TIMEOUT

PAGE = Path(__file__).parents[2] / 'docs' / 'tutorial.md'
FENCE = re.compile(r'^```(\w+)\n(.*?)^```$', re.MULTILINE | re.DOTALL)
FILE_NAME = re.compile(r'# ([\w.]+)\n')
NODES = ('dynamics_node', 'simulated_arm')
DATA_SHEET_LEAVES = (4.3, 1.9)
"""[N m] that the last program of the page prints where the node has the data sheet for a model."""


def files_and_commands(page: str) -> tuple[dict[str, str], list[list[str]]]:
    """Return the files that a page shows, by the name in their first line, and its commands."""
    files, commands = {}, []
    for language, text in FENCE.findall(page):
        named = FILE_NAME.match(text)
        if language == 'bash':
            commands += [shlex.split(line, comments=True) for line in
                         text.replace('\\\n', ' ').splitlines() if line.strip()]
        elif language != 'text':
            assert named, f'a block of {language} has no name in its first line:\n{text}'
            files[named[1]] = text
    return files, commands


def executable(name: str) -> str:
    """Return the path of an executable of this package, found as by `ros2 run`."""
    for prefix in os.environ['AMENT_PREFIX_PATH'].split(':'):
        path = Path(prefix) / 'lib' / 'robot_dynamics' / name
        if path.exists():
            return str(path)
    raise AssertionError(f'robot_dynamics has no executable {name!r}')


def resolved(command: list[str]) -> list[str]:
    """Return the command to run for a command of the page; no other form is allowed."""
    if command[:3] == ['ros2', 'run', 'robot_dynamics']:
        return [executable(command[3]), *command[4:]]
    assert command[0] == 'python', f'{command} is neither ros2 run nor python'
    return [sys.executable, *command[1:]]


@contextmanager
def running_node(command: list[str], directory: Path) -> Iterator[None]:
    """Run a node as in a separate terminal, and end it by Ctrl-C, with status 0."""
    with children.popen(
            resolved(command), cwd=directory, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True) as process:
        try:
            yield
        finally:
            process.send_signal(signal.SIGINT)
            try:
                out, _ = process.communicate(timeout=TIMEOUT)
            except subprocess.TimeoutExpired:
                process.kill()
                raise
    assert process.returncode == 0, f'{command[3]}:\n{out}'


def run_all(commands: list[list[str]], directory: Path) -> dict[str, str]:
    """Run all commands in order, nodes in parallel with later ones; return the output of each."""
    printed: dict[str, str] = {}
    for i, command in enumerate(commands):
        if command[0] == 'ros2' and command[3] in NODES:
            with running_node(command, directory):
                return {**printed, **run_all(commands[i + 1:], directory)}
        result = children.run(
            resolved(command), cwd=directory, capture_output=True, text=True, timeout=LONG)
        assert result.returncode == 0, f'{command}:\n{result.stdout}{result.stderr}'
        printed[' '.join(command)] = result.stdout
    return printed


def printed_by(printed: Mapping[str, str], start: str, end: str = '') -> str:
    """Return the output of the command with this start and end."""
    found, = [out for command, out in printed.items()
              if command.startswith(start) and command.endswith(end)]
    return found


def relative_residuals(out: str) -> list[float]:
    """Return the column `relative` of the output of analyze_bag [%]."""
    return [float(fraction) for fraction in re.findall(
        r'^joint\d +\S+ N·m +\S+ N·m +(\S+) %', out, re.MULTILINE)]


def table_headings(text: str) -> set[str]:
    """Return the heading of each table, with single spaces."""
    return {' '.join(line.split()) for line in re.findall(r'^joint .*', text, re.MULTILINE)}


def test_the_tutorial(tmp_path: Path) -> None:
    page = PAGE.read_text(encoding='utf-8')
    files, commands = files_and_commands(page)
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding='utf-8')
    printed = run_all(commands, tmp_path)
    assert table_headings(page) <= table_headings('\n'.join(printed.values()))
    used = {command[3] for command in commands if command[0] == 'ros2'}
    assert used >= {'excite', 'demo', 'analyze_bag', 'identify', *NODES}
    analyze = 'ros2 run robot_dynamics analyze_bag '
    before = relative_residuals(printed_by(printed, analyze, '--output before'))
    after = relative_residuals(printed_by(printed, analyze, '--no-report'))
    assert len(before) == len(after) == 2
    assert min(before) > 15.0
    for left, there_was in zip(after, before):
        assert left < 0.4 * there_was
    live = printed_by(printed, 'python watch_residual.py')
    numbers = [float(number) for number in re.findall(r'\d+\.\d*', live)]
    assert len(numbers) == 2
    for left, with_data_sheet in zip(numbers, DATA_SHEET_LEAVES):
        assert left < 0.4 * with_data_sheet


def test_files_that_the_tutorial_names_are_there_when_it_names_them() -> None:
    """The input of each command is on the page, or was written by an earlier command."""
    files, commands = files_and_commands(PAGE.read_text(encoding='utf-8'))
    known = set(files)
    for command in commands:
        for option, value in zip(command, command[1:]):
            if option in ('--output', '--out'):
                known.add(value)
        for word in command[1:]:
            name = word.rpartition(':=')[2]
            if re.fullmatch(r'[\w/]+\.(urdf|yaml|py)', name):
                assert name in known or name.split('/')[0] in known, f'{name} in {command}'
