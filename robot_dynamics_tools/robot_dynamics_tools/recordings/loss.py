# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The data that a damaged recording has lost, as figures and as text."""

from typing import NamedTuple

from robot_dynamics.arrays import NANOSECONDS_PER_SECOND


class Loss(NamedTuple):
    """
    The part of one file that cannot be read.

    `reason` describes the damage. `lost_bytes` and `lost_messages` can be
    unknown (None). Messages are missing between the times [ns], which can be unknown (None).
    """

    file: str
    reason: str
    lost_bytes: int | None = None
    lost_messages: int | None = None
    start_ns: int | None = None
    end_ns: int | None = None

    def words(self, origin_ns: int | None = None) -> str:
        """Return the loss as one line, with times [s] since `origin_ns`, or since the epoch."""
        figures = []
        if self.lost_messages is not None:
            figures.append(f'{self.lost_messages} messages')
        if self.lost_bytes is not None:
            figures.append(f'{self.lost_bytes} bytes')
        text = f'{self.file}: {self.reason}'
        if figures:
            text += f'; lost: {", ".join(figures)}'
        if self.start_ns is None and self.end_ns is None:
            return text
        start, end = (None if time is None else (time - (origin_ns or 0)) / NANOSECONDS_PER_SECOND
                      for time in (self.start_ns, self.end_ns))
        if start is None:
            return f'{text}, before {end:.3f} s'
        return f'{text}, from {start:.3f} s ' + ('on' if end is None else f'to {end:.3f} s')
