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
Plans of all joints within limits: to rest at a goal, to a moving target, and the earliest stop.

Each joint follows phases of constant jerk (`jerk_profile`). The position of a joint never leaves
the hull of its start, the path of its earliest stop and its goal. The reference brakes with the
full limits. It moves with lower limits (`MotionLimits.lowered`) only if the motion from the
present state stays in the hull with them; otherwise the joint first stops, and then moves from
rest to rest. Joints at rest move together, on a straight line; a joint stops alone, at once.
"""

from bisect import bisect_right
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.trajectories.interpolation import Reference, Segment
from robot_dynamics.trajectories.jerk_profile import (
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
from robot_dynamics.trajectories.motion_limits import MotionLimits

AT_REST = 1e-6
"""[rad/s] or [m/s], and their rates per second, up to which a joint is at rest."""
_HULL = 1e-9
"""Tolerance [rad] or [m] of the hull, for rounding."""
import os
SMOOTHEST = float(os.environ.get("EM","0.05"))
SM = float(os.environ.get("SM","2"))
_STEPS = 6
"""Bisections of the time for which a joint follows a target towards a position limit."""


class Plan:
    """A motion of n joints from a start: one list of phases per joint."""

    def __init__(self, start: Reference, phases: list[Phases]) -> None:
        self._start = [x.tolist() for x in start]
        self.phases = phases
        ends = [end(joint, *state) for joint, state in zip(phases, zip(*self._start))]
        self.end = Reference(*(np.array(values) for values in zip(*ends)))
        """The state at the end, of which joints with shorter motions have waited at rest."""
        times = sorted({0.0, *(t for joint in phases for t in _times(joint))})
        self._times = times
        self.duration = times[-1]
        """[s]"""
        self._times_ns = [round(NANOSECONDS_PER_SECOND * t) for t in times]
        for values in self.end:
            values.setflags(write=False)

    def segment(self, since_ns: int, now_ns: int) -> Segment:
        """Return the segment that is active at `now_ns` of the plan that begins at `since_ns`."""
        i = min(bisect_right(self._times_ns, now_ns - since_ns), len(self._times) - 1)
        i = max(i, 1)
        t_0, t_1 = self._times[i - 1], self._times[i]
        T = max(t_1 - t_0, 1e-9)
        middle = 0.5 * (t_0 + t_1)
        q, v, a, j = np.array([
            _state_at(joint, t_0, middle, *state)
            for joint, state in zip(self.phases, zip(*self._start))]).T
        zero = np.zeros_like(q)
        return Segment(
            since_ns + self._times_ns[i - 1], since_ns + self._times_ns[i],
            since_ns + self._times_ns[i - 1], T, np.hstack((
                (q, v * T, a * T**2 / 2.0, j * T**3 / 6.0, zero, zero),
                (v, a * T, j * T**2 / 2.0, zero, zero, zero),
                (a, j * T, zero, zero, zero, zero))))


def _times(phases: Phases) -> list[float]:
    """Return the times [s] at which phases end."""
    times, t = [], 0.0
    for T, _ in phases:
        t += T
        times.append(t)
    return times


def _state_at(
    phases: Phases, t: float, inside: float, q: float, v: float, a: float,
) -> tuple[float, float, float, float]:
    """Return q, v, a at t [s] and the jerk at the later time `inside`, in the same phase."""
    for T, j in phases:
        if inside < T:
            t = max(t, 0.0)
            return (q + (v + (a / 2.0 + j * t / 6.0) * t) * t, v + (a + j * t / 2.0) * t,
                    a + j * t, j)
        q, v, a = end([(T, j)], q, v, a)
        t, inside = t - T, inside - T
    return q, v, a, 0.0


class Target(NamedTuple):
    """
    A target that moves with constant acceleration, each (n,), and is at `position` at `time` [s].

    `velocity` is that at `time` too.
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


