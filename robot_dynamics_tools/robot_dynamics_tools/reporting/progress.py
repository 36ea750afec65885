# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Progress of a job: one line that is redrawn on a terminal, otherwise one line every 10 %.

The library tqdm is not used because it also redraws its line with carriage returns in files and
pipes, where a log needs separate lines.
"""

from contextlib import AbstractContextManager
import sys
import time
from typing import TextIO

WIDTH = 40
REDRAW_PERIOD = 0.1
"""[s]"""


class Progress(AbstractContextManager['Progress']):
    """Shows `done` of `total`, in `unit`, on a stream; for use in `with`."""

    def __init__(self, total: float, unit: str, stream: TextIO | None = None) -> None:
        self._total, self._unit = total, unit
        self._stream = stream if stream is not None else sys.stderr
        self._live = self._stream.isatty()
        self._done = 0.0
        self._shown = -1
        self._drawn = 0.0

    def update(self, done: float) -> None:
        """Show the completed amount; an amount beyond the total counts as the total."""
        self._done = done
        fraction = min(max(done / self._total, 0.0), 1.0) if self._total > 0.0 else 1.0
        if not self._live:
            tenth = int(10 * fraction + 1e-9)
            if tenth > self._shown:
                self._shown = tenth
                print(f'  {10 * tenth:3d} %  {self._figures(fraction)}', file=self._stream,
                      flush=True)
            return
        now = time.monotonic()
        if now - self._drawn >= REDRAW_PERIOD or fraction == 1.0:
            self._drawn = now
            filled = round(WIDTH * fraction)
            bar = '#' * filled + '.' * (WIDTH - filled)
            self._stream.write(
                f'\r  [{bar}] {round(100 * fraction):3d} %  {self._figures(fraction)} ')
            self._stream.flush()

    def advance(self, _: object = None) -> None:
        """Show one more unit, as a callback of jobs that report each step; ignores the report."""
        self.update(self._done + 1)

    def __exit__(self, *_: object) -> None:
        """End the line."""
        if self._live and self._drawn:
            self._stream.write('\n')
            self._stream.flush()

    def _figures(self, fraction: float) -> str:
        digits = 0 if isinstance(self._total, int) else 1
        return f'{fraction * self._total:.{digits}f} / {self._total:.{digits}f} {self._unit}'
