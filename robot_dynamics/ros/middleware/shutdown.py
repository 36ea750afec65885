# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Orderly shutdown of a process after Ctrl-C, SIGTERM, or SIGHUP when its terminal closes.

The signal handlers of rclpy shut the context down at once, after which a node cannot publish a
last effort. Python runs its handlers only in the main thread, which may be waiting in C code. But
it writes each signal to a wake-up pipe in any thread: a thread reads this pipe.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import faulthandler
import os
import signal
import sys
import threading
from typing import NoReturn

END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
LONGEST_END = 10.0
"""[s] within which the middleware must end on its own."""


def handle_end_signals(handler: Callable[..., object]) -> None:
    """Call `handler` on each end signal; a process that `nohup` has started ignores SIGHUP."""
    for end_signal in END_SIGNALS:
        if end_signal != signal.SIGHUP or signal.getsignal(end_signal) is not signal.SIG_IGN:
            signal.signal(end_signal, handler)


@contextmanager
def ends_in_time(seconds: float = LONGEST_END) -> Iterator[None]:
    """
    End the process with status 1 and tracebacks on stderr if the statement takes longer.

    Fast DDS may block indefinitely while it ends if another process ends at the same moment
    (eProsima/Fast-DDS issue 6513); no Python thread runs then.
    """
    end_later(seconds)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


def end_later(seconds: float = LONGEST_END) -> None:
    """End the process with status 1 and tracebacks on stderr after this time [s]."""
    if sys.__stderr__ is not None:
        faulthandler.dump_traceback_later(seconds, exit=True, file=sys.__stderr__)


def leave(status: int) -> NoReturn:
    """
    Exit after an orderly shutdown, without the end of the interpreter.

    Threads of the middleware may still run then, and crash while libraries are unloaded.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


class ShutdownRequest:
    """Whether this process was asked to end; for use in a `with` statement, in the main thread."""

    def __init__(self) -> None:
        self.is_made = False
        """Whether the process was asked to end."""
        self._lock = threading.Lock()
        self._callback: Callable[[], object] | None = None
        self._reading, self._writing = os.pipe()
        os.set_blocking(self._writing, False)
        self._waiter = threading.Thread(target=self._wait, name='signals', daemon=True)

    def when_asked(self, callback: Callable[[], object]) -> None:
        """Call this once on the request, in another thread; at once if the request was earlier."""
        with self._lock:
            self._callback = callback
            if self.is_made:
                callback()

    def _wait(self) -> None:
        os.read(self._reading, 1)
        with self._lock:
            self.is_made = True
            if self._callback is not None:
                self._callback()

    def __enter__(self) -> 'ShutdownRequest':
        # The pipe first: a signal before it exists would be lost.
        signal.set_wakeup_fd(self._writing, warn_on_full_buffer=False)
        handle_end_signals(lambda *_: None)
        self._waiter.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Ignore further signals, so that they cannot interrupt the end of the process."""
        for end_signal in END_SIGNALS:  # Python would remove a handler before it ends
            signal.signal(end_signal, signal.SIG_IGN)
        with self._lock:
            self._callback = None
        os.write(self._writing, b'.')
        self._waiter.join()
