# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The grid of a path, with derivatives by its arc length.

The arc length σ in joint space is a parameter whose derivative of the position is never zero: a
trajectory that starts at rest has q' = 0 at its start, but a direction dq/dσ. Intervals are
narrow where the path bends, and near rests, so that they take about the same time.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.trajectories.path import Path

LEAST_INTERVALS = 1000
"""Intervals of a path without bends, and of shorter parts between rests in proportion."""
_SECTION = 24
_TURN = 0.05
_CAP = 0.1
_SAMPLES = 2048
_RAMPS = np.outer([-1.0, 1.0], 0.5 ** np.arange(1, 7)).ravel()
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


class PathEnd(NamedTuple):
    """Position, dq/dσ and d²q/dσ² at one end of each interval, (m, n) each."""

    q: FloatArray
    tangent: FloatArray
    curvature: FloatArray

    def rows(self, rows: IntArray) -> 'PathEnd':
        """Return the ends of these intervals."""
        return PathEnd(*(values[rows] for values in self))


class PathGrid(NamedTuple):
    """
    The m intervals of a path: their lengths (m,) and both ends.

    `rests` (m + 1,) marks the nodes at which the arm has to rest, where the curvature, which may
    be infinite, is 0. `sign` (m, n) is the direction in which each joint moves in the middle.
    """

    length: FloatArray
    left: PathEnd
    right: PathEnd
    sign: FloatArray
    rests: BoolArray

    def merged(self, keep: BoolArray) -> 'PathGrid':
        """Return the grid with the nodes `keep` (m + 1,) only, which contain both ends."""
        first = np.flatnonzero(keep[:-1])
        last = np.flatnonzero(keep[1:])
        return PathGrid(
            np.add.reduceat(self.length, first), self.left.rows(first), self.right.rows(last),
            self.sign[last], self.rests[keep])


def make_grid(path: Path) -> PathGrid:
    """Return the grid of a path."""
    piece, start, end, rests = _intervals(path)
    middle = 0.5 * (start + end)
    half = 0.5 * (end - start)
    m = len(piece)
    phases = middle[:, np.newaxis] + half[:, np.newaxis] * _NODES
    _, v, _ = path.sample(np.repeat(piece, len(_NODES)), phases.ravel())
    length = half * (np.linalg.norm(v, axis=1).reshape(m, -1) @ _WEIGHTS)
    _, v, _ = path.sample(piece, middle)
    sign = np.sign(np.where(np.abs(v) > 1e-12 * np.abs(v).max(axis=1, keepdims=True), v, 0.0))
    left = _end(path, piece, start, start + 1e-4 * half, rests[:-1])
    right = _end(path, piece, end, end - 1e-4 * half, rests[1:])
    return PathGrid(length, left, right, sign, rests)


def _end(
    path: Path, piece: IntArray, phase: FloatArray, inside: FloatArray, rests: BoolArray,
) -> PathEnd:
    q, v, a = path.sample(piece, phase)
    if rests.any():
        v[rests] = path.sample(piece[rests], inside[rests])[1]
    speed = np.linalg.norm(v, axis=1, keepdims=True)
    tangent = v / speed
    curvature = (a - tangent * (tangent * a).sum(axis=1, keepdims=True)) / speed**2
    curvature[rests] = 0.0
    return PathEnd(q, tangent, curvature)


def _intervals(path: Path) -> tuple[IntArray, FloatArray, FloatArray, BoolArray]:
    """Return the piece, the phases of both ends, and the nodes at rest, of each interval."""
    k = len(path.coefficients)
    samples = max(4, -(-_SAMPLES // k))
    phases = np.linspace(0.0, 1.0, samples + 1)
    middle = 0.5 * (phases[1:] + phases[:-1])
    _, v, _ = path.sample(np.repeat(np.arange(k), samples), np.tile(middle, k))
    speed = np.linalg.norm(v, axis=1)
    direction = v / np.maximum(speed, 1e-300)[:, np.newaxis]
    turn = np.linalg.norm(np.diff(direction, axis=0, append=direction[-1:]), axis=1)
    turn.reshape(k, samples)[:, -1][path.rests[1:]] = 0.0
    density = _density(speed / samples, turn, path.rests).reshape(k, samples)
    counts = np.maximum(np.rint(density.sum(axis=1)), 1.0)
    index = np.concatenate((np.zeros((k, 1)), np.cumsum(density, axis=1)), axis=1)
    index *= (counts / index[:, -1])[:, np.newaxis]
    base = np.concatenate(([0.0], np.cumsum(counts)))
    # One increasing function of the piece and the phase, whose value is whole at each node. The
    # intervals next to rests are divided at halves, quarters and so on.
    rests = base[path.rests]
    values = np.unique(np.clip(np.concatenate(
        [np.arange(base[-1] + 1.0), *(rests + ramp for ramp in _RAMPS)]), 0.0, base[-1]))
    nodes = np.interp(
        values, (index + base[:-1, np.newaxis]).ravel(),
        (phases + np.arange(k)[:, np.newaxis]).ravel())
    piece = np.searchsorted(base, values[:-1], side='right') - 1
    start, end = nodes[:-1] - piece, nodes[1:] - piece
    start[np.isin(values[:-1], base)] = 0.0
    end[np.isin(values[1:], base)] = 1.0
    return piece, start, end, np.isin(values, rests)


def _density(
    step: FloatArray, turn: FloatArray, rests: BoolArray,
) -> FloatArray:
    """Return the number of intervals per sample of the path."""
    along = np.concatenate(([0.0], np.cumsum(step)))
    at = along[:-1] + 0.5 * step
    stops = along[::len(step) // (len(rests) - 1)][rests]
    section = np.clip(np.searchsorted(stops, at, side='right') - 1, 0, len(stops) - 2)
    distance = np.minimum(at - stops[section], stops[section + 1] - at)
    span = np.diff(stops)[section]
    # The time from rest with constant acceleration up to a distance, then with constant speed.
    time = step / np.sqrt(np.clip(distance, 1e-12 * span, _CAP * span))
    per_section = np.bincount(section, time)
    share = np.maximum(LEAST_INTERVALS * per_section / per_section.sum(), _SECTION)
    return np.asarray(time * (share / per_section)[section] + turn / _TURN)