class _Joint:
    """One joint: its state, its earliest stop, and the bounds of its limits."""

    def __init__(
        self, state: State, lower: float, upper: float, bounds: tuple[Bounds, Bounds, Bounds],
        scale: float,
    ) -> None:
        self.q, self.v, self.a = state
        self.full, self.whole, self.low = bounds
        self.scale = scale
        self.lower, self.upper = min(lower, self.q), max(upper, self.q)
        """Limits of the position, and the present position if it is beyond them."""
        self.stop = stop(self.v, self.a, self.full)
        """The earliest stop; with the whole limits if it would end beyond a position limit."""
        self.hull = extremes(self.stop, self.q, self.v, self.a)
        if not self._is_inside(self.hull):
            self.stop = stop(self.v, self.a, self.whole)
            self.hull = extremes(self.stop, self.q, self.v, self.a)

    def is_at_rest(self) -> bool:
        return abs(self.v) <= AT_REST and abs(self.a) <= AT_REST

    def to_rest(self, goal: float, earliest: float = 0.0) -> Phases:
        """Return the motion to rest at a goal, after `earliest` [s] or later."""
        way = goal - self.q
        if earliest > 0.0:
            earliest = max(earliest, SM * duration(stop(self.v, self.a, self.low)))
            phases = smooth_to_rest(way, self.v, self.a, self.low, earliest)
            if phases is not None and self._is_in_hull(self._extremes(phases), self.full, goal):
                return phases
        phases = to_rest(way, self.v, self.a, self.low, earliest)
        if self._is_in_hull(self._extremes(phases), self.full, goal):
            return phases
        q_stop, T = end(self.stop, self.q, self.v, self.a)[0], duration(self.stop)
        return [*self.stop, *to_rest(goal - q_stop, 0.0, 0.0, self.low, max(earliest - T, 0.0))]

    def followed(self, target: Target, j: int, until: float) -> Phases | None:
        """Return the motion with a target until `until` [s], and a stop inside the limits."""
        relative = self._relative(target.joint(j, 0.0), until)
        if relative is None:
            return None
        # The goals are all positions of the target, up to its stop.
        since, (_, v, a) = float(target.since[j]), target.joint(j, until)
        goals = extremes([(until - since, 0.0), *stop(v, a, self.full)], *target.joint(j, since))

        def stopped_after(meeting: Phases, time: float) -> Phases | None:
            moving = before(meeting, time)
            _, v, a = end(moving, self.q, self.v, self.a)
            for bounds in (self.full, self.whole):
                phases = [*moving, *stop(v, a, bounds)]
                found = self._extremes(phases)
                if self._is_inside(found):
                    return phases if self._is_in_hull(
                        found, self.whole, goals.q_min, goals.q_max) else None
            return None

        for T in (max(SMOOTHEST, target.time), target.time):
            meeting = smooth_to_rest(*relative, T)
            found = None if meeting is None else stopped_after(meeting, until)
            if found is not None:
                return found
        meeting = to_rest(*relative)
        found, low, high = stopped_after(meeting, until), target.time, until
        if found is None:
            found = stopped_after(meeting, low)
            for _ in range(_STEPS if found is not None else 0):
                middle = 0.5 * (low + high)
                longer = stopped_after(meeting, middle)
                if longer is None:
                    high = middle
                else:
                    found, low = longer, middle
        return found

    def _relative(
        self, target: State, until: float,
    ) -> tuple[float, float, float, Bounds] | None:
        """
        Return the arguments of `to_rest` in the frame of a target of constant acceleration.

        The state of the target is that now. Return None if it is beyond the limits by `until` [s].
        """
        (p, v, a), whole, s = target, self.whole, self.scale
        slowest, fastest = sorted((v, v + a * until))
        bounds = Bounds(
            s * whole.v_min - slowest, s * whole.v_max - fastest,
            s**2 * whole.a_min - a, s**2 * whole.a_max - a, s**3 * whole.jerk)
        if not (bounds.v_min < 0.0 < bounds.v_max and bounds.a_min < 0.0 < bounds.a_max):
            return None
        return p - self.q, self.v - v, self.a - a, bounds

    def to_state(self, state: State, time: float) -> Phases | None:
        """Return the motion that is in a state at `time` [s]; None if it is impossible."""
        q, v, a = state
        start = q - (v - 0.5 * a * time) * time, v - a * time, a
        relative = self._relative(start, time)
        if relative is not None:
            for phases in (smooth_to_rest(*relative, time), to_rest(*relative, time)):
                if phases is not None and duration(phases) <= time + 1e-9 and (
                        self._is_in_hull(self._extremes(phases), self.whole, q)):
                    return phases
        if True:
            back = stop(-v, a, self.full)
            run = [(T, -j) for T, j in reversed(back)]
            q_back = end(back, q, -v, a)[0]
            rest = time - duration(run)
            if rest <= 0.0: return None
            first = self.to_rest(q_back, rest)
            if duration(first) <= rest + 1e-9:
                phases = [*first, *run]
                if self._is_in_hull(self._extremes(phases), self.whole, q):
                    return phases
        return None

    def _extremes(self, phases: Phases) -> Extremes:
        return extremes(phases, self.q, self.v, self.a)

    def _is_inside(self, found: Extremes) -> bool:
        """Return whether a motion stays within the position limits."""
        return self.lower - _HULL <= found.q_min and found.q_max <= self.upper + _HULL

    def _is_in_hull(self, found: Extremes, bounds: Bounds, *goals: float) -> bool:
        """Return whether a motion is in the hull of stop and goals, with permitted velocities."""
        hull = self.hull
        return (min(hull.q_min, *goals) - _HULL <= found.q_min
                and found.q_max <= max(hull.q_max, *goals) + _HULL
                and found.v_max <= max(hull.v_max, bounds.v_max) + _HULL
                and found.v_min >= min(hull.v_min, bounds.v_min) - _HULL)


