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
from itertools import accumulate, repeat
import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.references.jerk_profile import (
    before,
    Bounds,
    duration,
    end,
    Phases,
    State,
    to_rest,
)
from robot_dynamics.references.joint_planner import JointPlanner, PlannerLimits
from robot_dynamics.references.motion_limits import MotionLimits
from robot_dynamics.trajectories.interpolation import Reference, Segment
from robot_dynamics.trajectories.joint_trajectory import nanoseconds

AT_REST = 1e-8
"""[rad/s] or [m/s], and their rates per second, up to which a joint is at rest."""
STOPS = 2.0
"""The shortest duration of a motion in a stream, in durations of the earliest stop."""


class Plan:
    """A motion of n joints from a start: one list of phases per joint."""

    def __init__(
        self, start: Reference, phases: list[Phases], exact_end: Reference | None = None,
    ) -> None:
        """`exact_end` is the end without rounding errors, if it is known."""
        self._joints = list(zip(phases, _states(start)))
        self.phases = phases
        self.end = exact_end or Reference(*map(
            np.array, zip(*(end(joint, *state) for joint, state in self._joints))))
        """The state at the end, of which joints with shorter motions have waited at rest."""
        self._times = sorted(
            {0.0, *(t for joint in phases for t in accumulate(T for T, _ in joint))})
        self.duration = self._times[-1]
        """[s]"""
        self._times_ns = [nanoseconds(t) for t in self._times]
        for values in self.end:
            values.setflags(write=False)

    def segment(self, since_ns: int, now_ns: int) -> Segment:
        """Return the segment that is active at `now_ns` of the plan that begins at `since_ns`."""
        i = min(bisect_right(self._times_ns, now_ns - since_ns), len(self._times) - 1)
        t_0, t_1 = self._times[i - 1:i + 1]
        T, begin_ns = max(t_1 - t_0, 1e-9), since_ns + self._times_ns[i - 1]
        q, v, a, j = np.array([
            (*end(before(joint, t_0), *state), before(joint, 0.5 * (t_0 + t_1))[-1][1])
            for joint, state in self._joints]).T
        zero = np.zeros_like(q)
        return Segment(
            begin_ns, since_ns + self._times_ns[i], begin_ns, T, np.hstack((
                (q, v * T, a * T**2 / 2.0, j * T**3 / 6.0, zero, zero),
                (v, a * T, j * T**2 / 2.0, zero, zero, zero),
                (a, j * T, zero, zero, zero, zero))))


def _bounds(limits: MotionLimits) -> list[Bounds]:
    return [Bounds(-v, v, -a, a, jerk) for v, a, jerk in zip(
        limits.velocity.tolist(), limits.acceleration.tolist(), limits.jerk.tolist())]


def _joints(start: Reference, limits: MotionLimits) -> list[JointPlanner]:
    full, lowered = limits.braking, limits.lowered
    each = zip(
        limits.lower.tolist(), limits.upper.tolist(),
        *map(_bounds, (full, full.whole, lowered, lowered.whole)), repeat(limits.scale))
    return [
        JointPlanner(state, PlannerLimits(*values))
        for state, values in zip(_states(start), each)]


def _states(reference: Reference) -> list[State]:
    """Return position, velocity and acceleration of each joint."""
    return list(zip(*(values.tolist() for values in reference)))


def plan_stop(start: Reference, limits: MotionLimits) -> Plan:
    """Return the earliest stop of each joint."""
    return Plan(start, [joint.stop for joint in _joints(start, limits)])


def plan_to_goal(
    start: Reference, goal: FloatArray, limits: MotionLimits, earliest: float = 0.0,
    is_in_stream: bool = False,
) -> Plan:
    """
    Return the motion to rest at `goal` (n,).

    A moving joint arrives as soon as its limits permit, after `earliest` [s] or later, and in a
    stream after STOPS durations of its earliest stop or later. The joints that start at rest
    arrive together on a straight line, after all moving joints.
    """
    joints = list(zip(_joints(start, limits), goal.tolist()))
    phases = [Phases() if joint.is_at_rest else joint.to_rest(
        q, max(earliest, STOPS * joint.stop_time if is_in_stream else 0.0)) for joint, q in joints]
    together = _straight([
        (abs(q - joint.q), joint.limits.lowered) for joint, q in joints
        if joint.is_at_rest and q != joint.q], max(earliest, *map(duration, phases)))
    for j, (joint, q) in enumerate(joints):
        if joint.is_at_rest:
            phases[j] = [(T, (q - joint.q) * jerk) for T, jerk in together]
    return Plan(start, phases, Reference(goal.copy(), 0.0 * goal, 0.0 * goal))


def _straight(joints: list[tuple[float, Bounds]], earliest: float) -> Phases:
    """Return the motion from 0 to 1 of joints at rest, with their distances and bounds."""
    if not joints:
        return []
    v, a, jerk = (min(getattr(bounds, name) / distance for distance, bounds in joints)
                  for name in ('v_max', 'a_max', 'jerk'))
    return to_rest(1.0, 0.0, 0.0, Bounds(-v, v, -a, a, jerk), earliest)


def plan_with_target(
    start: Reference, target: Reference, time: float, limits: MotionLimits, follow_time: float,
) -> Plan:
    """
    Return the motion that meets a moving target, follows it, and stops.

    `target` is its state at `time` [s]; its acceleration is constant. Joints follow it until
    `follow_time` [s] later, as far as they can stop within the position limits. A joint that
    cannot follow moves to rest at the position of the target, or shortly before a limit.
    """
    return Plan(start, [joint.followed(state, time, follow_time) for joint, state in zip(
        _joints(start, limits), _states(target))])


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
