# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Time-optimal path parametrisation by reachability analysis (TOPP-RA), on all intervals at once.

With the state x = σ̇² and the mean control u = σ̈ of an interval of length Δ, x changes by 2 Δ u.
The constraints of an interval are linear in the states x and y at its ends, because
u = (y − x) / (2 Δ); constraints at both ends are those of collocation (section III). Each interval
has therefore a polygon of (x, y). Because the arm can move arbitrarily slowly (x = y = 0 is in the
polygon), the controllable sets are intervals [0, h], and the largest x from which y is reached is
a concave function of y, whose maximum does not depend on the other intervals.

Source: H. Pham, Q.-C. Pham, "A new approach to time-optimal path parameterization based on
reachability analysis", IEEE Transactions on Robotics 34(3), 2018: algorithm 1, with
the linear programs of both passes in closed form.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray

_LINES = 1e-9
"""Share of the larger coefficient below which a coefficient counts as zero."""
UNBOUNDED = 1e18
"""State that stands for an unbounded one."""
_CUTS, _NEWTON = 24, 24


class Rows(NamedTuple):
    """Constraints a x + b y <= c of the states at both ends of m intervals, (m, k) each."""

    a: FloatArray
    b: FloatArray
    c: FloatArray


def fastest_states(rows: Rows, caps: FloatArray) -> FloatArray:
    """
    Return the largest states x (m + 1,) from rest to rest.

    `caps` (m + 1,) are the largest states, 0 where the arm rests. The state is about UNBOUNDED
    where no constraint applies.
    """
    caps = np.minimum(caps, UNBOUNDED)
    c = np.maximum(rows.c, 0.0)
    upper = _solved(rows.a, rows.b, c)
    best = _best_ends(rows, c, upper, caps)
    backwards = _Lines(upper.offset[::-1], upper.slope[::-1])
    controllable = _followed(backwards, best[::-1], caps[::-1])[::-1]
    return _followed(_solved(rows.b, rows.a, c), controllable[:-1], controllable)


class _Lines(NamedTuple):
    """Lines offset − slope · z, (m, k), of which the smallest is a bound; infinite for none."""

    offset: FloatArray
    slope: FloatArray


def _solved(a: FloatArray, b: FloatArray, c: FloatArray) -> _Lines:
    """Return the upper bounds of x in a x + b y <= c as lines of y."""
    applies = (a > _LINES * np.abs(b)) & np.isfinite(c)
    divisor = np.where(applies, a, 1.0)
    return _Lines(np.where(applies, c / divisor, 1e3 * UNBOUNDED),
                  np.where(applies, b / divisor, 0.0))


def _followed(lines: _Lines, tops: FloatArray, caps: FloatArray) -> FloatArray:
    """
    Return the states z (m + 1,) from z = 0 on: the smallest line of each interval at min(z, top).

    They are within [0, caps]. Each round takes the lines that are the smallest at the states of
    the round before (policy iteration, R. A. Howard, 1960), from the first one that differs on.
    The states before it are final, so that the rounds end, and the result is exact.
    """
    m = len(tops)
    active, z = np.full(m, -1), [0.0, *caps[1:].tolist()]
    most, limits = tops.tolist(), caps.tolist()
    first, last = 0, m
    while True:
        part = slice(first, last)
        y = np.minimum(z[part], tops[part])[:, np.newaxis]
        smallest = np.argmin(lines.offset[part] - lines.slope[part] * y, axis=1)
        changed = first + np.flatnonzero(smallest != active[part])
        if not len(changed):
            return np.array(z)
        active[part] = smallest
        rows = np.arange(changed[0], m)
        offset, slope = (of[rows, active[rows]].tolist() for of in lines)
        first, end, now = int(changed[0]), int(changed[-1]), z[changed[0]]
        for last, o, s in zip(range(first + 1, m + 1), offset, slope):
            now = min(limits[last], max(0.0, o - s * min(now, most[last - 1])))
            if last > end + 1 and now == z[last]:
                break
            z[last] = now


def _at(
    lines: _Lines, y: FloatArray, rows: IntArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the smallest of the lines of these rows at y (rows,), its offset and its slope."""
    offset, slope = (lines.offset, lines.slope) if len(rows) == len(lines.offset) else (
        lines.offset[rows], lines.slope[rows])
    active = np.argmin(offset - slope * y[:, np.newaxis], axis=1)
    numbers = np.arange(len(rows))
    offset, slope = offset[numbers, active], slope[numbers, active]
    return offset - slope * y, offset, slope


def _best_ends(
    rows: Rows, c: FloatArray, upper: _Lines, caps: FloatArray,
) -> FloatArray:
    """Return the y (m,) in the polygon from which x is largest."""
    a, b = rows.a, rows.b
    finite = np.isfinite(c)
    flat = (np.abs(a) <= _LINES * np.abs(b)) & (b > 0.0) & finite
    top = np.where(flat, c / np.where(flat, b, 1.0), np.inf).min(axis=1, initial=np.inf)
    high = np.minimum(top, caps[1:])
    upper = _Lines(np.concatenate((upper.offset, caps[:-1, np.newaxis]), axis=1),
                   np.concatenate((upper.slope, np.zeros((len(high), 1))), axis=1))
    best = _argmax(upper, high)
    # x >= (b y − c) / −a, and x >= 0; the excess of the upper bound is concave.
    below = (a < -_LINES * np.abs(b)) & finite
    divisor = np.where(below, -a, 1.0)
    negative = _Lines(
        np.concatenate((np.where(below, c / divisor, 0.0), np.zeros((len(high), 1))), axis=1),
        np.concatenate((np.where(below, b / divisor, 0.0), np.zeros((len(high), 1))), axis=1))
    rows_left = np.arange(len(best))
    for _ in range(_NEWTON):
        y = best[rows_left]
        value, offset, slope = _at(upper, y, rows_left)
        lower, other_offset, other_slope = _at(negative, y, rows_left)
        outside = value + lower < 0.0
        if not outside.any():
            break
        total = (slope + other_slope)[outside]
        root = (offset + other_offset)[outside] / np.where(total > 0.0, total, 1.0)
        rows_left = rows_left[outside]
        best[rows_left] = np.where(total > 0.0, np.clip(root, 0.0, y[outside]), 0.0)
    return best


def _argmax(lines: _Lines, high: FloatArray) -> FloatArray:
    """Return where in [0, high] the smallest of the lines is largest, by cutting planes."""
    best = high.copy()
    _, right, fall = _at(lines, high, np.arange(len(high)))
    rows = np.flatnonzero(fall > 0.0)
    _, left, rise = _at(lines, np.zeros(len(rows)), rows)
    best[rows[rise > 0.0]] = 0.0
    inside = rise <= 0.0
    rows, left, rise = rows[inside], left[inside], rise[inside]
    right, fall = right[rows], fall[rows]
    for _ in range(_CUTS):
        if not len(rows):
            break
        # The lines on both sides intersect at an upper bound of the maximum.
        y = np.clip((right - left) / (fall - rise), 0.0, high[rows])
        best[rows] = y
        value, offset, slope = _at(lines, y, rows)
        open_ = value < (left - rise * y) * (1.0 - 1e-12) - 1e-15
        rises = slope <= 0.0
        left, rise = np.where(rises, offset, left)[open_], np.where(rises, slope, rise)[open_]
        right, fall = np.where(rises, right, offset)[open_], np.where(rises, fall, slope)[open_]
        rows = rows[open_]
    return best
