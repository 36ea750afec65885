# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Labels of contour lines, away from the border of the axes, from one another and from marks."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from robot_dynamics.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.contour import QuadContourSet

_BORDER, _MARK, _LABEL = 0.06, 0.035, 0.1
"""Clearance of a label, as a share of the axes: to the border, a mark, another label."""
_SHORTEST = 0.12
"""Length of the shortest line with a label, as a share of the axes."""


def label_contours(axes: 'Axes', lines: 'QuadContourSet', marks: FloatArray) -> None:
    """
    Label each contour line once where it has room; lines without room get no label.

    `lines` is the contour set on `axes`; `marks` (k, 2) are points, in the coordinates of the
    axes' data, that labels keep away from.
    """
    from matplotlib.patheffects import withStroke
    origin, span = _extent(axes)
    marks = (np.reshape(marks, (-1, 2)) - origin) / span
    taken: list[FloatArray] = []
    for level, line in _pieces(lines):
        points = (line - origin) / span
        if np.ptp(points, axis=0).max() < _SHORTEST:
            continue
        room = _room(points, marks, np.reshape(taken, (-1, 2)))
        best = int(room.argmax())
        if room[best] < 1.0:
            continue
        taken.append(points[best])
        x, y = line[best]
        axes.text(
            x, y, f'{level:g}'.replace('-', '−'), rotation=_slope(points, best),
            ha='center', va='center', fontsize=9, zorder=2.5, gid='contour label',
            path_effects=[withStroke(linewidth=2.5, foreground='white')])


def _extent(axes: 'Axes') -> tuple[FloatArray, FloatArray]:
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    return np.array([left, bottom]), np.array([right - left, top - bottom])


def _pieces(lines: 'QuadContourSet') -> Iterator[tuple[float, FloatArray]]:
    """Yield the level and the points of each connected line of a contour set."""
    for level, pieces in zip(lines.levels, lines.allsegs):
        for piece in pieces:
            if len(piece) > 2:
                yield float(level), np.asarray(piece)


def _room(points: FloatArray, marks: FloatArray, labels: FloatArray) -> FloatArray:
    """Return the smallest ratio of distance to clearance at each point; 1 is enough room."""
    room = np.minimum(points, 1.0 - points).min(axis=1) / _BORDER
    for others, clearance in ((marks, _MARK), (labels, _LABEL)):
        room = np.minimum(room, _distance(points, others) / clearance)
    return np.asarray(room)


def _distance(points: FloatArray, others: FloatArray) -> FloatArray:
    if not len(others):
        return np.full(len(points), np.inf)
    return np.asarray(np.linalg.norm(points[:, None] - others, axis=2).min(axis=1))


def _slope(points: FloatArray, k: int) -> float:
    """Return the direction of a line at a point [degrees], such that text is not upside down."""
    along = points[min(k + 1, len(points) - 1)] - points[max(k - 1, 0)]
    angle = float(np.degrees(np.arctan2(along[1], along[0])))
    return float((angle + 90.0) % 180.0 - 90.0)


def along(line: FloatArray, count: int = 8) -> FloatArray:
    """Return points (·, 2) along a line (k, 2), `count` on each of its segments."""
    return np.concatenate(
        [np.linspace(start, end, count) for start, end in zip(line[:-1], line[1:])])
