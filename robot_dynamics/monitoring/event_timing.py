# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Timing of repeated events: rate, jitter and late events of the last window."""

import math
from typing import NamedTuple

LATE = 1.5
"""An event is late if its interval is longer than this multiple of the usual interval."""


class Timing(NamedTuple):
    """
    The statistics of the intervals between events in one window.

    `rate` [Hz]; `jitter` [s], the standard deviation of the intervals; `longest` [s].
    """

    rate: float = 0.0
    jitter: float = 0.0
    longest: float = 0.0


class EventTiming:
    """
    Records events and evaluates windows of at least `window` [s]; times are of a steady clock.

    One thread may call `happened` while another calls `look`.
    """

    def __init__(self, now: float, window: float = 1.0) -> None:
        self._window, self._began = window, now
        self._last: float | None = None
        self._usual = math.inf
        self._count, self._sum, self._squares, self._longest = 0, 0.0, 0.0, 0.0
        self.late = 0
        """Events later than 1.5 times the mean interval of the window before."""
        self.timing = Timing()
        """The last complete window."""

    def happened(self, now: float) -> None:
        """Record an event."""
        if self._last is not None:
            interval = now - self._last
            self._count += 1
            self._sum += interval
            self._squares += interval * interval
            self._longest = max(self._longest, interval)
            self.late += interval > LATE * self._usual
        self._last = now

    def last_window(self, now: float) -> Timing:
        """Return the last complete window, which may end now."""
        if now - self._began >= self._window:
            self._sum_up(now)
        return self.timing

    def _sum_up(self, now: float) -> None:
        n, passed = self._count, now - self._began
        if n == 0:
            self.timing, self._usual = Timing(), math.inf
        else:
            mean = self._sum / n
            variance = max(self._squares / n - mean * mean, 0.0)
            self.timing = Timing(n / passed, math.sqrt(variance), self._longest)
            self._usual = mean
        self._count, self._sum, self._squares, self._longest = 0, 0.0, 0.0, 0.0
        self._began = now
