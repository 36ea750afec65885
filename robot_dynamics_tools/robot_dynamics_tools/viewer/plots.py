# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The live plots of the viewer: effort by term and tracking error of a joint."""

from collections import deque
from collections.abc import Sequence
from typing import Any, TYPE_CHECKING

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics_tools.reporting.figures import LABELS, LINES, PURPLE

if TYPE_CHECKING:
    import viser

SHOWN = 15.0
"""[s]"""
TERMS = ('effort', 'gravity', 'inertial', 'coriolis', 'friction', 'external')
COLOURS = {
    'gravity': '#8C510A', 'inertial': '#332288', 'coriolis': '#882255', 'friction': '#999933',
    'external': PURPLE, 'error': '#9600F0'}
"""
Colours of lines: no mark at the arm has one, except the same quantity.

In CIELAB, the violet is at least 30 from every other colour, also for the colour blind.
"""
HEIGHT = 230
"""[px]"""
MARGIN = 0.1
"""Margin above and below the values, as a fraction of their span."""
X_SCALE = {'x': {'time': False, 'range': (-SHOWN, 0.0)}}


class LivePlot:
    """One chart: lines over the last SHOWN seconds."""

    def __init__(
        self, gui: 'viser.GuiApi', title: str, names: Sequence[str], least_span: float = 1.0,
        nothing: str = 'no data',
    ) -> None:
        """
        Draw an empty chart.

        `title` has the unit of all lines; it ends with `nothing` while there are no values. The
        axis spans at least `least_span`.
        """
        self._title, self._nothing, self._least_span = title, nothing, least_span
        self._rows: deque[tuple[float, ...]] = deque()
        series: list[dict[str, Any]] = [{'label': 't [s]'}]
        for name in names:
            style = LINES[name]
            line: dict[str, Any] = {
                'label': LABELS.get(name, name), 'stroke': COLOURS.get(name, style.colour),
                'width': style.width}
            if not isinstance(style.dash, str):
                line['dash'] = [2.0 * length for length in style.dash[1]]
            series.append(line)
        self._width = 1 + len(names)
        self._handle = gui.add_uplot(
            tuple(np.zeros((self._width, 0))), tuple(series), title=title, height=HEIGHT,
            scales=self._scales(np.zeros((1, len(names)))),
            axes=({'label': 'time before now [s]', 'labelSize': 18}, {'size': 64}),
            legend={'show': len(names) > 1})

    def add(self, time: float, values: Sequence[float]) -> None:
        """Add the values of all lines at a time [s]; if it goes back, clear the chart."""
        if self._rows and time <= self._rows[-1][0]:
            if time == self._rows[-1][0]:
                return
            self._rows.clear()
        self._rows.append((time, *values))

    def show(self, now: float) -> None:
        """Draw the values that are not older than SHOWN at `now` [s]."""
        while self._rows and self._rows[0][0] < now - SHOWN:
            self._rows.popleft()
        rows: FloatArray = np.array(self._rows).reshape(-1, self._width)
        rows[:, 0] -= now
        self._handle.data = tuple(np.ascontiguousarray(column) for column in rows.T)
        self._handle.title = self._title if len(rows) else f'{self._title}: {self._nothing}'
        if len(rows):
            self._handle.scales = self._scales(rows[:, 1:])

    def _scales(self, values: FloatArray) -> dict[str, Any]:
        low, high = float(values.min()), float(values.max())
        span = max(high - low, self._least_span)
        middle, half = 0.5 * (low + high), (0.5 + MARGIN) * span
        return {**X_SCALE, 'y': {'range': (middle - half, middle + half)}}

    def remove(self) -> None:
        """Remove the chart."""
        self._handle.remove()
