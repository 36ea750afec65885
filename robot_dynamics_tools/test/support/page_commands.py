# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The files and commands of a page of the documentation, and their execution in its order."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, ExitStack, redirect_stdout
import io
import os
from pathlib import Path
import re
import runpy
import shlex
import signal
import subprocess
import sys

import children
from children import LONG, TIMEOUT
import pytest

FENCE = re.compile(r'^```(\w+)\n(.*?)^```$', re.MULTILINE | re.DOTALL)
FILE_NAME = re.compile(r'# ([\w.]+)\n')
NO_STATUSES: Mapping[str, int] = {}
NODES = ('dynamics_monitor', 'dynamics_node', 'mujoco_arm', 'simulated_arm')


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


def executable(package: str, name: str) -> str:
    """Return the path of an executable of a package, found as by `ros2 run`."""
    for prefix in os.environ['AMENT_PREFIX_PATH'].split(':'):
        path = Path(prefix) / 'lib' / package / name
        if path.exists():
            return str(path)
    raise AssertionError(f'{package} has no executable {name!r}')


def started_by(command: list[str]) -> str:
    """Return the executable, or the verb of `ros2 dynamics`, that a command runs, or ''."""
    return '' if command[0] != 'ros2' else command[3 if command[1] == 'run' else 2]


def resolved(command: list[str]) -> list[str]:
    """Return the command to run for a command of the page; no other form is allowed."""
    if command[:2] == ['ros2', 'run'] and command[2].startswith('robot_dynamics'):
        return [executable(*command[2:4]), *command[4:]]
    if command[:2] == ['ros2', 'dynamics']:
        return [executable('robot_dynamics_tools', 'dynamics'), *command[2:]]
    assert command[0] == 'python', f'{command} is neither ros2 run, ros2 dynamics nor python'
    return [sys.executable, *command[1:]]


@contextmanager
def running_node(command: list[str], directory: Path) -> Iterator[None]:
    """Run a node as in a separate terminal, from when it is ready; end it with status 0."""
    with children.popen(
            resolved(command), cwd=directory, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True) as process:
        try:
            assert process.stdout is not None
            log = ''
            while not re.search("Model '|Waiting for a URDF", log):
                line = process.stdout.readline()
                assert line, f'{command[3]}:\n{log}'
                log += line
            yield
        finally:
            process.send_signal(signal.SIGINT)
            try:
                out, _ = process.communicate(timeout=TIMEOUT)
            except subprocess.TimeoutExpired:
                process.kill()
                raise
    assert process.returncode == 0, f'{command[3]}:\n{out}'


def output_of(command: list[str], directory: Path, expected: int = 0) -> str:
    """
    Return the output of a command, which runs to its end; `expected` is its exit status.

    An executable runs in this process, which has loaded the libraries. The demo does not: it
    sets the ROS domain of its process.
    """
    words = resolved(command)
    if command[0] == 'python' or 'demo' in command:
        done = children.run(words, cwd=directory, capture_output=True, text=True, timeout=LONG)
        status, out, err = done.returncode, done.stdout, done.stderr
    else:
        with pytest.MonkeyPatch.context() as here, redirect_stdout(io.StringIO()) as printed:
            here.chdir(directory)
            here.setattr(sys, 'argv', words)
            with pytest.raises(SystemExit) as left:
                runpy.run_path(words[0], run_name='__main__')
        status, out, err = left.value.code, printed.getvalue(), ''
    assert status == expected, f'{command}:\n{out}{err}'
    return out


def run_page(
    page: str, directory: Path, statuses: Mapping[str, int] = NO_STATUSES,
    *arguments_of_arm: str,
) -> list[tuple[str, str]]:
    """
    Write the files of a page and run its commands in order; return each with its output.

    A node runs in parallel with the later commands, until the same node is started again.
    `statuses` are the exit statuses other than 0, by the beginning of a command. Further arguments
    are those of `simulated_arm`.
    """
    files, commands = files_and_commands(page)
    for name, text in files.items():
        (directory / name).write_text(text, encoding='utf-8')
    printed: list[tuple[str, str]] = []
    with ExitStack() as nodes:
        running: dict[str, ExitStack] = {}
        for command in commands:
            name = started_by(command)
            if name in NODES:
                running.pop(name, ExitStack()).close()
                running[name] = nodes.enter_context(ExitStack())
                more = arguments_of_arm if name == 'simulated_arm' else ()
                running[name].enter_context(running_node([*command, *more], directory))
                continue
            words = ' '.join(command)
            expected = max(
                (status for start, status in statuses.items() if words.startswith(start)),
                default=0)
            printed.append((words, output_of(command, directory, expected)))
    return printed


def printed_by(printed: list[tuple[str, str]], start: str, end: str = '') -> str:
    """Return the output of the command with this start and end."""
    found, = [out for command, out in printed
              if command.startswith(start) and command.endswith(end)]
    return found


def final_errors(out: str) -> list[float]:
    """Return the column `error` of the output of `dynamics move` [rad], by joint."""
    return [1e-3 * float(error)
            for error in re.findall(r'^\w*joint\d .* (\S+)$', out, re.MULTILINE)]
