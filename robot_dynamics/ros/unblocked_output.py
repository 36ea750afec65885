# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Messages on stderr that no reader can hold up.

A terminal after Ctrl-S, or of an ssh connection that stalls, accepts no more bytes. A log message
then blocks its thread, and all others: rclpy writes while it holds the lock of the interpreter.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
import os
import select
import stat
import threading

STDERR = 2
LAST_WORDS = 1.0
"""[s] for the last messages when the process ends."""
PART = 65536
"""[bytes] of a pipe on Linux, beyond which messages are lost."""


@contextmanager
def unblocked_stderr() -> Iterator[None]:
    """Let a thread pass on what is written to stderr; a file needs none."""
    if stat.S_ISREG(os.fstat(STDERR).st_mode):
        yield
        return
    given = os.dup(STDERR)
    source, sink = os.pipe()
    os.set_blocking(sink, False)
    os.dup2(sink, STDERR)
    os.close(sink)

    def pass_on() -> None:
        while part := os.read(source, PART):
            with suppress(OSError):  # the terminal is closed
                while part:
                    part = part[os.write(given, part):]

    thread = threading.Thread(target=pass_on, name='stderr', daemon=True)
    thread.start()
    try:
        yield
    finally:
        if select.select([], [given], [], LAST_WORDS)[1]:  # else the pipe remains
            os.dup2(given, STDERR)
            thread.join(LAST_WORDS)
