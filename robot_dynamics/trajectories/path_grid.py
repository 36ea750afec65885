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
_SAMPLES, _RAMP = 2048, 5
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
    piece, start, end, rests = _with_ramps(path, *_intervals(path))
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
    piece = np.repeat(np.arange(k), counts.astype(np.intp))
    base = np.concatenate(([0.0], np.cumsum(counts)))
    # One increasing function of the piece and the phase, whose value is whole at each node.
    nodes = np.interp(
        np.arange(base[-1] + 1.0), (index + base[:-1, np.newaxis]).ravel(),
        (phases + np.arange(k)[:, np.newaxis]).ravel())
    rests = np.zeros(len(nodes), dtype=np.bool_)
    rests[base.astype(np.intp)] = path.rests
    first = base[:-1].astype(np.intp)
    start, end = nodes[:-1] - piece, nodes[1:] - piece
    start[first] = 0.0
    end[base[1:].astype(np.intp) - 1] = 1.0
    return piece, start, end, rests


def _with_ramps(
    path: Path, piece: IntArray, start: FloatArray, end: FloatArray, rests: BoolArray,
) -> tuple[IntArray, FloatArray, FloatArray, BoolArray]:
    """Divide the intervals next to rests, so that the first one takes 1/32 of their time."""
    pieces, starts, ends, marks = [], [], [], []
    parts = np.arange(_RAMP, 0, -1)
    for i, (one, low, high) in enumerate(zip(piece, start, end)):
        cuts = np.array([low, high])
        for phase, other, at in ((low, high, i), (high, low, i + 1)):
            if rests[at]:
                speed = np.linalg.norm(path.sample(piece[i:i + 1], np.array([phase]))[1])
                inner = np.linalg.norm(path.sample(piece[i:i + 1], np.array([other]))[1])
                ratio = 0.25 if speed > 0.5 * inner else 0.5
                cuts = np.concatenate((cuts, phase + (other - phase) * ratio**parts))
        cuts = np.sort(cuts)
        pieces += [one] * (len(cuts) - 1)
        starts += cuts[:-1].tolist()
        ends += cuts[1:].tolist()
        marks += [rests[i]] + [False] * (len(cuts) - 2)
    return (np.array(pieces), np.array(starts), np.array(ends), np.array([*marks, rests[-1]]))


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
