# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Blocks of code that signals do not interrupt."""

from collections.abc import Iterator
from contextlib import contextmanager
import signal
import threading
from typing import Any

_ENDING = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """
    Delay SIGINT and SIGTERM until the end of the block.

    A KeyboardInterrupt within rclpy's C++ code becomes a RuntimeError; while a file is written it
    leaves an incomplete record.

    Signals interrupt only the main thread; in other threads this has no effect.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[tuple[int, Any]] = []
    before = {
        number: signal.signal(number, lambda *call: arrived.append(call)) for number in _ENDING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for signum, frame in arrived[:1]:
            handler = before[signal.Signals(signum)]
            if callable(handler):
                handler(signum, frame)
