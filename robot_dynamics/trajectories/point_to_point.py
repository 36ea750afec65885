# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Quintic motions from a moving state to a goal, timed by limits of velocity, acceleration and jerk.

From rest to rest over the distance d the shortest duration is known in closed form,

    T = max(1.875 d / v, √(5.7735 d / a), ∛(60 d / j)).

From a moving state, the durations of a geometric series are compared joint by joint, and the
shortest one is used whose motion stays within the limits. If no duration qualifies, the joint
first reduces its acceleration to zero (it coasts), and stops if necessary, before it moves to the
goal.
Source: K. M. Lynch and F. C. Park, Modern Robotics, 2017, section 9.2.2 (fifth-order time
scaling); the comparison is our own.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.trajectories.interpolation import position_coefficients, Reference
from robot_dynamics.trajectories.joint_trajectory import TrajectoryPoint
from robot_dynamics.trajectories.motion_limits import MotionLimits

_SAMPLES = 17
_GROWTH, _DURATIONS = 1.15, 36
_TOLERANCE = 1.01
_AT_REST = 1e-6
"""[rad/s] or [m/s], and their rates per second, up to which a joint is at rest."""
_RESOLUTION = 1e-6
"""[s] to which durations are rounded up, so that points are distinct in time."""
SHORTEST = 1e-3
"""Duration [s] of the shortest motion."""

_s = np.linspace(0.0, 1.0, _SAMPLES)
_k = np.arange(6)
_Q = np.vander(_s, 6, increasing=True)
_V, _A, _J = np.zeros((3, _SAMPLES, 6))
_V[:, 1:] = _k[1:] * _Q[:, :-1]
_A[:, 2:] = _k[2:] * _k[1:-1] * _Q[:, :-2]
_J[:, 3:] = _k[3:] * _k[2:-1] * _k[1:-2] * _Q[:, :-3]
_SERIES = _GROWTH ** np.arange(_DURATIONS)[:, np.newaxis]


class _Piece(NamedTuple):
    """One quintic per joint, `start` and `end` (n,) each, from `since` (n,) for `T` (n,) [s]."""

    start: Reference
    end: Reference
    since: FloatArray
    T: FloatArray


def rest_to_rest_duration(distance: FloatArray, limits: MotionLimits) -> FloatArray:
    """Return the shortest durations (n,) [s] over these distances (n,) [rad] or [m]."""
    d = np.abs(distance)
    return np.asarray(np.maximum.reduce((
        1.875 * d / limits.velocity, np.sqrt(5.7735 * d / limits.acceleration),
        np.cbrt(60.0 * d / limits.jerk))))


def without_creep(state: Reference) -> Reference:
    """
    Return the state with joints at rest that move imperceptibly.

    The path of a quintic of years would depend on an initial acceleration of 1e-10 rad/s².
    """
    moves = _moves(state)
    return Reference(state.position, *(np.where(moves, x, 0.0) for x in state[1:]))


def _moves(state: Reference) -> BoolArray:
    return np.asarray(
        (np.abs(state.velocity) > _AT_REST) | (np.abs(state.acceleration) > _AT_REST))


def goal_points(
    start: Reference, goal: FloatArray, limits: MotionLimits, arrival: float = 0.0,
    shortest: float = 0.0,
) -> list[TrajectoryPoint]:
    """
    Return the points of a motion from `start` to rest at `goal` (n,).

    All joints that start at rest arrive together, after `arrival` [s] or later. A moving joint
    arrives as early as its limits permit, after `shortest` [s] or later: a longer quintic would
    deviate from the direct path.
    """
    rest = Reference(goal, np.zeros_like(goal), np.zeros_like(goal))
    moves = _moves(start)
    T = rest_to_rest_duration(goal - start.position, limits)
    T = np.maximum(T, max(shortest, SHORTEST))
    pieces = _ways(start, rest, limits, T, shortest) if moves.any() else [
        _Piece(start, rest, np.zeros_like(T), T)]
    since, T = pieces[-1].since, np.where(moves, pieces[-1].T, T)
    T[~moves] = max(T[~moves].max(initial=0.0), (since + T)[moves].max(initial=0.0), arrival)
    return _points([*pieces[:-1], pieces[-1]._replace(T=T)])


