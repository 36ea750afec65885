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

"""The nodes of the demo as processes of their own, in a domain where nobody else speaks."""

from collections.abc import Mapping, Sequence
import json
import os
from pathlib import Path
import signal
import socket
import subprocess
import sys
import time
from types import TracebackType
from typing import Any

from robot_dynamics.exceptions import RobotDynamicsError

DYNAMICS = 'robot_dynamics.ros.dynamics_node'
SIMULATED_ARM = 'robot_dynamics.ros.simulated_arm_node'
VIEWER = 'robot_dynamics.tools.viewer'

STOP_TIMEOUT = 5.0
"""[s] that a node has to leave in order."""
LOG_LINES = 12

_DOMAINS = range(1, 102)  # the ports of higher ones are those that the system gives out


class DemoError(RobotDynamicsError):
    """The demo cannot go on; the message says why, with the last lines of a log."""


def choose_domain(environment: Mapping[str, str]) -> dict[str, str]:
    """
    Return what to add to the environment, so that the demo hears only itself.

    What the user has set stays. A domain is free where nobody has the port of its first
    participant (7410 + 250 × domain, OMG DDSI-RTPS 2.3, section 9.6.1).
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


class NodeProcess:
    """A node with its parameters in a file, and its log in another."""

    def __init__(
        self, name: str, module: str, parameters: Mapping[str, Any], directory: Path,
        others: Path | None = None, arguments: Sequence[str] = (),
    ) -> None:
        """Start it; `directory` gets `<name>.yaml`, which outdoes `others`, and `<name>.log`."""
        self.name = name
        self.log = directory / f'{name}.log'
        file = directory / f'{name}.yaml'
        # JSON is YAML, and writes names and numbers so that no reader takes them for others.
        file.write_text(
            json.dumps({'/**': {'ros__parameters': dict(parameters)}}, indent=2) + '\n',
            encoding='utf-8')
        files = [file] if others is None else [others, file]
        command = [sys.executable, '-m', module, *arguments, '--ros-args']
        for each in files:
            command += ['--params-file', str(each.resolve())]
        with self.log.open('wb') as log:
            # In a session of its own, so that Ctrl-C reaches the demo alone, which stops it.
            self._process = subprocess.Popen(
                command, env={**os.environ, 'PYTHONUNBUFFERED': '1'}, stdin=subprocess.DEVNULL,
                stdout=log, stderr=subprocess.STDOUT, start_new_session=True)

    def check(self) -> None:
        """Raise DemoError where the process has ended."""
        status = self._process.poll()
        if status is not None:
            raise DemoError(
                f'{self.name} ended with status {status}. Its log ends with:\n{self.last_lines()}')

    def text(self) -> str:
        """Return the log."""
        return self.log.read_text(encoding='utf-8', errors='replace')

    def last_lines(self) -> str:
        """Return the end of the log."""
        lines = self.text().splitlines()
        return '\n'.join(f'  {line}' for line in lines[-LOG_LINES:]) or '  (nothing)'

    def interrupt(self) -> None:
        """Ask the process to leave, as Ctrl-C does."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)

    def wait(self, deadline: float) -> None:
        """Wait until the process has left; past the deadline (monotonic) end it."""
        try:
            self._process.wait(max(deadline - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


class Nodes:
    """All processes of the demo, for use in `with`: none outlives the statement."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._processes: list[NodeProcess] = []

    def start(
        self, name: str, module: str, parameters: Mapping[str, Any], others: Path | None = None,
        arguments: Sequence[str] = (),
    ) -> NodeProcess:
        """Start a node with these parameters, and with those of the file `others` beside."""
        process = NodeProcess(name, module, parameters, self._directory, others, arguments)
        self._processes.append(process)
        return process

    def check(self) -> None:
        """Raise DemoError where a node has ended."""
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

    def __enter__(self) -> 'Nodes':
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()
