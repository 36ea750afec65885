# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Detection of streams of set-points and of their timeout.

A single set-point is a pose to reach and hold. Several consecutive set-points, each within the
timeout after the previous one, are a stream, with which the sender steers the arm. When the stream
times out, holding its last set-point would be wrong.
"""

import math

STREAM_LENGTH = 5
"""Consecutive set-points that form a stream; fewer may be corrections of a single set-point."""


class SetPointStream:
    """Is notified of each reference; times [s] are those of a steady clock."""

    def __init__(self, timeout: float = 0.1) -> None:
        self.timeout = timeout
        """[s]; a change takes effect with the next set-point."""
        self._last = -math.inf
        self._in_a_row = 0
        self.deadline = math.inf
        """Time [s] after which a stream has timed out; infinite if there is no stream."""

    def arrived(self, is_set_point: bool, now: float) -> None:
        """Register a reference: a set-point, or a trajectory, which ends any stream."""
        follows = is_set_point and now - self._last <= self.timeout
        self._in_a_row = self._in_a_row + 1 if follows else 1
        self._last = now if is_set_point else -math.inf
        self.deadline = now + self.timeout if self._in_a_row >= STREAM_LENGTH else math.inf

    def end(self) -> None:
        """End the stream."""
        self._in_a_row, self._last, self.deadline = 0, -math.inf, math.inf
