# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Motions of one joint with bounded velocity, acceleration and jerk, from any state to rest.

A motion is a list of phases (duration [s], jerk), which start at position q, velocity v and
acceleration a. Sources: L. Biagiotti and C. Melchiorri, "Trajectory Planning for Automatic
Machines and Robots", Springer, 2008, chapter 3 (double S velocity profile); R. Haschke,
E. Weitnauer and H. Ritter, "On-line planning of time-optimal, jerk-limited trajectories", IROS
2008 (two changes of velocity, before and after the peak velocity). The motions that are slower
than necessary are our own.
"""

import math
from typing import NamedTuple, TypeAlias

Phases: TypeAlias = list[tuple[float, float]]
State: TypeAlias = tuple[float, float, float]

SAME_POSITION = 1e-12
"""Distance [rad] or [m] from the goal up to which the earliest stop reaches the goal."""
_ROUNDING = 1e-13
_CONVERGED, _MOST_STEPS = 1e-10, 60


class Bounds(NamedTuple):
    """Bounds of one joint: v_min < 0 < v_max, a_min < 0 < a_max, and 0 < jerk (both signs)."""

    v_min: float
    v_max: float
    a_min: float
    a_max: float
    jerk: float


class Extremes(NamedTuple):
    """Smallest and largest position, velocity and acceleration of a motion."""

    q_min: float
    q_max: float
    v_min: float
    v_max: float
    a_min: float
    a_max: float


def velocity_change(v: float, a: float, v_end: float, bounds: Bounds) -> Phases:
    """
    Return the shortest change, of at most three phases, from (v, a) to (v_end, 0).

    An acceleration beyond its bound first returns to the bound. Bounds of velocity are not used.
    """
    sign, _, j_first, first, constant, last = _velocity_change(v, a, v_end, bounds)
    phases = ((first, sign * j_first), (constant, 0.0), (last, -sign * bounds.jerk))
    return [phase for phase in phases if phase[0] > 0.0]


def stop(v: float, a: float, bounds: Bounds) -> Phases:
    """Return the earliest stop from (v, a)."""
    return velocity_change(v, a, 0.0, bounds)


def to_rest(
    distance: float, v: float, a: float, bounds: Bounds, earliest: float = 0.0,
) -> Phases:
    """
    Return the shortest motion from (0, v, a) to rest at `distance`, of at least `earliest` [s].

    The position stays within the interval of the start, the path of `stop` and the goal, because
    the joint moves from the stop towards the goal only: it changes to the bound of the velocity,
    holds this velocity, and leaves this motion for the stop at the time that leads to `distance`.
    Displacement and duration increase with that time. Bounds that the start complies with are
    complied with, unless the velocity exceeds its bound until the acceleration is removed. The
    rounding error of the goal is below 1e-9 for motions up to 100 s and 100 rad or m.

    A motion of the duration `earliest` is a weighted mean of the stop followed by rest and of the
    farthest motion of this duration. The mean complies with all bounds with which both motions
    comply. From rest, without phases of constant acceleration or velocity, the mean is the
    shortest motion slowed down.
    """
    stopping = stop(v, a, bounds)
    q_stop, T_stop, _, _ = _stopped(0.0, v, a, bounds)
    wait, rest = earliest - T_stop, distance - q_stop
    if abs(rest) <= SAME_POSITION:
        return [*stopping, (wait, 0.0)] if wait > 0.0 else stopping
    sign, peak = (1.0, bounds.v_max) if rest > 0.0 else (-1.0, bounds.v_min)
    shortest = _left_for_stop(v, a, peak, bounds, (sign, 0.0), sign * distance)
    wait = earliest - duration(shortest)
    if wait <= 0.0:
        return shortest
    farthest = _left_for_stop(v, a, peak, bounds, (0.0, 1.0), earliest)
    gain = end(farthest, 0.0, v, a)[0] - q_stop
    if sign * gain <= sign * rest:  # The motions differ by rounding errors.
        return [*shortest, (wait, 0.0)]
    wait = max(duration(farthest) - duration(stopping), 0.0)
    return _mean(farthest, [*stopping, (wait, 0.0)], rest / gain)


def smooth_to_rest(
    distance: float, v: float, a: float, bounds: Bounds, T: float,
) -> Phases | None:
    """
    Return a motion of T [s] from (0, v, a) to rest at `distance`, or None beyond the bounds.

    Its phases of T/4, T/2 and T/4 are those of the shortest motion from rest. The jerks are linear
    in the start, so that motions from neighbouring starts differ little. The position may leave
    the interval of start, stop and goal.
    """
    h = T / 4.0
    change = -a / h
    way = -(v / h + 4.0 * a) / h
    moment = (distance / h**2 - 4.0 * (v / h + 2.0 * a)) / h
    first = moment / 2.0 - 2.0 * way / 3.0 + change / 4.0
    middle = (way - change / 2.0) / 3.0 - first
    phases = [(h, first), (2.0 * h, middle), (h, change - first - 2.0 * middle)]
    if any(abs(j) > bounds.jerk for _, j in phases):
        return None
    found = extremes(phases, 0.0, v, a)
    is_within = (
        min(v, bounds.v_min) <= found.v_min and found.v_max <= max(v, bounds.v_max)
        and min(a, bounds.a_min) <= found.a_min and found.a_max <= max(a, bounds.a_max))
    return phases if is_within else None


def duration(phases: Phases) -> float:
    """Return the duration [s] of a motion."""
    return sum(T for T, _ in phases)


def before(phases: Phases, time: float) -> Phases:
    """Return the first part of a motion, until `time` [s], with zero jerk after the end."""
    first = Phases()
    for T, j in phases:
        if time <= T:
            return [*first, (time, j)]
        first.append((T, j))
        time -= T
    return [*first, (time, 0.0)]


def end(phases: Phases, q: float, v: float, a: float) -> State:
    """Return (q, v, a) at the end of a motion from (q, v, a)."""
    for T, j in phases:
        q, v, a = _after(T, j, q, v, a)
    return q, v, a


def extremes(phases: Phases, q: float, v: float, a: float) -> Extremes:
    """Return the exact extremes of a motion from (q, v, a)."""
    states = [(q, v, a)]
    for T, j in phases:
        q, v, a = states[-1]
        times = [-a / j] if j else []
        square = a * a - 2.0 * j * v
        if square > 0.0:
            w = -a - math.copysign(math.sqrt(square), a)
            times += [2.0 * v / w, w / j] if j else [2.0 * v / w]
        states += [_after(t, j, q, v, a) for t in times if 0.0 < t < T]
        states.append(_after(T, j, q, v, a))
    q_all, v_all, a_all = zip(*states)
    return Extremes(min(q_all), max(q_all), min(v_all), max(v_all), min(a_all), max(a_all))


def _after(T: float, j: float, q: float, v: float, a: float) -> State:
    """Return the state after T [s] of constant jerk, without rounding errors about a = 0."""
    a_end = a + j * T
    if abs(a_end) <= _ROUNDING * abs(a):
        a_end = 0.0
    return q + (v + (a / 2.0 + j * T / 6.0) * T) * T, v + (a + j * T / 2.0) * T, a_end


def _velocity_change(
    v: float, a: float, v_end: float, bounds: Bounds,
) -> tuple[float, float, float, float, float, float]:
    """Return sign and size of the peak acceleration, first jerk times sign, three durations."""
    j, change = bounds.jerk, v_end - v
    if 2.0 * j * change >= a * abs(a):
        sign, limit = 1.0, bounds.a_max
    else:
        sign, limit, a, change = -1.0, -bounds.a_min, -a, -change
    square = j * change + a * a / 2.0
    last = limit / j
    if square < limit * limit:
        peak = math.sqrt(max(square, 0.0))
        return sign, peak, j, max((peak - a) / j, 0.0), 0.0, peak / j
    j_first = j if a <= limit else -j
    first = (limit - a) / j_first
    constant = (change - (a + limit) / 2.0 * first) / limit - last / 2.0
    return sign, limit, j_first, first, max(constant, 0.0), last


def _stopped(q: float, v: float, a: float, bounds: Bounds) -> tuple[float, float, float, float]:
    """
    Return the position at the end of `stop`, its duration [s], and their slopes.

    A delay dt of the stop by a jerk that differs by J from its first jerk changes position and
    total duration by |J| dt times the slopes.
    """
    sign, peak, j, first, constant, last = _velocity_change(v, a, 0.0, bounds)
    v_last = peak * last / 2.0
    v_constant = v_last + peak * constant
    way = (v_constant + (peak / 2.0 - j * first / 6.0) * first) * first + (
        (v_constant + v_last) / 2.0 * constant + v_last * last / 3.0)
    slope = first / peak if peak > 0.0 else 0.0
    return (
        q - sign * way, first + constant + last,
        -sign * slope * (v_constant + peak * first / 2.0), slope)


def _left_for_stop(
    v: float, a: float, peak: float, bounds: Bounds, weights: tuple[float, float], target: float,
) -> Phases:
    """
    Return part of the motion to and at the velocity `peak`, and the stop, that give `target`.

    `target` is the sum of displacement and duration, times `weights`. The sum increases with the
    time at which the stop begins.
    """
    change = velocity_change(v, a, peak, bounds)
    w_q, w_T = weights
    q, t = 0.0, 0.0
    for i, (T, j) in enumerate(change):
        start, (q, v, a) = (q, v, a), _after(T, j, q, v, a)
        q_end, T_stop, _, _ = _stopped(q, v, a, bounds)
        if w_q * q_end + w_T * (t + T + T_stop) > target:
            T = _leaving_time(T, j, start, bounds, weights, target - w_T * t)
            _, v, a = _after(T, j, *start)
            return [*change[:i], (T, j), *stop(v, a, bounds)]
        t += T
    q_end, T_stop, _, _ = _stopped(q, peak, 0.0, bounds)
    cruise = (target - w_q * q_end - w_T * (t + T_stop)) / (w_q * peak + w_T)
    return [*change, *([(cruise, 0.0)] if cruise > 0.0 else []), *stop(peak, 0.0, bounds)]


def _leaving_time(
    T: float, j: float, start: State, bounds: Bounds, weights: tuple[float, float], target: float,
) -> float:
    """Return the time up to T [s] at which the stop begins that gives `target`."""
    w_q, w_T = weights
    jerk = bounds.jerk + abs(j)
    low, high, x, step = 0.0, T, T / 2.0, T
    for _ in range(_MOST_STEPS):
        q_end, T_stop, slope_q, slope_T = _stopped(*_after(x, j, *start), bounds)
        excess = w_q * q_end + w_T * (x + T_stop) - target
        slope = jerk * (w_q * slope_q + w_T * slope_T)
        if excess > 0.0:
            high = x
        else:
            low = x
        # A step of Newton's method, or of bisection if Newton's method converges slowly.
        last, step = step, -excess / slope if slope > 0.0 else math.inf
        if abs(step) <= _CONVERGED * x:
            return x + step
        if not (low < x + step < high and abs(step) <= abs(last) / 2.0):
            step = (low + high) / 2.0 - x
        x += step
    return x


def _mean(first: Phases, second: Phases, share: float) -> Phases:
    """Return the motion with `share` of the jerk of `first`, and the remainder of `second`."""
    phases, first, second = Phases(), first[::-1], second[::-1]
    while first and second:
        (T_1, j_1), (T_2, j_2) = first.pop(), second.pop()
        T = min(T_1, T_2)
        phases.append((T, share * j_1 + (1.0 - share) * j_2))
        if T_1 > T:
            first.append((T_1 - T, j_1))
        if T_2 > T:
            second.append((T_2 - T, j_2))
    return [phase for phase in phases if phase[0] > 0.0]