def _bounds(limits: MotionLimits) -> list[Bounds]:
    return [Bounds(-v, v, -a, a, jerk) for v, a, jerk in zip(
        limits.velocity.tolist(), limits.acceleration.tolist(), limits.jerk.tolist())]


def _joints(start: Reference, limits: MotionLimits) -> list[_Joint]:
    states = zip(*(x.tolist() for x in start))
    bounds = zip(*(_bounds(x) for x in (limits, limits.whole, limits.lowered)))
    return [_Joint(*each, limits.scale) for each in zip(
        states, limits.lower.tolist(), limits.upper.tolist(), bounds)]


def plan_stop(start: Reference, limits: MotionLimits) -> Plan:
    """Return the earliest stop of each joint."""
    return Plan(start, [joint.stop for joint in _joints(start, limits)])


def plan_to_goal(
    start: Reference, goal: FloatArray, limits: MotionLimits, arrival: float = 0.0,
    earliest: float = 0.0,
) -> Plan:
    """
    Return the motion to rest at `goal` (n,).

    A moving joint arrives as soon as its limits permit, after `earliest` [s] or later. The joints
    that start at rest arrive together on a straight line, after all moving joints and after
    `arrival` [s].
    """
    joints, goals = _joints(start, limits), goal.tolist()
    rests = [joint.is_at_rest() for joint in joints]
    phases = [[] if is_at_rest else joint.to_rest(q, earliest)
              for joint, q, is_at_rest in zip(joints, goals, rests)]
    last = max(arrival, earliest, *(duration(joint) for joint in phases))
    together = _straight(joints, goals, rests, last)
    for j, is_at_rest in enumerate(rests):
        if is_at_rest:
            way = goals[j] - joints[j].q
            phases[j] = [(T, way * jerk) for T, jerk in together]
    return Plan(without_creep(start), phases)


def _straight(
    joints: list[_Joint], goals: list[float], rests: list[bool], earliest: float,
) -> Phases:
    """Return the motion from 0 to 1 of the joints at rest along a straight line to their goals."""
    ways = [(abs(goal - joint.q), joint.low)
            for joint, goal, is_at_rest in zip(joints, goals, rests) if is_at_rest]
    ways = [(way, bounds) for way, bounds in ways if way > 0.0]
    if not ways:
        return []
    v, a, jerk = (min(bounds[k] / way for way, bounds in ways) for k in (1, 3, 4))
    return to_rest(1.0, 0.0, 0.0, Bounds(-v, v, -a, a, jerk), earliest)


def plan_with_target(
    start: Reference, target: Target, limits: MotionLimits, follow_time: float,
) -> Plan:
    """
    Return the motion that meets a moving target, follows it, and stops.

    Joints follow until `follow_time` [s] after the time of the target, as far as they can stop
    within the position limits. A joint that cannot meet the target by then moves to rest at the
    position of the target.
    """
    until = target.time + follow_time
    phases = []
    for j, joint in enumerate(_joints(start, limits)):
        moving = joint.followed(target, j, until)
        goal = min(max(float(target.position[j]), joint.lower), joint.upper)
        phases.append(joint.to_rest(goal) if moving is None else moving)
    return Plan(start, phases)


def plan_to_path(
    start: Reference, path: Iterable[tuple[float, Reference]], limits: MotionLimits,
) -> Plan | None:
    """Return the motion to the first possible state of a path, with times [s]; None if none."""
    joints = list(enumerate(_joints(start, limits)))
    for time, state in path:
        phases: dict[int, Phases] = {}
        for j, joint in joints:
            moving = joint.to_state((float(state.position[j]), float(state.velocity[j]), float(state.acceleration[j])), time)
            if moving is None:
                # At the next time this joint is the first, because it will often fail again.
                joints.remove((j, joint))
                joints.insert(0, (j, joint))
                break
            phases[j] = moving
        else:
            return Plan(start, [phases[j] for j in range(len(phases))])
    return None


def without_creep(state: Reference) -> Reference:
    """Return the state with joints at rest that move imperceptibly."""
    moves = (np.abs(state.velocity) > AT_REST) | (np.abs(state.acceleration) > AT_REST)
    return Reference(state.position, *(np.where(moves, x, 0.0) for x in state[1:]))
