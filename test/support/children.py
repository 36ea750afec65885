# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Child processes of the tests, and the bound of waits for them.

A child ends with the test run that started it, even if the test run is killed: Linux sends it
SIGKILL (`PR_SET_PDEATHSIG`, prctl(2)). Linux does so when the *thread* that started the child
ends, so a test starts no child from a thread that ends before the child. A child that changes its
user or its capabilities while it starts (`unshare --user`) loses this.
"""

from collections.abc import Callable, Sequence
import ctypes
import os
from pathlib import Path
import signal
import subprocess
import sys
from typing import Any

TIMEOUT = 120.0
"""
Bound of a wait for one event [s]: the start of a node, a message, an answer, the end of a node.

A wait ends with its event, so a large bound costs nothing while tests pass. It only determines how
soon a hang is detected. A start of a node takes 1 s on an idle core and took more than 20 s on two
cores that four test processes, a browser and other work shared; a bound has to be above what any
loaded machine needs, or the verdict of a test depends on the load.
"""

LONG = 5.0 * TIMEOUT
"""Bound of waits for thousands of messages, or for rendering in a browser [s]."""

PR_SET_PDEATHSIG = 1


def ends_with_parent() -> Callable[[], None] | None:
    """Return the `preexec_fn` of a child that ends with this process; None without Linux."""
    if not sys.platform.startswith('linux'):
        return None
    prctl, parent = ctypes.CDLL(None).prctl, os.getpid()

    def prepare() -> None:
        prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # the parent ended before the call
            os._exit(1)

    return prepare


def popen(command: Sequence[str | Path], **options: Any) -> 'subprocess.Popen[Any]':
    """Start a child as `subprocess.Popen` does; it ends with this process."""
    return subprocess.Popen(command, preexec_fn=ends_with_parent(), **options)


def run(
    command: Sequence[str | Path], timeout: float = TIMEOUT, check: bool = False, **options: Any,
) -> 'subprocess.CompletedProcess[Any]':
    """Run a child to its end as `subprocess.run` does; it ends with this process."""
    return subprocess.run(
        command, preexec_fn=ends_with_parent(), timeout=timeout, check=check, **options)


def is_gone(pid: int) -> bool:
    """Return whether no process has this id, or only its exit status remains."""
    try:
        status = Path(f'/proc/{pid}/stat').read_text(encoding='utf-8')
    except (FileNotFoundError, ProcessLookupError):
        return True
    return status.rpartition(')')[2].split()[0] == 'Z'
