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

"""
Child processes of the tests, and how long a test waits for one of them.

A child ends with the test run that started it, also if that is killed: Linux sends it SIGKILL
(`PR_SET_PDEATHSIG`, prctl(2)). Linux does so when the *thread* that started the child ends, so a
test starts no child from a thread that ends before the child. A child that changes its user or
its capabilities while it starts (`unshare --user`) loses this.
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
[s] for any one event that a test waits for: the start of a node, a message, an answer, an end.

A wait ends with its event, so a large bound costs nothing while tests pass. It decides only how
soon a hang is found. A start of a node takes 1 s on an idle core and took more than 20 s on two
cores that four test processes, a browser and other work shared; a bound has to be above what any
loaded machine needs, or the verdict of a test depends on the load.
"""

LONG = 5.0 * TIMEOUT
"""[s] for what takes thousands of messages, or draws with a browser."""

PR_SET_PDEATHSIG = 1


def ends_with_parent() -> Callable[[], None] | None:
    """Return the `preexec_fn` of a child that ends with this process; None without Linux."""
    if not sys.platform.startswith('linux'):
        return None
    prctl, parent = ctypes.CDLL(None).prctl, os.getpid()

    def prepare() -> None:
        prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # which ended before the call
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
    """Tell whether no process has this id, or only its exit status is left."""
    try:
        status = Path(f'/proc/{pid}/stat').read_text(encoding='utf-8')
    except (FileNotFoundError, ProcessLookupError):
        return True
    return status.rpartition(')')[2].split()[0] == 'Z'
