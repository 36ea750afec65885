# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Shared by the tests of requests: clients in separate processes, and checks of the control loop.

No fault may begin while a request is answered. The longest gap between two commands is reported;
it has no limit.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
import itertools
import json
import os
from pathlib import Path
import select
import subprocess
import sys
from typing import Any

import children
from fault_bench import FaultBench
from ros_harness import TIMEOUT


class ControlContinues:
    """Checks that a node continues to command during requests."""

    def __init__(self, bench: FaultBench) -> None:
        self.bench, self.ask = bench, bench.ask
        self.longest_pause = 0.0
        """Longest time between two commands during the last check [s]."""
        self._faults_known = 0

    @contextmanager
    def checked(self, with_faults: bool = False) -> Iterator[None]:
        """Check that commands continue before, during and after; `with_faults` permits faults."""
        self.bench.check_alive()
        before = len(self.bench.efforts.messages)
        yield
        self.bench.efforts.wait_count(before + 1)
        times = [t for t, _ in self.bench.efforts.published()]
        self.longest_pause = max(b - a for a, b in itertools.pairwise(times))
        self.bench.check_alive()
        faults = self._count_faults()
        assert with_faults or faults == self._faults_known, self.bench.node.log
        self._faults_known = faults

    def _count_faults(self) -> int:
        report = self.bench.next_status('command')
        return sum(int(value.value) for value in report.values if value.key.startswith('faults: '))


class ClientProcess:
    """
    A module of this directory as a process that answers each line of JSON with one line.

    For use in a `with` statement, at whose end the process must exit on its own.
    """

    def __init__(
        self, module: str, *arguments: str, environment: Mapping[str, str] | None = None,
    ) -> None:
        self._process = children.popen(
            [sys.executable, str(Path(__file__).with_name(f'{module}.py')), *arguments],
            text=True, env={**os.environ, **(environment or {})},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def ask(self, question: Any, timeout: float = 4 * TIMEOUT) -> Any:
        """Send a request; return the answer."""
        self._process.stdin.write(f'{json.dumps(question)}\n')
        self._process.stdin.flush()
        ready, _, _ = select.select([self._process.stdout], [], [], timeout)
        assert ready, f'no answer in {timeout:g} s'
        line = self._process.stdout.readline()
        assert line, f'ended with status {self._process.wait()}'
        return json.loads(line)

    def kill(self) -> None:
        """Kill the process."""
        self._process.kill()
        self._process.communicate()

    def __enter__(self) -> 'ClientProcess':
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            self.kill()
            return
        self._process.communicate(timeout=TIMEOUT)
        assert self._process.returncode == 0


def answer_lines(answer: Any) -> None:
    """Answer the requests of a `ClientProcess` until its input ends."""
    for line in sys.stdin:
        print(json.dumps(answer(json.loads(line))), flush=True)
