# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

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
import math

import numpy as np
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.references.jerk_profile import Bounds, duration, end, Phases, State, to_rest
from robot_dynamics.references.joint_planner import AT_REST, JointPlanner, PlannerLimits, Target
from robot_dynamics.references.motion_limits import MotionLimits
from robot_dynamics.trajectories.interpolation import Reference, Segment


class Plan:
    """A motion of n joints from a start: one list of phases per joint."""

    def __init__(
        self, start: Reference, phases: list[Phases], exact_end: Reference | None = None,
    ) -> None:
        """`exact_end` is the end without rounding errors, if it is known."""
        self._start = [x.tolist() for x in start]
        self.phases = phases
        ends = [end(joint, *state) for joint, state in zip(phases, zip(*self._start))]
        self.end = exact_end or Reference(*(np.array(values) for values in zip(*ends)))
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


def _bounds(limits: MotionLimits) -> list[Bounds]:
    return [Bounds(-v, v, -a, a, jerk) for v, a, jerk in zip(
        limits.velocity.tolist(), limits.acceleration.tolist(), limits.jerk.tolist())]


def _joints(start: Reference, limits: MotionLimits) -> list[JointPlanner]:
    full, whole, lowered = (_bounds(each) for each in (
        limits.braking, limits.braking.whole, limits.lowered))
    each = zip(limits.lower.tolist(), limits.upper.tolist(), full, whole, lowered)
    return [JointPlanner(state, PlannerLimits(*values, limits.scale))
            for state, values in zip(_states(start), each)]


def _states(reference: Reference) -> list[State]:
    """Return position, velocity and acceleration of each joint."""
    return list(zip(*(values.tolist() for values in reference)))


def plan_stop(start: Reference, limits: MotionLimits) -> Plan:
    """Return the earliest stop of each joint."""
    return Plan(start, [joint.stop for joint in _joints(start, limits)])


def plan_to_goal(
    start: Reference, goal: FloatArray, limits: MotionLimits, arrival: float = 0.0,
    horizon: float = 0.0,
) -> Plan:
    """
    Return the motion to rest at `goal` (n,).

    A moving joint arrives as soon as its limits permit, after `arrival` [s] or later; in a stream,
    smoothly and after `horizon` [s] or later. The joints that start at rest arrive together on a
    straight line, after all moving joints.
    """
    joints, goals, phases = _joints(start, limits), goal.tolist(), []
    earliest = max(arrival, horizon)
    waiting: list[tuple[float, Bounds]] = []
    for joint, q in zip(joints, goals):
        if joint.is_at_rest():
            waiting.append((abs(q - joint.q), joint.limits.lowered))
            phases.append(Phases())
        else:
            phases.append(
                joint.in_stream(q, earliest) if horizon > 0.0 else joint.to_rest(q, earliest))
    together = _straight(waiting, max(earliest, *map(duration, phases)))
    for j, (joint, q) in enumerate(zip(joints, goals)):
        if joint.is_at_rest():
            phases[j] = [(T, (q - joint.q) * jerk) for T, jerk in together]
    return Plan(without_creep(start), phases, Reference(goal.copy(), 0.0 * goal, 0.0 * goal))


def _straight(joints: list[tuple[float, Bounds]], earliest: float) -> Phases:
    """Return the motion from 0 to 1 of joints at rest, with their distances and bounds."""
    moving = [(distance, bounds) for distance, bounds in joints if distance > 0.0]
    if not moving:
        return []
    v, a, jerk = (min(getattr(bounds, name) / distance for distance, bounds in moving)
                  for name in ('v_max', 'a_max', 'jerk'))
    return to_rest(1.0, 0.0, 0.0, Bounds(-v, v, -a, a, jerk), earliest)


def plan_with_target(
    start: Reference, target: Target, limits: MotionLimits, follow_time: float,
) -> Plan:
    """
    Return the motion that meets a moving target, follows it, and stops.

    Joints follow until `follow_time` [s] after the time of the target, as far as they can stop
    within the position limits. A joint that cannot follow moves to rest at the position of the
    target, or shortly before a limit.
    """
    phases = []
    for j, joint in enumerate(_joints(start, limits)):
        following = joint.followed(target, j, target.time + follow_time)
        phases.append(
            joint.to_rest_inside(float(target.position[j])) if following is None else following)
    return Plan(start, phases)


def plan_to_path(
    start: Reference, path: Iterable[tuple[float, Reference]], limits: MotionLimits,
) -> Plan | None:
    """
    Return the motion that meets a path, at the first state at which that is possible; or None.

    `path` has states with increasing times [s]. Its positions up to the meeting are goals.
    """
    joints = list(enumerate(_joints(start, limits)))
    low, high = [math.inf] * len(joints), [-math.inf] * len(joints)
    for time, reference in path:
        states = _states(reference)
        low = [min(x, q) for x, (q, _, _) in zip(low, states)]
        high = [max(x, q) for x, (q, _, _) in zip(high, states)]
        found: dict[int, Phases] = {}
        for j, joint in joints:
            phases = joint.to_state(states[j], time, low[j], high[j])
            if phases is None:
                # This joint is the first one at the next time, because it often fails again.
                joints.remove((j, joint))
                joints.insert(0, (j, joint))
                break
            found[j] = phases
        else:
            return Plan(start, [found[j] for j in range(len(found))])
    return None


def without_creep(state: Reference) -> Reference:
    """Return the state with joints at rest that move imperceptibly."""
    moves = (np.abs(state.velocity) > AT_REST) | (np.abs(state.acceleration) > AT_REST)
    return Reference(state.position, *(np.where(moves, x, 0.0) for x in state[1:]))
