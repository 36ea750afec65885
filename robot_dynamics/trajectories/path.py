# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The geometric path of a trajectory: pieces of polynomials, and where the arm has to rest.

A trajectory with velocities is its own path. The path of a trajectory without velocities is a
cubic spline through its points, C. de Boor, A Practical Guide to Splines, 2001, chapter IV, which
is interrupted at corners; the corners are rejected, or replaced with quintics between lines.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.trajectories.extrema import derivative
from robot_dynamics.trajectories.interpolation import position_coefficients
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory
from robot_dynamics.trajectories.segments import sample_pieces, TrajectorySegments

CORNER_ANGLE = 0.35
"""Change of direction [rad] in joint space above which a point is a corner of its path."""
LINE_DISTANCE = 0.005
"""Distance [rad] or [m] up to which the spline through points may be away from their lines."""
TURN_BACK = 2.8
"""Change of direction [rad] above which a corner is not rounded: the path rests at the point."""
STILL = 1e-9
"""Length [rad] or [m] up to which a piece of a path does not count as motion."""
_SIMPLIFIED = 0.25
_REST, _NOISE, _BISECTIONS, _SAMPLES = 1e-6, 1e-11, 50, 9
_ORDERS = np.arange(6)
_BINOMIAL = np.array([[1.0, 1, 1, 1, 1, 1], [0, 1, 2, 3, 4, 5], [0, 0, 1, 3, 6, 10],
                      [0, 0, 0, 1, 4, 10], [0, 0, 0, 0, 1, 5], [0, 0, 0, 0, 0, 1]])