def meeting_points(
    start: Reference, goals: Reference, T: FloatArray, limits: MotionLimits,
) -> list[TrajectoryPoint]:
    """
    Return the point at which a motion from `start` meets a moving target; empty if impossible.

    `goals` has the states of the target (m, n) after the increasing durations T (m,) [s]. The
    result is the first state that all joints can reach within their limits.
    """
    ratio, leaves = _compare(start, goals, T[:, np.newaxis], limits)
    possible = np.flatnonzero(((ratio <= _TOLERANCE) & ~leaves).all(axis=1))
    return [TrajectoryPoint(float(T[i]), *(x[i] for x in goals)) for i in possible[:1].tolist()]


def stop_points(
    start: Reference, limits: MotionLimits, shortest: float = 0.0,
) -> list[TrajectoryPoint]:
    """Return the points of the earliest stop within the limits; all joints stop together."""
    limits = limits.of_stop
    coast, zero = _coast(start, limits), np.zeros_like(start.velocity)
    T = coast.T + _stop_durations(coast.end, limits)
    T = max(shortest, float(T.max(initial=0.0))) - coast.T
    return _points([coast, _Piece(coast.end, _settled(coast.end, zero, T), coast.T, T)])


def _coast(start: Reference, limits: MotionLimits) -> _Piece:
    """Return the motion to zero acceleration with the largest jerk, for accelerating joints."""
    T = _rounded(np.abs(start.acceleration) / limits.jerk)
    return _Piece(start, _settled(
        start, start.velocity + start.acceleration * T / 2.0, T), np.zeros_like(T), T)


def _stop_durations(start: Reference, limits: MotionLimits) -> FloatArray:
    """Return the shortest durations (n,) [s] of stops without acceleration at the start."""
    v = np.abs(start.velocity)
    return _rounded(np.maximum.reduce((
        np.full(len(v), SHORTEST), 1.5 * v / limits.acceleration, np.sqrt(6.0 * v / limits.jerk))))


def _settled(start: Reference, velocity: FloatArray, T: FloatArray) -> Reference:
    """Return the state with this velocity and zero acceleration after the durations T (n,)."""
    q = start.position + (start.velocity + velocity) * T / 2.0 + start.acceleration * T**2 / 12.0
    return Reference(q, velocity, np.zeros_like(velocity))


def _ways(
    start: Reference, goal: Reference, limits: MotionLimits, T: FloatArray, shortest: float,
) -> list[_Piece]:
    """
    Return the pieces of each joint: coasting, a stop, and the motion to the goal, in this order.

    Joints omit (T = 0) unnecessary pieces: coasting and the stop if a quintic from `start` is
    within the limits, only the stop if a quintic is within the limits after coasting.
    """
    zero = np.zeros_like(T)
    last, direct = _shortest_durations(start, goal, limits, T, shortest)
    coast = _left_out(direct, _coast(start, limits))
    stop = _Piece(coast.end, coast.end, coast.T, zero)
    if not direct.all():
        least = max(shortest - float(coast.T.min()), 0.0)
        T = np.maximum(_rest_durations(coast.end, goal, limits), least)
        after, coasts = _shortest_durations(coast.end, goal, limits, T, least)
        stop_T = _stop_durations(coast.end, limits)
        stop = _left_out(direct | coasts, _Piece(
            coast.end, _settled(coast.end, zero, stop_T), coast.T, stop_T))
        rest = np.maximum(
            _rest_durations(stop.end, goal, limits), shortest - stop.since - stop.T)
        last = np.where(direct, last, np.where(coasts, after, rest))
    return [coast, stop, _Piece(stop.end, goal, stop.since + stop.T, last)]


def _left_out(which: BoolArray, piece: _Piece) -> _Piece:
    """Return the piece without duration for `which` (n,) joints."""
    end = Reference(*(np.where(which, x, y) for x, y in zip(piece.start, piece.end)))
    return piece._replace(end=end, T=np.where(which, 0.0, piece.T))


def _rest_durations(start: Reference, goal: Reference, limits: MotionLimits) -> FloatArray:
    return np.maximum(rest_to_rest_duration(goal.position - start.position, limits), SHORTEST)


