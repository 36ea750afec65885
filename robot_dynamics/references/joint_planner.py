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
from robot_dynamics.references.motion_limits import JERK_TIME

_ROUNDING = 1e-9
"""Tolerance [rad] or [m] of positions, of velocities per second, and [s] of times."""



class PlannerLimits(NamedTuple):
    """
    Limits of the position, bounds of the motion, and the scale of its velocities.

    `full` are the bounds to brake, `whole` those to brake at a limit, `lowered` those to move, and
    `followed` those to move with a target.
    """

    lower: float
    upper: float
    full: Bounds
    whole: Bounds
    lowered: Bounds
    followed: Bounds
    scale: float


class JointPlanner:
    """The state of one joint, its earliest stop, and its limits."""

    def __init__(self, state: State, limits: PlannerLimits) -> None:
        self._state, self.limits = state, limits
        (self.q, v, _), whole = state, limits.whole
        lower, upper = min(limits.lower, self.q), max(limits.upper, self.q)
        inside = Extremes(lower, upper, min(whole.v_min, v), max(whole.v_max, v), 0.0, 0.0)
        for phases in self._stops():
            self.stop, hull = phases, extremes(phases, *state)
            if _is_within(hull, inside):
                break
        self._hull = hull._replace(q_min=max(hull.q_min, lower), q_max=min(hull.q_max, upper))
        """The path of the earliest stop, as far as it is within the limits of the position."""

    def _stops(self) -> Iterator[Phases]:
        """
        Yield the earliest stop with the full limits, and stops to try if it passes a limit.

        A joint that brakes until it moves back needs the least space. The last stop is the
        earliest with the whole limits.
        """
        (_, v, a), whole = self._state, self.limits.whole
        yield stop(v, a, self.limits.full)
        yield stop(v, a, whole)
        yield to_rest(0.0, v, a, whole)
        yield stop(v, a, whole)

    @property
    def is_at_rest(self) -> bool:
        """Whether velocity and acceleration are zero."""
        return self._state[1:] == (0.0, 0.0)

    @property
    def stop_time(self) -> float:
        """The duration [s] of the earliest stop with the lowered limits."""
        return duration(stop(*self._state[1:], self.limits.lowered))

    def to_rest(self, goal: float, earliest: float = 0.0) -> Phases:
        """Return the motion to rest at a goal, after `earliest` [s] or later."""
        limits = self.limits
        problem = (goal - self.q, *self._state[1:])
        for phases in _motions(problem, limits.lowered, earliest, earliest):
            if self._is_in_hull(phases, limits.full, goal, goal):
                return phases
        q_stop, T = end(self.stop, *self._state)[0], duration(self.stop)
        return [*self.stop, *to_rest(
            goal - q_stop, 0.0, 0.0, limits.lowered, max(earliest - T, 0.0))]

    def followed(self, target: State, time: float, follow_time: float) -> Phases:
        """
        Return the motion to a moving target and with it for `follow_time` [s], and a stop.

        `target` is its state at `time` [s]; its acceleration is constant. The joint stops at
        `time` if it could not stop later, and moves to rest at the position of the target if it
        could not stop then. It keeps the distance from a position limit that the target covers in
        JERK_TIME.
        """
        limits, reserve = self.limits, JERK_TIME / self.limits.scale * abs(target[1])
        inside = min(max(self.q, limits.lower), limits.upper)
        low, high = min(limits.lower + reserve, inside), max(limits.upper - reserve, inside)
        now, path = end([(-time, 0.0)], *target), [(time + follow_time, 0.0)]
        path += stop(*end(path, *now)[1:], limits.full)
        goal, *goals = (
            min(max(q, low), high) for q in (target[0], *extremes(path, *now)[:2]))
        for until in [time + x * follow_time for x in (1.0, 0.5, 0.0)]:
            for motion in self._meetings(now, time + follow_time, max(time, JERK_TIME), 0.0):
                moving = before(motion, until)
                phases = [*moving, *stop(*end(moving, *self._state)[1:], limits.full)]
                if self._is_in_hull(phases, limits.whole, *goals):
                    return phases
        return self.to_rest(goal)

    def to_state(self, state: State, time: float, low: float, high: float) -> Phases | None:
        """
        Return the motion that is in a state at `time` [s]; None if it is impossible.

        All positions from `low` to `high` are goals.
        """
        for phases in self._motions_to(state, time):
            if duration(phases) <= time + _ROUNDING and self._is_in_hull(
                    phases, self.limits.whole, low, high):
                return phases
        return None

    def _motions_to(self, state: State, time: float) -> Iterator[Phases]:
        yield from self._meetings(end([(-time, 0.0)], *state), time, time, time)
        # From rest to rest, and then the earliest stop from the state, backwards.
        q, v, a = state
        back = stop(-v, a, self.limits.full)
        rest = time - duration(back)
        if rest >= 0.0:
            start = end(back, q, -v, a)[0]
            yield [*self.to_rest(start, rest), *((T, -jerk) for T, jerk in reversed(back))]

    def _meetings(
        self, target: State, until: float, smooth: float, earliest: float,
    ) -> Iterator[Phases]:
        """
        Yield motions to a target, planned in its frame; see `_motions`.

        `target` is its state now; its acceleration is constant. There is no motion if that of the
        target until `until` [s] is beyond the limits.
        """
        (p, v, a), most, (q, v_0, a_0) = target, self.limits.followed, self._state
        slowest, fastest = sorted((v, v + a * until))
        bounds = Bounds(most.v_min - slowest, most.v_max - fastest,
                        most.a_min - a, most.a_max - a, most.jerk)
        if bounds.v_min < 0.0 < bounds.v_max and bounds.a_min < 0.0 < bounds.a_max:
            yield from _motions((p - q, v_0 - v, a_0 - a), bounds, smooth, earliest)

    def _is_in_hull(self, phases: Phases, bounds: Bounds, low: float, high: float) -> bool:
        """
        Return whether a motion is in the hull of the stop and the goals from `low` to `high`.

        Its velocities are those of the stop, or within bounds.
        """
        hull = self._hull
        return _is_within(extremes(phases, *self._state), Extremes(
            min(hull.q_min, low), max(hull.q_max, high),
            min(hull.v_min, bounds.v_min), max(hull.v_max, bounds.v_max), 0.0, 0.0))


def _motions(
    problem: State, bounds: Bounds, smooth: float, earliest: float,
) -> Iterator[Phases]:
    """
    Yield the motion of `smooth` [s], if there is one, and the shortest one after `earliest` [s].

    A problem has the distance, and the velocity and acceleration at the start.
    """
    phases = smooth_to_rest(*problem, bounds, smooth) if smooth > _ROUNDING else None
    if phases is not None:
        yield phases
    yield to_rest(*problem, bounds, earliest)


def _is_within(found: Extremes, most: Extremes) -> bool:
    """Return whether positions and velocities are within others."""
    return (most.q_min - _ROUNDING <= found.q_min and found.q_max <= most.q_max + _ROUNDING
            and most.v_min - _ROUNDING <= found.v_min and found.v_max <= most.v_max + _ROUNDING)