class Path(NamedTuple):
    """
    A path of k pieces: `coefficients` (k, 6, n) of 1, p, …, p⁵ with the phase p in [0, 1].

    `rests` (k + 1,) marks the ends of pieces at which the arm has to rest: both ends of the path,
    and each point where its derivative by the phase is zero, or its direction changes.
    """

    coefficients: FloatArray
    rests: BoolArray

    def sample(
        self, piece: IntArray, phase: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position and its first two derivatives by the phase, (m, n) each."""
        return sample_pieces(self.coefficients[piece], phase)


def path_of(trajectory: JointTrajectory, corner_tolerance: float = 0.0) -> Path:
    """
    Return the path of a trajectory of several points.

    With velocities at all points it is the interpolated motion. Without velocities it is a smooth
    path through the points, within LINE_DISTANCE of the lines between them. With a
    `corner_tolerance` [rad] or [m] it passes the points within this distance.
    Raises TrajectoryError, naming the point, for a corner if `corner_tolerance` is 0, for a path
    without motion, and if only some points have velocities.
    """
    points = trajectory.points
    if len(points) < 2:
        raise TrajectoryError(f'points has {len(points)} point, expected at least 2: a path')
    has_velocity = [point.velocity is not None for point in points]
    if any(has_velocity) and not all(has_velocity):
        raise TrajectoryError(
            f'points[{has_velocity.index(False)}].velocities is empty, but '
            f'points[{has_velocity.index(True)}] has velocities, expected velocities at all '
            'points or at none')
    if all(has_velocity):
        coefficients = TrajectorySegments(trajectory).coefficients
    else:
        coefficients = _through_points(trajectory, corner_tolerance)
    coefficients = _split_at_rests(_without_rounding(coefficients))
    c = coefficients[np.abs(coefficients[:, 1:]).sum(axis=1).max(axis=1) > STILL]
    if len(c) == 0:
        raise TrajectoryError(
            f'points are all at the same position {points[0].position.tolist()}, expected a path '
            'with motion')
    return Path(c, _rests(c))


def _without_rounding(c: FloatArray) -> FloatArray:
    """Return the pieces, in which joints that move by rounding errors only do not move."""
    c = c.copy()
    moved = np.abs(c[:, 1:]).sum(axis=1)
    still = moved.sum(axis=0) < STILL
    c[:, 0, still] = c[0, 0, still]
    c[:, 1:] = np.where((still | (moved < _NOISE))[:, np.newaxis], 0.0, c[:, 1:])
    return c


def _rests(c: FloatArray) -> BoolArray:
    d = derivative(c)
    start, end = np.linalg.norm(d[:, 0], axis=1), np.linalg.norm(d.sum(axis=1), axis=1)
    largest = np.linalg.norm(np.abs(d).sum(axis=1), axis=1)
    rests = np.ones(len(c) + 1, dtype=np.bool_)
    # The unit directions (k, n) just inside of both ends.
    inside = (sample_pieces(c, np.full(len(c), phase))[1] for phase in (1e-4, 1.0 - 1e-4))
    first, last = (
        v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-300) for v in inside)
    turn = np.linalg.norm(first[1:] - last[:-1], axis=1)
    rests[1:-1] = (end < _REST * largest)[:-1] | (start < _REST * largest)[1:] | (turn > 0.01)
    return rests


def _split_at_rests(c: FloatArray) -> FloatArray:
    """Return the pieces, split where all joints have the velocity 0 inside of a piece."""
    phases, k = np.linspace(0.0, 1.0, _SAMPLES), len(c)
    _, v, a = sample_pieces(np.repeat(c, _SAMPLES, axis=0), np.tile(phases, k))
    at = (v * a).sum(axis=1).reshape(k, -1)
    largest = np.linalg.norm(np.abs(derivative(c)).sum(axis=1), axis=1)
    slow = np.linalg.norm(v, axis=1).reshape(k, -1) < 0.5 * largest[:, np.newaxis]
    piece, i = np.nonzero((at[:, :-1] < 0.0) & (at[:, 1:] >= 0.0) & slow[:, :-1] & slow[:, 1:])
    low, high = phases[i], phases[i + 1]
    for _ in range(_BISECTIONS if len(piece) else 0):
        middle = 0.5 * (low + high)
        _, v, a = sample_pieces(c[piece], middle)
        before = (v * a).sum(axis=1) < 0.0
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    speed = np.linalg.norm(sample_pieces(c[piece], high)[1], axis=1)
    inside = (speed < _REST * largest[piece]) & (high > 1e-6) & (high < 1.0 - 1e-6)
    pieces = []
    for one in range(k) if inside.any() else ():
        cuts = [0.0, *high[inside & (piece == one)], 1.0]
        pieces += [_part(c[one], a, b) for a, b in zip(cuts[:-1], cuts[1:])]
    return np.array(pieces) if pieces else c


def _part(c: FloatArray, start: float, end: float) -> FloatArray:
    """Return the coefficients (6, n) of the part of a piece between two phases."""
    powers = start ** np.maximum(_ORDERS[np.newaxis, :] - _ORDERS[:, np.newaxis], 0)
    part: FloatArray = ((end - start) ** _ORDERS)[:, np.newaxis] * ((_BINOMIAL * powers) @ c)
    return part


# ---------------------------------------------------------------------- paths without velocities

def _through_points(trajectory: JointTrajectory, tolerance: float) -> FloatArray:
    q: FloatArray = np.array([point.position for point in trajectory.points])
    kept = np.concatenate(([True], np.linalg.norm(np.diff(q, axis=0), axis=1) > STILL))
    numbers = np.flatnonzero(kept)
    if len(numbers) < 2:
        return np.zeros((1, 6, q.shape[1]))
    if tolerance > 0.0:
        numbers = numbers[_simplified(q[numbers], _SIMPLIFIED * tolerance)]
        curve = _Curve.through(q[numbers], min(LINE_DISTANCE, 0.5 * tolerance))
        return _rounded(curve, (1.0 - _SIMPLIFIED) * tolerance)
    curve = _Curve.through(q[numbers], LINE_DISTANCE)
    if len(curve.corners):
        raise _corner(curve, numbers, trajectory.joint_names)
    return curve.coefficients


class _Curve(NamedTuple):
    """
    Splines through m points, with corners between them.

    `coefficients` (m - 1, 6, n), one piece per line; the length of each line; the numbers of the
    points that are corners; and the change of the direction (m - 2, n) at the points between.
    """

    coefficients: FloatArray
    length: FloatArray
    corners: IntArray
    turn: FloatArray

    @classmethod
    def through(cls, q: FloatArray, line_distance: float) -> '_Curve':
        """Return the splines, which are within a distance of the lines between the points."""
        length = np.linalg.norm(np.diff(q, axis=0), axis=1)
        turn = np.diff(np.diff(q, axis=0) / length[:, np.newaxis], axis=0)
        is_corner = np.concatenate(([True], _angle(turn) > CORNER_ANGLE, [True]))
        while True:
            c = _splines(q, length, is_corner)
            aside = _distance_from_lines(c) > line_distance
            new = np.concatenate((aside, [False])) | np.concatenate(([False], aside))
            if not (new & ~is_corner).any():
                break
            is_corner = is_corner | new
        start, end = (v / np.linalg.norm(v, axis=1, keepdims=True)
                      for v in (c[:, 1], derivative(c).sum(axis=1)))
        inner = is_corner[1:-1]
        turn[inner] = (start[1:] - end[:-1])[inner]
        return cls(c, length, 1 + np.flatnonzero(inner & (_angle(turn) > _REST)), turn)


def _angle(turn: FloatArray) -> FloatArray:
    """Return the angles (m,) between unit vectors with these differences (m, n)."""
    half = np.minimum(0.5 * np.linalg.norm(turn, axis=1), 1.0)
    return np.asarray(2.0 * np.arcsin(half))


def _corner(curve: _Curve, numbers: IntArray, names: tuple[str, ...]) -> TrajectoryError:
    angle = _angle(curve.turn)[curve.corners - 1]
    worst = curve.corners[np.argmax(angle)]
    joint = int(np.argmax(np.abs(curve.turn[worst - 1])))
    return TrajectoryError(
        f'points[{numbers[worst]}].positions is a corner of the path: its direction changes by '
        f'{angle.max():.3g} rad, most at joint {names[joint]!r}, expected at most '
        f'{CORNER_ANGLE:g} rad and a spline within {LINE_DISTANCE:g} of the lines; set '
        'corner_tolerance above 0 to round corners, or send velocities')


def _simplified(q: FloatArray, tolerance: float) -> IntArray:
    """
    Return the numbers of points whose lines are within a distance of all points (m, n).

    Source: D. H. Douglas, T. K. Peucker, Cartographica 10(2), 1973.
    """
    kept = {0, len(q) - 1}
    parts = [(0, len(q) - 1)]
    while parts:
        first, last = parts.pop()
        way, between = q[last] - q[first], q[first + 1:last] - q[first]
        share = np.clip(between @ way / max(float(way @ way), 1e-300), 0.0, 1.0)
        gaps = np.linalg.norm(between - share[:, np.newaxis] * way, axis=1)
        if len(gaps) and gaps.max() > tolerance:
            farthest = first + 1 + int(np.argmax(gaps))
            kept.add(farthest)
            parts += [(first, farthest), (farthest, last)]
    return np.array(sorted(kept))


def _splines(q: FloatArray, length: FloatArray, is_corner: BoolArray) -> FloatArray:
    """Return the coefficients of the C2 splines between corners, one piece per line."""
    ends = np.flatnonzero(is_corner)
    second = np.zeros((2, len(length), q.shape[1]))
    for a, b in zip(ends[:-1], ends[1:]):
        M = _second_derivatives(q[a:b + 1], length[a:b])
        second[0, a:b], second[1, a:b] = M[:-1], M[1:]
    h = length[:, np.newaxis]
    d = np.diff(q, axis=0)
    slopes = [d / h - h / 6.0 * (2.0 * second[0] + second[1]),
              d / h + h / 6.0 * (second[0] + 2.0 * second[1])]
    c = position_coefficients([np.zeros_like(d), slopes[0]], [d, slopes[1]], h)
    c[:, 0] += q[:-1]
    return c


def _second_derivatives(q: FloatArray, h: FloatArray) -> FloatArray:
    """
    Return those at the points (m, n) of a cubic spline, at distances h (m - 1,).

    Its third derivatives are continuous at the second point and at the last but one.
    """
    M = np.zeros_like(q)
    m = len(q)
    if m < 3:
        return M
    rhs = 6.0 * np.diff(np.diff(q, axis=0) / h[:, np.newaxis], axis=0)
    if m == 3:
        M[:] = rhs / (3.0 * (h[0] + h[1]))
        return M
    low, diagonal, high = h[:-1].copy(), 2.0 * (h[:-1] + h[1:]), h[1:].copy()
    first, last = h[0] / h[1], h[-1] / h[-2]
    diagonal[0] += h[0] * (1.0 + first)
    high[0] -= h[0] * first
    diagonal[-1] += h[-1] * (1.0 + last)
    low[-1] -= h[-1] * last
    below, on, above = low.tolist(), diagonal.tolist(), high.tolist()
    rows = list(rhs)
    for i in range(1, len(rows)):
        w = below[i] / on[i - 1]
        on[i] -= w * above[i - 1]
        rows[i] = rows[i] - w * rows[i - 1]
    rows[-1] = rows[-1] / on[-1]
    for i in range(len(rows) - 2, -1, -1):
        rows[i] = (rows[i] - above[i] * rows[i + 1]) / on[i]
    M[1:-1] = rows
    M[0] = M[1] + first * (M[1] - M[2])
    M[-1] = M[-2] + last * (M[-2] - M[-3])
    return M


def _distance_from_lines(c: FloatArray) -> FloatArray:
    """Return the largest distance (k,) of each piece from the line between its ends."""
    phases = np.linspace(0.0, 1.0, 9)
    q = np.vander(phases, 6, increasing=True) @ (c - c[:, :1] * (_ORDERS == 0)[:, np.newaxis])
    line = q[:, -1:] / np.maximum(np.linalg.norm(q[:, -1:], axis=2, keepdims=True), 1e-300)
    across = q - (q * line).sum(axis=2, keepdims=True) * line
    return np.asarray(np.linalg.norm(across, axis=2).max(axis=1))


def _rounded(curve: _Curve, tolerance: float) -> FloatArray:
    """
    Return the pieces with a quintic around each corner, which continues both sides smoothly.

    Between straight lines that meet at the angle θ, a quintic from a distance d before the corner
    to d behind it passes the corner at the distance 3/8 d sin(θ/2). The path rests at points where
    it turns back.
    """
    c, angle = curve.coefficients, _angle(curve.turn)
    along = np.concatenate(([0.0], np.cumsum(curve.length)))
    ends = np.concatenate(([0.0], along[curve.corners], along[-1:]))
    room = 0.5 * np.minimum(np.diff(ends)[:-1], np.diff(ends)[1:])
    pieces, position = [], 0.0
    for corner, most in zip(curve.corners, room):
        theta = angle[corner - 1]
        if theta > TURN_BACK:
            continue
        d = min(most, 0.999 * tolerance / (0.375 * np.sin(0.5 * theta)))
        blend = _blend(c, along, corner, d)
        while _miss(c, along, corner, d, blend) > tolerance:
            d *= 0.8
            blend = _blend(c, along, corner, d)
        pieces += [*_between(c, along, position, along[corner] - d), blend]
        position = along[corner] + d
    return np.array([*pieces, *_between(c, along, position, along[-1])])


def _at(c: FloatArray, along: FloatArray, where: float, before: int) -> list[FloatArray]:
    """Return position and derivatives by the length at a length, on a piece before a corner."""
    i = int(np.clip(np.searchsorted(along, where, side='right') - 1, 0, before))
    h = along[i + 1] - along[i]
    rows = sample_pieces(c[i:i + 1], np.array([(where - along[i]) / h]))
    return [row[0] / h**order for order, row in enumerate(rows)]


def _blend(c: FloatArray, along: FloatArray, corner: int, d: float) -> FloatArray:
    start = _at(c, along, along[corner] - d, corner - 1)
    end = _at(c, along, along[corner] + d, len(c) - 1)
    origin = start[0]
    blend = position_coefficients(
        [np.zeros_like(origin), *start[1:]], [end[0] - origin, *end[1:]], 2.0 * d)
    blend[0] += origin
    return blend


def _miss(c: FloatArray, along: FloatArray, corner: int, d: float, blend: FloatArray) -> float:
    """Return the largest distance of points from a blend that replaces the path around them."""
    inside = np.flatnonzero(np.abs(along - along[corner]) < d)
    path = np.vander(np.linspace(0.0, 1.0, 65), 6, increasing=True) @ blend
    points = np.array([c[i, 0] if i < len(c) else c[-1].sum(axis=0) for i in inside])
    gaps = np.linalg.norm(points[:, np.newaxis] - path, axis=2)
    return float(gaps.min(axis=1).max())


def _between(c: FloatArray, along: FloatArray, start: float, end: float) -> list[FloatArray]:
    """Return the pieces and parts of pieces between two lengths."""
    pieces = []
    first, last = np.searchsorted(along, (start, end))
    for i in range(max(first - 1, 0), min(last, len(c))):
        a, b = max(start, along[i]), min(end, along[i + 1])
        if b - a > STILL:
            h = along[i + 1] - along[i]
            pieces.append(_part(c[i], (a - along[i]) / h, (b - along[i]) / h))
    return pieces
