# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Processes of nodes that a server forks, which has imported their modules.

Imports take 0.4 to 0.7 s of processor time of each start, and a test run starts 200 nodes. The
new process calls `run_module`, as the executable does. It ends with the server, and the server
with the test run.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
import ctypes
from multiprocessing import get_context
from multiprocessing.connection import Connection
import os
import signal
import subprocess
import sys

from children import PR_SET_PDEATHSIG

MODULES = ('robot_dynamics.ros.dynamics.node', 'robot_dynamics.ros.simulated_arm.node',
           'robot_dynamics_tools.monitor.node', 'robot_dynamics_tools.mujoco.mujoco_arm')
"""The modules of the nodes that are forked."""
SERVER = get_context('forkserver')
SERVER.set_forkserver_preload(['robot_dynamics.ros.entry_points', *MODULES])


class ForkedNode:
    """A process with the part of `subprocess.Popen` that `NodeProcess` uses."""

    def __init__(
        self, module: str, arguments: Sequence[str], environment: Mapping[str, str],
    ) -> None:
        reader, writer = SERVER.Pipe(duplex=False)
        self._process = SERVER.Process(
            target=_run, args=(module, arguments, dict(environment), writer), daemon=True)
        self._process.start()
        writer.close()
        self.stdout = os.fdopen(os.dup(reader.fileno()), errors='replace')
        reader.close()
        assert self._process.pid is not None
        self.pid = self._process.pid

    def poll(self) -> int | None:
        """Return the exit status, None while the process runs."""
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit status; raise TimeoutExpired."""
        self._process.join(timeout)
        status = self._process.exitcode
        if status is None:
            raise subprocess.TimeoutExpired(self._process.name, timeout or 0.0)
        return status

    def send_signal(self, number: int) -> None:
        """Send a signal, unless the process has ended."""
        with suppress(ProcessLookupError):
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Send SIGKILL."""
        self.send_signal(signal.SIGKILL)


def _run(
    module: str, arguments: Sequence[str], environment: Mapping[str, str], output: Connection,
) -> None:
    """Run the `main` of a node in the new process."""
    from robot_dynamics.ros.entry_points import run_module
    if sys.platform == 'linux':
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    for stream in (sys.stdout, sys.stderr):
        os.dup2(output.fileno(), stream.fileno())
        stream.reconfigure(line_buffering=True)
    output.close()
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = [module.rpartition('.')[0], *arguments]
    run_module(module)
