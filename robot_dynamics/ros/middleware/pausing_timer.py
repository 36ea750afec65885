# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A timer that pauses.

It is destroyed instead of cancelled: an executor of rclpy with several threads finds a timer
ready, and calls it later in another thread. If the timer has been cancelled meanwhile, this raises
an RCLError, which ends `spin`; a destroyed timer is ignored.
"""

from collections.abc import Callable
import threading
from typing import Any

from rclpy.node import Node


class PausingTimer:
    """Calls `callback` every `period` [s] while it runs; at first it does not run."""

    def __init__(
        self, node: Node, period: float, callback: Callable[[], object], *args: object,
    ) -> None:
        """`args` are those of `create_timer` after the callback."""
        self._node = node
        self._create: Callable[[], Any] = lambda: node.create_timer(period, callback, *args)
        self._timer: Any = None
        self._lock = threading.Lock()

    def run(self, is_needed: bool) -> None:
        """Run, or pause; a timer that runs continues."""
        with self._lock:
            if is_needed and self._timer is None:
                self._timer = self._create()
            elif not is_needed and self._timer is not None:
                self._node.destroy_timer(self._timer)
                self._timer = None
