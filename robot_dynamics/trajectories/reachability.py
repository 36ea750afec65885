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
from robot_dynamics.arrays import FloatArray

_LINES = 1e-9
"""Share of the larger coefficient below which a coefficient counts as zero."""
UNBOUNDED = 1e18
"""State that stands for an unbounded one."""
_NEWTON = 24


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
    upper, ahead = _solved(rows.a, rows.b, c), _solved(rows.b, rows.a, c)
    best = _best_ends(rows, c, ahead, caps)
    backwards = _Lines(upper.offset[::-1], upper.slope[::-1])
    controllable = _followed(backwards, best[::-1], caps[::-1])[::-1]
    return _followed(ahead, controllable[:-1], controllable)


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

    They are within [0, caps].
    """
    z = [0.0]
    for offset, slope, top, cap in zip(*lines, tops.tolist(), caps[1:].tolist()):
        z.append(min(cap, max(0.0, float((offset - slope * min(z[-1], top)).min()))))
    return np.array(z)


def _best_ends(
    rows: Rows, c: FloatArray, ahead: _Lines, caps: FloatArray,
) -> FloatArray:
    """
    Return the y (m,) in the polygon from which x is largest.

    The room for y, between its upper bounds and its lower ones, is a concave function of x, and
    not negative at 0. Newton's method finds the largest x with room from above.
    """
    a, b = rows.a, rows.b
    upper = _with_constant(ahead, caps[1:])
    lower = _with_constant(_solved(-b, a, c), np.zeros(len(a)))  # of -y
    flat = (np.abs(b) <= _LINES * np.abs(a)) & (a > 0.0) & np.isfinite(c)
    x = np.minimum(caps[:-1], np.where(flat, c / np.where(flat, a, 1.0), np.inf).min(axis=1))
    for _ in range(_NEWTON):
        y, offset, slope = _smallest(upper, x)
        minus_y, other_offset, other_slope = _smallest(lower, x)
        outside = y + minus_y < 0.0
        if not outside.any():
            break
        root = (offset + other_offset) / np.where(outside, slope + other_slope, 1.0)
        x = np.where(outside, np.clip(root, 0.0, x), x)
    return np.maximum(y, 0.0)


def _with_constant(lines: _Lines, values: FloatArray) -> _Lines:
    """Return the lines with one more line, which is constant, in each row."""
    return _Lines(*(np.column_stack(pair) for pair in zip(lines, (values, 0.0 * values))))


def _smallest(lines: _Lines, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the smallest of the lines at x (m,), its offset and its slope."""
    active = np.argmin(lines.offset - lines.slope * x[:, np.newaxis], axis=1)
    offset, slope = (values[np.arange(len(x)), active] for values in lines)
    return offset - slope * x, offset, slope
