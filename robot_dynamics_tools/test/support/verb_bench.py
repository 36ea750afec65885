# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Verbs of `ros2 dynamics`, in this process with one client, or in separate processes."""

from collections.abc import Callable, Iterable
from contextlib import nullcontext
import subprocess
import sys

import children
from children import TIMEOUT
import pytest
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient
from robot_dynamics_tools.ros2_dynamics.verbs import make_parser, run

PROGRAM = [sys.executable, '-c', """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in a job of a shell
from robot_dynamics_tools.ros2_dynamics.verbs import main
sys.exit(main(sys.argv[1:]))
"""]
Ask = Callable[..., tuple[int, str, str]]


def asking(capsys: pytest.CaptureFixture[str], client: DynamicsClient) -> Ask:
    """Return a function that runs a verb: exit status, output, error output."""
    def ask(*words: object, client: DynamicsClient = client) -> tuple[int, str, str]:
        arguments = make_parser().parse_args(list(map(str, words)))
        status = run(arguments.verb, arguments, lambda *_: nullcontext(client))
        return status, *capsys.readouterr()

    return ask


def assert_refused(ask: Ask, words: Iterable[object], *said: str) -> None:
    """Check that a verb prints nothing, ends with 2, and says why in one line."""
    status, out, err = ask(*words)
    assert (status, out, err.count('\n')) == (2, '', 1)
    assert all(one in err for one in said), err


def start(*words: str, node: str = '/dynamics') -> 'subprocess.Popen[str]':
    """Start a verb in a process."""
    return children.popen(
        [*PROGRAM, *words, '--node', node, '--timeout', str(TIMEOUT)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def finish(process: 'subprocess.Popen[str]') -> tuple[int, str, str]:
    """Return the exit status and the rest of the output; a process that hangs is killed."""
    try:
        out, err = process.communicate(timeout=TIMEOUT)
    finally:
        process.kill()
    return process.returncode, out, err


def first_line(process: 'subprocess.Popen[str]') -> str:
    """Return the first line of the error output."""
    return str(process.stderr.readline())