def _rounded(T: FloatArray) -> FloatArray:
    """Return durations [s] rounded up, so that all users obtain the same value."""
    return np.asarray(np.ceil(T / _RESOLUTION - 1e-6) * _RESOLUTION)


def _shortest_durations(
    start: Reference, goal: Reference, limits: MotionLimits, T: FloatArray, shortest: float,
) -> tuple[FloatArray, BoolArray]:
    """Return the shortest durations (n,) from a moving start, T from rest; which are possible."""
    v, a = np.abs(start.velocity), np.abs(start.acceleration)
    base = 0.4 * np.maximum.reduce((
        T, 1.5 * v / limits.acceleration, np.sqrt(6.0 * v / limits.jerk), 3.0 * a / limits.jerk))
    durations = np.maximum(base, shortest) * _SERIES
    ratio, leaves = _compare(start, goal, durations, limits)
    possible = (ratio <= _TOLERANCE) & ~leaves
    first = possible.argmax(axis=0)[np.newaxis]
    return np.take_along_axis(durations, first, axis=0)[0], np.asarray(possible.any(axis=0))


def _compare(
    start: Reference, goal: Reference, T: FloatArray, limits: MotionLimits,
) -> tuple[FloatArray, BoolArray]:
    """
    Return the largest ratio to a limit, (m, n), and whether a motion leaves the position limits.

    T is (m, n) or (m, 1) [s]; the goal is (n,) or (m, n). Limits that the start or the goal itself
    exceeds are widened accordingly.
    """
    T = np.broadcast_to(T, (len(T), len(start.position)))
    start = Reference(*(np.broadcast_to(x, T.shape) for x in start))
    goal = Reference(*(np.broadcast_to(x, T.shape) for x in goal))
    c = position_coefficients(start, goal, T)
    T = T[:, np.newaxis]
    largest = [np.abs(basis @ c / T**k).max(axis=1) for k, basis in enumerate((_V, _A, _J), 1)]
    v = np.maximum.reduce((limits.velocity + 0.0 * T[:, 0], np.abs(start.velocity),
                           np.abs(goal.velocity)))
    a = np.maximum.reduce((limits.acceleration + 0.0 * T[:, 0], np.abs(start.acceleration),
                           np.abs(goal.acceleration)))
    ratio = np.maximum.reduce((largest[0] / v, largest[1] / a, largest[2] / limits.jerk))
    q = _Q @ c
    low = np.minimum.reduce((start.position, goal.position, limits.lower + 0.0 * T[:, 0]))
    high = np.maximum.reduce((start.position, goal.position, limits.upper + 0.0 * T[:, 0]))
    leaves = (q.min(axis=1) < low - 1e-9) | (q.max(axis=1) > high + 1e-9)
    return ratio, leaves


def _points(pieces: list[_Piece]) -> list[TrajectoryPoint]:
    """Return points at the ends of all pieces; between them, every joint follows one quintic."""
    pieces = [piece._replace(T=_rounded(piece.T)) for piece in pieces]
    ends = np.round(np.concatenate([piece.since + piece.T for piece in pieces]), 9)
    times = np.unique(ends[ends > 0.0])
    states = np.zeros((3, len(times), len(pieces[0].T)))
    states[0] = pieces[-1].end.position
    for piece in reversed(pieces):
        T = np.maximum(piece.T, _RESOLUTION)
        c = position_coefficients(piece.start, piece.end, T)
        phase = (times[:, np.newaxis] - piece.since) / T
        s = np.clip(phase, 0.0, 1.0)[..., np.newaxis] ** _k
        inside = (piece.T > 0.0) & (phase < 1.0 - 1e-9)
        for order in range(3):
            values = np.einsum('mnk,kn->mn', s, _derivative(c, order)) / T**order
            states[order] = np.where(inside, values, states[order])
    return [TrajectoryPoint(float(t), *state) for t, *state in zip(times, *states)]


def _derivative(c: FloatArray, order: int) -> FloatArray:
    """Return the coefficients (6, n) of the derivative of this order by s."""
    for _ in range(order):
        c = np.vstack((c[1:] * _k[1:, np.newaxis], np.zeros_like(c[:1])))
    return c
