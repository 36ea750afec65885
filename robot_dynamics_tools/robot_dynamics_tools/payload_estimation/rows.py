# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Regression rows of single joints: averages over blocks of motion and over holds.

r = Y π is linear, so that averages of r and Y over time satisfy it too. Filtered samples are not
independent, averages over `block` seconds nearly are. A joint at rest is different: dry friction
has an unknown value that stays the same during the rest, so that a rest is one observation,
however long it lasts. The filter mixes the friction before and after a velocity reversal: the
samples after it and the last block before it are discarded, and so are the first and the last of a
rest.

Dry friction at rest has the direction of the last displacement, however slow it was. An arm that
sags after its motion has stopped moves in the opposite direction at less than REST_VELOCITY. The
direction is therefore determined from the position, and a rest ends where it changes.
"""

from collections import deque
from dataclasses import dataclass
from itertools import chain

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.model.regressor import COUNT

REST_VELOCITY = 0.01
"""Velocity [rad/s] or [m/s] below which a joint is at rest."""
SLIDING_VELOCITY = 0.03
"""Velocity [rad/s] or [m/s] from which the direction of dry friction is known."""
SHORTEST_REST = 0.3
"""Shortest rest [s] that is an observation."""
MOST_RESTS = 200
"""Number of rests that are kept per joint; older ones are discarded."""
REVERSAL = 5e-4
"""Displacement [rad] or [m] after which the direction of motion has changed."""
LARGEST_GAP = 0.5
"""[s] between two samples from which on the motion between them is unknown."""
COLUMNS = COUNT + 7
"""Number of columns of a row, before those of the errors of the model, if these are known."""
_SQUARE, _SAMPLES, _TIME, _POSITION = range(-4, 0)
"""Further columns of the sums over a block or a rest; the last two are of its last sample."""
_STANDSTILL = 0.2 * REVERSAL
_REST, _BETWEEN = 0, 2


class Column:
    """Columns of a row after Y: velocity, its sign, rate of the effort, …, effort of the URDF."""

    VELOCITY, SIGN, RATE, RESIDUAL, EFFORT, ONE, RIGID = range(COUNT, COLUMNS)


@dataclass(frozen=True, eq=False)
class Rest:
    """
    The average over a rest of one joint, [N·m] or [N].

    `row` (c,) has at least COLUMNS; `variance` is that of the residual between samples, `duration`
    is in [s]. `approach` is the direction of the last displacement, ±1, or 0 if unknown. Rests
    with one `stay` of a joint are parts of one uninterrupted rest. `position` (n,) is that of the
    arm.
    """

    joint: int
    row: FloatArray
    variance: float
    duration: float
    approach: int
    stay: int
    position: FloatArray


@dataclass(frozen=True, eq=False)
class LoadRows:
    """
    All observations: sums over the blocks of motion, and the rests.

    `gram` and `lagged` (n, c, c) are Σ z zᵀ of the rows z and Σ z₁ z₂ᵀ of consecutive
    rows, of which there are `count` and `pairs` (n,). `duration` is in [s]; `holds` counts the
    holds, in which all joints were at rest.
    """

    gram: FloatArray
    lagged: FloatArray
    count: FloatArray
    pairs: FloatArray
    rests: tuple[Rest, ...]
    duration: float
    holds: int


class RowBuilder:
    """Forms the rows of n joints from samples in the order of time, in constant memory."""

    def __init__(self, joint_count: int, block: float, columns: int = COLUMNS) -> None:
        """Average over `block` [s]; discard as much after a change of direction."""
        n = joint_count
        self._block, self.columns = block, columns
        self._gram, self._lagged = np.zeros((2, n, columns, columns))
        self._count, self._pairs = np.zeros((2, n))
        self._rests = [deque[Rest](maxlen=MOST_RESTS) for _ in range(n)]
        self._holds, self._duration = 0, 0.0
        self._approach = np.zeros(n, dtype=np.intp)
        self._stay = np.zeros(n, dtype=np.intp)
        self._begin_stretch()

    def restart(self) -> None:
        """Begin a new stretch of samples, after a gap."""
        self._holds += self._is_held()
        self._finish_rests(np.ones(len(self._count), dtype=np.bool_))
        self._begin_stretch()

    def _begin_stretch(self) -> None:
        n, columns = self._gram.shape[:2]
        self._kind: IntArray = np.full(n, _BETWEEN)
        self._since = np.full(n, -np.inf)
        self._begin, self._begin_position, self._time = np.zeros(n), np.zeros(n), -np.inf
        # the sums, and those of a rest one or two blocks ago
        self._sums, self._recent, self._settled = np.zeros((3, n, columns + 4))
        self._previous, self._pending = np.full((2, n, columns), np.nan)
        self._is_hold = False
        self._position, self._effort = np.zeros((2, n))
        self._low, self._high = np.full(n, np.inf), np.full(n, -np.inf)
        self._approach[:] = 0
        self._stay += 1

    def add(self, t: float, q: FloatArray, v: FloatArray, moving: FloatArray,
            resting: FloatArray) -> None:
        """
        Take a sample at the time t [s] with the position and velocity (n,).

        `moving` and `resting` (n, c) are the rows of joints that slide and rest, which
        differ in the friction of the model. Their RATE is determined here.
        """
        if not 0.0 < t - self._time <= LARGEST_GAP and np.isfinite(self._time):
            self.restart()
        dt, self._time = t - self._time if np.isfinite(self._time) else 0.0, t
        self._duration += dt
        if dt > 0.0:
            moving[:, Column.RATE] = (moving[:, Column.EFFORT] - self._effort) / dt
        self._effort = moving[:, Column.EFFORT]
        self._change_kind(t, q, v)
        is_rest = self._kind == _REST
        used = (self._kind != _BETWEEN) & (t - self._since >= self._block)
        z = np.where(is_rest[:, None], resting, moving)
        is_first = used & (self._sums[:, _SAMPLES] == 0.0)
        self._begin = np.where(is_first, t, self._begin)
        self._begin_position = np.where(is_first, q, self._begin_position)
        self._sums[used, :_SQUARE] += z[used]
        self._sums[used, _SQUARE] += z[used, Column.RESIDUAL]**2
        self._sums[used, _SAMPLES] += 1.0
        self._sums[used, _TIME], self._sums[used, _POSITION] = t, q[used]
        self._position = q
        is_done = used & (self._sums[:, _SAMPLES] > 1.0)
        self._finish_blocks(is_done & ~is_rest & (t - self._begin >= self._block))
        begin = np.maximum(self._recent[:, _TIME], self._begin)
        done = is_done & is_rest & (t - begin >= self._block)
        self._settled[done], self._recent[done] = self._recent[done], self._sums[done]

    def rows(self) -> LoadRows:
        """Return all observations, with those of the current rest."""
        current = [self._rest(j) for j in np.flatnonzero(self._is_complete()).tolist()]
        return LoadRows(
            self._gram.copy(), self._lagged.copy(), self._count.copy(), self._pairs.copy(),
            (*chain(*self._rests), *current), self._duration, self._holds + self._is_held())

    def _change_kind(self, t: float, q: FloatArray, v: FloatArray) -> None:
        speed = np.abs(v)
        kind = np.where(speed < REST_VELOCITY, _REST, np.where(
            speed >= SLIDING_VELOCITY, np.sign(v), _BETWEEN)).astype(np.intp)
        direction = self._direction(q)
        is_reversed = (direction != self._approach) & (kind == _REST) & (self._approach != 0)
        is_other = (kind != self._kind) | is_reversed
        is_hold = bool((kind == _REST).all())
        ended = (self._kind == _REST) & (is_other | (is_hold != self._is_hold))
        self._holds += not is_hold and self._is_held()
        moved = (self._settled[:, _POSITION] - self._begin_position) * self._approach
        self._finish_rests(ended & ~(is_reversed & (moved < -_STANDSTILL)))
        # Friction at rest changes with the load, when the others begin to move.
        is_unknown = (kind == _REST) & (self._kind == _REST) & (self._is_hold and not is_hold)
        self._approach = np.where(is_unknown, 0, direction)
        self._low, self._high = (
            np.where(is_unknown, q, bound) for bound in (self._low, self._high))
        self._stay = self._stay + (is_other & (kind == _REST))
        cleared = is_other | ended
        self._sums[cleared] = self._recent[cleared] = self._settled[cleared] = 0.0
        self._previous[cleared], self._pending[cleared] = np.nan, np.nan
        self._since = np.where(cleared, t, self._since)
        self._kind, self._is_hold = kind, is_hold

    def _direction(self, q: FloatArray) -> IntArray:
        """Return the directions (n,) of the last displacements by REVERSAL, 0 if unknown."""
        self._low, self._high = np.minimum(self._low, q), np.maximum(self._high, q)
        rises, falls = q - self._low >= REVERSAL, self._high - q >= REVERSAL
        if rises.any() or falls.any():
            self._low, self._high = np.where(rises | falls, q, self._low), np.where(
                rises | falls, q, self._high)
        return np.where(rises, 1, np.where(falls, -1, self._approach))

    def _finish_blocks(self, done: BoolArray) -> None:
        """Keep the block before each; filters mix the last one with the friction after it."""
        if not done.any():
            return
        self._commit(done & np.isfinite(self._pending[:, 0]))
        sums = self._sums[done]
        self._pending[done] = sums[:, :_SQUARE] / sums[:, _SAMPLES, None]
        self._sums[done] = 0.0

    def _commit(self, done: BoolArray) -> None:
        rows, before = self._pending[done], self._previous[done]
        self._gram[done] += rows[:, :, None] * rows[:, None, :]
        self._count[done] += 1.0
        has_before = np.isfinite(before[:, 0])
        joints = np.flatnonzero(done)[has_before]
        self._lagged[joints] += before[has_before, :, None] * rows[has_before, None, :]
        self._pairs[joints] += 1.0
        self._previous[done] = rows

    def _is_held(self) -> bool:
        return self._is_hold and bool(self._is_complete().all())

    def _is_complete(self) -> BoolArray:
        return np.asarray((self._kind == _REST) & (
            self._settled[:, _TIME] - self._begin >= SHORTEST_REST))

    def _finish_rests(self, ended: BoolArray) -> None:
        for j in np.flatnonzero(ended & self._is_complete()).tolist():
            self._rests[j].append(self._rest(j))

    def _rest(self, j: int) -> Rest:
        sums = self._settled[j]
        row = sums[:_SQUARE] / sums[_SAMPLES]
        row[Column.SIGN] = self._approach[j]
        variance = max(sums[_SQUARE] / sums[_SAMPLES] - row[Column.RESIDUAL]**2, 0.0)
        return Rest(
            j, row, float(variance), float(sums[_TIME] - self._begin[j]),
            int(self._approach[j]), int(self._stay[j]), self._position)
