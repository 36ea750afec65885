# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What SIGINT and SIGTERM do to a tool that records: they end it in order."""

from collections.abc import Iterator
from contextlib import contextmanager
import signal
import threading

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
    arrived: list[int] = []
    before = {
        number: signal.signal(number, lambda signum, _: arrived.append(signum))
        for number in _ENDING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for signum in arrived[:1]:
            signal.raise_signal(signum)


@contextmanager
def interrupted_by_sigterm() -> Iterator[None]:
    """Raise KeyboardInterrupt on SIGTERM, too."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
