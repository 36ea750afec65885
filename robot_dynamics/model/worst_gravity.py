# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The largest gravity effort of each joint in the workspace.

As a function of a single position q_j, g_i(q) is a + b cos q_j + c sin q_j if joint j turns, and
a + b q_j if it slides (the potential energy is a sum of products of such functions). Three values
therefore give its exact maximum along q_j. The search iterates over the coordinates, from several
starts, until there is no increase. If mimic joints follow a coordinate, this form is an
approximation; each position is only used if its effort is larger.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody

UNLIMITED_TRAVEL = 1.0
"""Assumed range [m] of a prismatic joint without a limit, in each direction."""
_CONVERGED = 1e-9


class Search(NamedTuple):
    """The effort of the search: sampled positions, starts per joint, rounds over the joints."""

    samples: int
    starts: int
    rounds: int


QUICK = Search(samples=128, starts=4, rounds=6)
"""The search of a starting node."""
BRIEF = Search(samples=64, starts=1, rounds=2)
"""The search for whole robots, because the work grows with the square of the joint count."""
THOROUGH = Search(samples=512, starts=4, rounds=10)
"""The search of the offline tools."""


class WorstGravity(NamedTuple):
    """The largest gravity effort |g_i| (n,) of each joint, and the positions of it (n, n)."""

    effort: FloatArray
    position: FloatArray


def search_box(arm: ArmModel) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and highest position, each (n,), limited to a finite range of one turn."""
    low, high = arm.limits.lower.copy(), arm.limits.upper.copy()
    for i, kind in enumerate(arm.joint_kinds):
        if kind == 'prismatic':
            low[i] = low[i] if np.isfinite(low[i]) else min(-UNLIMITED_TRAVEL, high[i])
            high[i] = high[i] if np.isfinite(high[i]) else max(UNLIMITED_TRAVEL, low[i])
        elif not high[i] - low[i] < 2.0 * np.pi:
            start = min(max(-np.pi, low[i]), high[i] - 2.0 * np.pi)
            low[i], high[i] = start, start + 2.0 * np.pi
    return low, high


def sample_positions(arm: ArmModel, count: int) -> FloatArray:
    """
    Return positions (count, n) spread evenly over the limits; they are deterministic.

    The additive recurrence R_n of M. Roberts, *The unreasonable effectiveness of quasirandom
    sequences*, 2018: steps are powers of 1/φ_n, with φ_n the root of x^(n+1) = x + 1.
    """
    n = arm.joint_count
    phi = 2.0
    for _ in range(60):
        phi = (1.0 + phi) ** (1.0 / (n + 1))
    steps = phi ** -np.arange(1.0, n + 1.0)
    low, high = search_box(arm)
    fraction = (0.5 + np.arange(1, count + 1)[:, None] * steps) % 1.0
    return np.asarray(low + fraction * (high - low))


def worst_gravity(arm: ArmModel, search: Search = THOROUGH) -> WorstGravity:
    """Return the largest gravity efforts within the position limits."""
    return _Ascent(arm, search).climb()


class _Ascent:
    """Maximises |g_i| for all joints i simultaneously, from several starts each."""

    def __init__(self, arm: ArmModel, search: Search) -> None:
        self._arm, self._search = arm, search
        self._body = RigidBody(arm)
        self._low, self._high = search_box(arm)
        self._slides = np.array([kind == 'prismatic' for kind in arm.joint_kinds])
        self._related = _related(arm)

    def climb(self) -> WorstGravity:
        n, starts = self._arm.joint_count, self._search.starts
        q = sample_positions(self._arm, self._search.samples)
        best = np.argsort(-np.abs(self._body.gravity_batch(q)), axis=0, kind='stable')[:starts]
        starts = len(best)
        self._joint = np.repeat(np.arange(n), starts)
        self._q = q[best.T.ravel()]
        self._value = self._own_gravity(self._q, self._joint)
        growing = np.ones(len(self._q), dtype=bool)
        for _ in range(self._search.rounds):
            before = np.abs(self._value)
            for j in range(n):
                self._along(j, np.flatnonzero(growing & self._related[self._joint, j]))
            growing = np.abs(self._value) - before > _CONVERGED * (1.0 + before)
            if not growing.any():
                break
        value = np.abs(self._value).reshape(n, starts)
        top = value.argmax(axis=1)
        return WorstGravity(
            value[np.arange(n), top], self._q.reshape(n, starts, n)[np.arange(n), top])

    def _along(self, j: int, rows: IntArray) -> None:
        """Move these climbers along q_j to the largest |g_i| there."""
        if not rows.size or self._low[j] == self._high[j]:
            return
        candidates = self._candidates(j, rows)
        count = candidates.shape[1]
        q = np.repeat(self._q[rows][:, None], count, axis=1)
        q[:, :, j] = candidates
        value = self._own_gravity(
            q.reshape(-1, q.shape[2]), np.repeat(self._joint[rows], count)).reshape(-1, count)
        best = np.abs(value).argmax(axis=1)
        each = np.arange(rows.size)
        better = np.abs(value[each, best]) > np.abs(self._value[rows])
        self._q[rows[better]] = q[each, best][better]
        self._value[rows[better]] = value[each, best][better]

    def _candidates(self, j: int, rows: IntArray) -> FloatArray:
        """Return candidates of the largest |g_i| along q_j, one row per climber."""
        low, high = self._low[j], self._high[j]
        ends = np.tile([low, high], (rows.size, 1))
        if self._slides[j]:
            return ends
        here = self._q[rows, j]
        third = 2.0 * np.pi / 3.0
        shifted = np.repeat(self._q[rows], 2, axis=0)
        shifted[:, j] += np.tile([third, -third], rows.size)
        joints = np.repeat(self._joint[rows], 2)
        after, back = self._own_gravity(shifted, joints).reshape(-1, 2).T
        # f(x) = a + b cos(x − here) + c sin(x − here) through its three values.
        a = (self._value[rows] + after + back) / 3.0
        b = self._value[rows] - a
        c = (after - back) / np.sqrt(3.0)
        crest = here + np.arctan2(c, b)
        inner = np.column_stack([crest, crest + np.pi])
        inner = low + (inner - low) % (2.0 * np.pi)
        return np.column_stack([ends, np.where(inner <= high, inner, low)])

    def _own_gravity(self, q: FloatArray, joints: IntArray) -> FloatArray:
        return np.asarray(self._body.gravity_batch(q)[np.arange(len(q)), joints])


def _related(arm: ArmModel) -> BoolArray:
    """Return which g_i may depend on q_j, (n, n): one of the two joints moves the other."""
    model = arm.pinocchio_model
    above = np.zeros((model.nv, model.nv))
    for joint in range(1, model.njoints):
        for ancestor in list(model.supports[joint])[1:]:
            above[model.joints[joint].idx_v, model.joints[ancestor].idx_v] = 1.0
    used = (arm.coordinates.G != 0.0).astype(np.float64)
    return np.asarray(used.T @ (above + above.T) @ used > 0.0)
