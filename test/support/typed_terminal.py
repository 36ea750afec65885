# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A terminal in which a test types: bash on a pseudo-terminal, which echoes and knows Ctrl-C."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
import re
import subprocess
import sys
import threading

import children

PROMPT = re.compile(r'<ready (\d+)>')
"""What bash prints before each command, with the exit status of the one before."""
PROGRAM = 'import pty; pty.spawn(["bash", "--norc", "--noediting", "-i"])'


class Terminal:
    """Bash in a directory; `type` waits for the end of a command, `start` does not."""

    def __init__(self, process: 'subprocess.Popen[bytes]') -> None:
        self._process = process
        self._text = ''
        self._changed = threading.Condition()
        threading.Thread(target=self._read, daemon=True).start()
        self._place = 0
        self._wait_for(PROMPT, children.TIMEOUT)

    def _read(self) -> None:
        assert self._process.stdout is not None
        while data := self._process.stdout.read1():  # type: ignore[attr-defined]
            with self._changed:
                self._text += data.decode(errors='replace').replace('\r', '')
                self._changed.notify_all()

    def _wait_for(self, pattern: 're.Pattern[str]', timeout: float) -> 're.Match[str]':
        """Return the first match in the output since the last typed command."""
        with self._changed:
            found = self._changed.wait_for(
                lambda: pattern.search(self._text, self._place), timeout)
        assert found, f'no {pattern.pattern!r} within {timeout:g} s:\n{self.printed()}'
        return found

    def _write(self, text: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(text.encode())
        self._process.stdin.flush()

    def printed(self) -> str:
        """Return the output since the last typed command, with its echo."""
        return self._text[self._place:]

    def start(self, command: str, shows: str) -> None:
        """Type a command, and wait until it has printed what matches `shows` in its lines."""
        self._place = len(self._text)
        self._write(f'{command}\n')
        lines = command.count('\n') + 1  # of the echo
        self._wait_for(re.compile(rf'(?:.*\n){{{lines}}}(?:.*\n)*?.*(?:{shows})'), children.LONG)

    def type(self, command: str) -> int:
        """Type a command; return its exit status after its end."""
        self._place = len(self._text)
        self._write(f'{command}\n')
        return int(self._wait_for(PROMPT, children.LONG)[1])

    def interrupt(self) -> int:
        """Press Ctrl-C; return the exit status of the command that runs."""
        self._write('\x03')
        return int(self._wait_for(PROMPT, children.TIMEOUT)[1])


@contextmanager
def terminal(directory: Path, environment: Mapping[str, str]) -> Iterator[Terminal]:
    """Open a terminal with exactly these variables."""
    variables = {**environment, 'PS1': '<ready $?>', 'PS2': '', 'TERM': 'dumb'}
    with children.popen(
            [sys.executable, '-c', PROGRAM], cwd=directory, env=variables, stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        opened = Terminal(process)
        try:
            yield opened
        finally:
            process.kill()  # the pseudo-terminal closes, and bash and its commands get SIGHUP
