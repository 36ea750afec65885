# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes as separate processes that end with their tool; a ROS domain that no other uses."""

from collections.abc import Callable, Mapping, Sequence
import ctypes
import json
import os
from pathlib import Path
import signal
import socket
import subprocess
import sys
import time
from typing import Any

from robot_dynamics.tools.command_line import ToolError, write_file

DYNAMICS = 'robot_dynamics.ros.dynamics.node'
SIMULATED_ARM = 'robot_dynamics.ros.simulated_arm.node'
MONITOR = 'robot_dynamics_tools.monitor.node'
VERBS = 'robot_dynamics_tools'
"""The program of the tools, whose first argument is a verb."""

STOP_TIMEOUT = 30.0
"""[s] within which a node must exit before it is killed; a busy machine may take seconds."""
LOG_LINES = 12

_PR_SET_PDEATHSIG = 1  # of prctl(2), linux/prctl.h

_DOMAINS = range(1, 102)  # higher domains use the ephemeral ports of the system


class NodeError(ToolError):
    """A node failed; the message has the reason and the last lines of its log."""


def choose_domain(environment: Mapping[str, str]) -> dict[str, str]:
    """
    Return the environment variables that isolate a tool from other ROS nodes.

    Variables of the user are not changed. A domain is free if the port of its first participant
    is unused (7410 + 250 × domain, OMG DDSI-RTPS 2.3, section 9.6.1).
    """
    added = {}
    if not environment.get('ROS_DOMAIN_ID'):
        first = os.getpid() % len(_DOMAINS)
        order = [*_DOMAINS[first:], *_DOMAINS[:first]]
        added['ROS_DOMAIN_ID'] = str(next(filter(_is_free, order), order[0]))
    if not environment.get('ROS_AUTOMATIC_DISCOVERY_RANGE'):
        added['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    return added


def _is_free(domain: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(('', 7410 + 250 * domain))
        except OSError:
            return False
    return True


def _ends_with_parent() -> Callable[[], None] | None:
    """
    Return a function for a new process: SIGTERM ends it when this process ends, on Linux.

    Thus no node remains even if the tool is killed. The signal is sent when the thread that has
    started the process ends, therefore it must be the main thread.
    """
    if sys.platform != 'linux':
        return None
    prctl, parent = ctypes.CDLL(None, use_errno=True).prctl, os.getpid()

    def end_with_parent() -> None:
        prctl(_PR_SET_PDEATHSIG, int(signal.SIGTERM), 0, 0, 0)
        if os.getppid() != parent:  # the parent ended before the call
            os._exit(1)

    return end_with_parent


class NodeProcess:
    """A node with a parameter file and a log file."""

    def __init__(
        self, name: str, module: str, parameters: Mapping[str, object], directory: Path,
        others: Path | None = None, arguments: Sequence[str] = (),
        defaults: Mapping[str, object] | None = None,
    ) -> None:
        """
        Start the node; its parameters `<name>.yaml` and log `<name>.log` are in `directory`.

        The file `others` takes precedence over `defaults`, and `parameters` over both.
        """
        self.name = name
        self.log = directory / f'{name}.log'
        files = [others] if others is not None else []
        if defaults:
            files.insert(0, _written(directory / f'{name}_defaults.yaml', defaults))
        files.append(_written(directory / f'{name}.yaml', parameters))
        command = [sys.executable, '-m', module, *arguments, '--ros-args']
        for each in files:
            command += ['--params-file', str(each.resolve())]
        with self.log.open('wb') as log:
            # In a new session, so that Ctrl-C reaches the tool only, which stops its nodes.
            self._process = subprocess.Popen(
                command, env={**os.environ, 'PYTHONUNBUFFERED': '1'}, stdin=subprocess.DEVNULL,
                stdout=log, stderr=subprocess.STDOUT, start_new_session=True,
                preexec_fn=_ends_with_parent())

    def check(self) -> None:
        """Raise NodeError if the process has ended."""
        status = self._process.poll()
        if status is not None:
            raise NodeError(
                f'{self.name} ended with status {status}. Its log ends with:\n{self.last_lines()}')

    def text(self) -> str:
        """Return the log."""
        return self.log.read_text(encoding='utf-8', errors='replace')

    def last_lines(self) -> str:
        """Return the end of the log."""
        lines = self.text().splitlines()
        return '\n'.join(f'  {line}' for line in lines[-LOG_LINES:]) or '  (nothing)'

    def interrupt(self) -> None:
        """Ask the process to exit, as Ctrl-C does."""
        self._process.send_signal(signal.SIGINT)

    def wait(self, deadline: float) -> None:
        """Wait until the process has exited; kill it after the deadline (monotonic)."""
        try:
            self._process.wait(max(deadline - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def _written(file: Path, parameters: Mapping[str, object]) -> Path:
    # JSON is YAML in which no name or number can be read as another type.
    write_file(file, json.dumps({'/**': {'ros__parameters': dict(parameters)}}, indent=2) + '\n')
    return file


class Nodes:
    """All processes of a tool."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._processes: list[NodeProcess] = []

    def start(self, name: str, module: str, parameters: Mapping[str, object], **more: Any) -> (
            NodeProcess):
        """Start a node with these parameters, and the other arguments of NodeProcess."""
        process = NodeProcess(name, module, parameters, self._directory, **more)
        self._processes.append(process)
        return process

    def check(self) -> None:
        """Raise NodeError if a node has ended."""
        for process in self._processes:
            process.check()

    def logs(self) -> str:
        """Return the last lines of all logs."""
        return '\n'.join(
            f'Log of {process.name} ({process.log}):\n{process.last_lines()}'
            for process in self._processes)

    def stop(self) -> None:
        """Stop all nodes."""
        for process in self._processes:
            process.interrupt()
        deadline = time.monotonic() + STOP_TIMEOUT
        for process in self._processes:
            process.wait(deadline)
        self._processes.clear()
