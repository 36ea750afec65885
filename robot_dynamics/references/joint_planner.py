# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Plans of one joint: to rest at a goal, with a moving target, and to a state at a time.

All plans stay in the hull of the start, the earliest stop and the goals. A plan is tried first
with jerks that are linear in the start (`smooth_to_rest`), so that the plans of a stream differ
little, then in the shortest time. If none stays in the hull, the joint stops first.
"""

from collections.abc import Iterator
from typing import NamedTuple

from robot_dynamics.arrays import FloatArray
from robot_dynamics.references.jerk_profile import (
    before,
    Bounds,
    duration,
    end,
    Extremes,
    extremes,
    Phases,
    smooth_to_rest,
    State,
    stop,
    to_rest,
)

AT_REST = 1e-8
"""[rad/s] or [m/s], and their rates per second, up to which a joint is at rest."""
_HULL = 1e-9
"""Tolerance [rad] or [m] of the hull, and [s] of times, for rounding."""
_SOON = 1e-9
"""[s] up to which an arrival is as early as possible."""
_CORRECTION = 0.05
"""Shortest time [s] in which a deviation from a moving target is corrected."""
_STOPS = 2.0
"""The shortest duration of a smooth motion, in durations of the earliest stop."""
_REVERSED = (0.75, 0.5, 0.0)
"""Ends of stops that reverse, as fractions of the displacement of the earliest stop."""
_RESERVE = 0.03
"""
[rad] or [m] before a position limit that a joint enters only to come to rest at a goal.

The arm follows with an error, which is larger at slow states: the reserve is divided by the scale.
"""
_END_RESERVE = 0.005
"""[rad] or [m] before a limit at which a joint stays that cannot follow a moving target."""
_FOLLOWED = (1.0, 0.6, 0.3, 0.1, 0.0)
"""Fractions of the time for which a joint may follow its target."""


class Target(NamedTuple):
    """
    A target that moves with constant acceleration, each (n,).

    `position` and `velocity` are those at `time` [s]. The positions of the target from the times
    `since` (n,) [s] until its stop are goals.
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    time: float
    since: FloatArray

    def joint(self, j: int, t: float) -> State:
        """Return position, velocity and acceleration of joint j at t [s]."""
        s, a, v = t - self.time, float(self.acceleration[j]), float(self.velocity[j])
        return float(self.position[j]) + (v + 0.5 * a * s) * s, v + a * s, a


class PlannerLimits(NamedTuple):
    """Limits of the position, bounds to brake, to brake at a limit, and to move, and the scale."""

    lower: float
    upper: float
    full: Bounds
    whole: Bounds
    lowered: Bounds
    scale: float


