# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The quick start of README in one session, from the first command to the last."""

from contextlib import ExitStack
from pathlib import Path
import signal
import subprocess

import children
from children import LONG, TIMEOUT
from page_commands import files_and_commands, final_errors, NODES, resolved, running_node

README = Path(__file__).parents[2] / 'README.md'
LOCK_STEP = ['--ros-args', '-p', 'lock_step:=true', '-p', 'real_time_factor:=1.0']
"""So that the errors do not depend on the load of the machine."""
INTERRUPTED = ('watch', 'record')


def quick_start() -> list[list[str]]:
    """Return the commands that README runs in a clone, without `scripts/run`."""
    section = README.read_text(encoding='utf-8').split('\n## Quick start\n')[1].split('\n## ')[0]
    _, commands = files_and_commands(section)
    return [command[1:] for command in commands if command[0] == 'scripts/run']


def interrupted(command: list[str], directory: Path) -> str:
    """Return the output of a command that Ctrl-C ends after its first line, with status 0."""
    with children.popen(
            resolved(command), cwd=directory, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        process.send_signal(signal.SIGINT)
        rest, _ = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 0, f'{command}:\n{first}{rest}'
    return first + rest


def test_each_motion_of_the_quick_start_ends_within_a_milliradian(tmp_path):
    printed: dict[str, str] = {}
    with ExitStack() as nodes:
        for command in quick_start():
            if command[1] == 'run':
                assert command[3] in NODES
                lock_step = LOCK_STEP if command[3] == 'simulated_arm' else []
                nodes.enter_context(running_node(command + lock_step, tmp_path))
            elif command[2] in INTERRUPTED:
                printed[' '.join(command)] = interrupted(command, tmp_path)
            else:
                result = children.run(
                    resolved(command), cwd=tmp_path, capture_output=True, text=True, timeout=LONG)
                assert result.returncode == 0, f'{command}:\n{result.stdout}{result.stderr}'
                printed[' '.join(command)] = result.stdout
    verbs = [command.split()[2] for command in printed]
    assert verbs == [
        'status', 'move', 'watch', 'inverse', 'equation', 'payload', 'move', 'record']
    for command, out in printed.items():
        if command.split()[2] == 'move':
            errors = final_errors(out)
            assert len(errors) == 2, out
            assert max(map(abs, errors)) < 1e-3, f'{command}:\n{out}'
    assert list((tmp_path / 'my_recording').iterdir())