class JointPlanner:
    """The state of one joint, its earliest stop, and its limits."""

    def __init__(self, state: State, limits: PlannerLimits) -> None:
        self.q, self.v, self.a = state
        self.limits = limits
        for phases in self._stops():
            self.stop, self._hull = phases, self._extremes(phases)
            self._can_stop = self._is_inside(self._hull)
            if self._can_stop:
                break

    def _stops(self) -> Iterator[Phases]:
        """
        Yield the earliest stop with the full limits, and stops to try if it passes a limit.

        A joint that brakes hard must reduce its acceleration before it stops; it needs the least
        space if it brakes until it reverses. The last stop is the earliest with the whole limits.
        """
        v, a, whole = self.v, self.a, self.limits.whole
        yield stop(v, a, self.limits.full)
        earliest = stop(v, a, whole)
        yield earliest
        way = end(earliest, 0.0, v, a)[0]
        for share in _REVERSED:
            yield to_rest(share * way, v, a, whole)
        yield earliest

    def is_at_rest(self) -> bool:
        """Return whether velocity and acceleration are imperceptible."""
        return abs(self.v) <= AT_REST and abs(self.a) <= AT_REST

    def to_rest(self, goal: float, earliest: float = 0.0) -> Phases:
        """Return the motion to rest at a goal, after `earliest` [s] or later."""
        problem, limits = (goal - self.q, self.v, self.a), self.limits
        for phases in _motions(*problem, limits.lowered, earliest):
            found = self._extremes(phases)
            if (self._can_stop or self._is_inside(found)) and self._is_in_hull(
                    found, limits.full, goal, goal):
                return phases
        if not self._can_stop:
            phases = to_rest(*problem, limits.whole)
            if self._is_inside(self._extremes(phases)):
                return phases
        q_stop, T = end(self.stop, self.q, self.v, self.a)[0], duration(self.stop)
        return [*self.stop, *to_rest(
            goal - q_stop, 0.0, 0.0, limits.lowered, max(earliest - T, 0.0))]

    def to_rest_inside(self, goal: float) -> Phases:
        """Return the motion to rest at a goal, or shortly before the limit if it is there."""
        limits, reserve = self.limits, _END_RESERVE / self.limits.scale
        lowest = max(limits.lower, min(limits.lower + reserve, self.q, limits.upper))
        highest = min(limits.upper, max(limits.upper - reserve, self.q, limits.lower))
        return self.to_rest(min(max(goal, lowest), highest))

    def in_stream(self, goal: float, horizon: float) -> Phases:
        """Return the motion to rest at a goal, after `horizon` [s] or later, and smoothly."""
        bounds = self.limits.lowered
        longest = bounds.v_max / bounds.a_max + bounds.a_max / bounds.jerk
        T = min(duration(stop(self.v, self.a, bounds)), longest)
        return self.to_rest(goal, max(horizon, _STOPS * T))

    def followed(self, target: Target, j: int, until: float) -> Phases | None:
        """
        Return the motion to a target and with it until `until` [s], and a stop.

        It stops earlier if it would otherwise leave the position limits or the hull. Return None
        if it would have to stop before the time of the target.
        """
        problem = self._relative(target.joint(j, 0.0), until)
        if problem is None:
            return None
        since, (_, v, a) = float(target.since[j]), target.joint(j, until)
        goals = extremes(
            [(until - since, 0.0), *stop(v, a, self.limits.full)], *target.joint(j, since))
        for fraction in _FOLLOWED:
            time = target.time + fraction * (until - target.time)
            for motion in _corrections(*problem, target.time):
                phases = self._stopped(before(motion, time))
                found = self._extremes(phases)
                if self._is_inside(found, _RESERVE / self.limits.scale) and self._is_in_hull(
                        found, self.limits.whole, goals.q_min, goals.q_max):
                    return phases
        return None

    def to_state(self, state: State, time: float, low: float, high: float) -> Phases | None:
        """
        Return the motion that is in a state at `time` [s]; None if it is impossible.

        All positions from `low` to `high` are goals.
        """
        for phases in self._motions_to(state, time):
            if duration(phases) <= time + _HULL and self._is_in_hull(
                    self._extremes(phases), self.limits.whole, low, high):
                return phases
        return None

    def _motions_to(self, state: State, time: float) -> Iterator[Phases]:
        q, v, a = state
        problem = self._relative((q - (v - 0.5 * a * time) * time, v - a * time, a), time)
        if problem is not None:
            yield from _motions(*problem, time)
        # From rest to rest, and then the earliest stop from the state, backwards.
        back = stop(-v, a, self.limits.full)
        rest = time - duration(back)
        if rest >= 0.0:
            start = end(back, q, -v, a)[0]
            yield [*self.to_rest(start, rest), *((T, -jerk) for T, jerk in reversed(back))]

    def _relative(
        self, target: State, until: float,
    ) -> tuple[float, float, float, Bounds] | None:
        """
        Return distance, velocity, acceleration and bounds in the frame of a target.

        `target` is its state now; its acceleration is constant. Return None if its motion until
        `until` [s] is beyond the limits.
        """
        (p, v, a), whole, s = target, self.limits.whole, self.limits.scale
        slowest, fastest = sorted((v, v + a * until))
        bounds = Bounds(
            s * whole.v_min - slowest, s * whole.v_max - fastest,
            s**2 * whole.a_min - a, s**2 * whole.a_max - a, s**3 * whole.jerk)
        if not (bounds.v_min < 0.0 < bounds.v_max and bounds.a_min < 0.0 < bounds.a_max):
            return None
        return p - self.q, self.v - v, self.a - a, bounds

    def _stopped(self, moving: Phases) -> Phases:
        """Return a motion and its earliest stop."""
        _, v, a = end(moving, self.q, self.v, self.a)
        return [*moving, *stop(v, a, self.limits.full)]

    def _extremes(self, phases: Phases) -> Extremes:
        return extremes(phases, self.q, self.v, self.a)

    def _is_inside(self, found: Extremes, reserve: float = 0.0) -> bool:
        """Return whether a motion is within the limits of position and velocity, or its start."""
        limits, whole = self.limits, self.limits.whole
        return (min(limits.lower + reserve, self.q) - _HULL <= found.q_min
                and found.q_max <= max(limits.upper - reserve, self.q) + _HULL
                and min(whole.v_min, self.v) - _HULL <= found.v_min
                and found.v_max <= max(whole.v_max, self.v) + _HULL)

    def _is_in_hull(self, found: Extremes, bounds: Bounds, low: float, high: float) -> bool:
        """Return whether a motion is in the hull, with the velocities of the stop or of bounds."""
        hull = self._hull
        return (min(hull.q_min, low) - _HULL <= found.q_min
                and found.q_max <= max(hull.q_max, high) + _HULL
                and min(hull.v_min, bounds.v_min) - _HULL <= found.v_min
                and found.v_max <= max(hull.v_max, bounds.v_max) + _HULL)


def _motions(
    distance: float, v: float, a: float, bounds: Bounds, earliest: float,
) -> Iterator[Phases]:
    """Yield the smooth motion of `earliest` [s], and the shortest one of this time or longer."""
    smooth = smooth_to_rest(distance, v, a, bounds, earliest) if earliest > _SOON else None
    if smooth is not None:
        yield smooth
    yield to_rest(distance, v, a, bounds, earliest)


def _corrections(
    distance: float, v: float, a: float, bounds: Bounds, time: float,
) -> Iterator[Phases]:
    """Yield smooth motions to a target, the second until its time [s], and the shortest one."""
    for T in (max(_CORRECTION, time), max(0.4 * _CORRECTION, time), time):
        smooth = smooth_to_rest(distance, v, a, bounds, T)
        if smooth is not None:
            yield smooth
    yield to_rest(distance, v, a, bounds)
