# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Events that change the mode of motion: joints stop or break away, teeth collide or separate.

Each kind of event has a margin, which is positive before the event. If a margin is negative after
a step, the step is repeated up to the first event. Newton's method finds its time, with an initial
guess from the motion at both ends of the step.

The guess is the root of a Hermite polynomial. Its coefficients c_k are those of Σ c_k s^k with
s = t/h in [0, 1].
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.stiction import constrained_motion
from robot_dynamics.simulation.backlash import TOUCH
from robot_dynamics.simulation.joint_forces import GearModes, JointForces, MotionState

_ITERATIONS = 60
_FINEST = 1e-12
"""Accuracy of the time of an event, as a fraction of a step."""
_NUDGE = 1e-3
"""Fraction of a step with constant acceleration, which is used to reach an event exactly."""
# Kinds of events, and the tolerances within which an event is reached.
_TURN, _SLIP, _IMPACT, _PART = range(4)
_AT_REST = 1e-10
"""[rad/s] or [m/s]"""
_IMPACT_TOLERANCE = 0.1 * TOUCH
_SLACK = 1e-9
"""Fraction of an effort, or of a presliding distance."""
_ROOT_ITERATIONS = 40
_ROOT_ACCURACY = 1e-9


class StepEnd(NamedTuple):
    """The end state of a piece of motion, its heat [J], and the accelerations `a` (n,)."""

    state: MotionState
    heat: float
    a: FloatArray


Advance = Callable[[float], StepEnd]
"""From one state, for a time [s], in one mode."""


class Event(NamedTuple):
    """The first event of a step: its time [s], and the motion up to the event."""

    time: float
    end: StepEnd


class EventFinder:
    """Finds the events of motions under the same forces."""

    def __init__(self, forces: JointForces) -> None:
        self._forces = forces

    def first(
        self, state: MotionState, h: float, modes: GearModes, a: FloatArray, end: StepEnd,
        advance: Advance,
    ) -> Event | None:
        """
        Return the first event in the h [s] from `state` to `end`, or None.

        `a` (n,) is the acceleration at the start.
        """
        margins = self._margins(end, modes)
        if margins.min() >= 0.0:
            return None
        early, late, time, before = 0.0, h, h, (0.0, 1.0)
        guess = self._first_guess(state, h, modes, a, end, margins)
        for i in range(1, _ITERATIONS):
            # Newton's step, limited to the interval between the previous trials.
            time = guess if i % 4 and early < guess < late else 0.5 * (early + late)
            end = advance(time)
            margins = self._margins(end, modes)
            kind, j = divmod(int(np.argmin(margins)), len(a))
            worth = float(margins[kind, j])
            rate = self._margin_rate(kind, j, end.state, end.a, modes) or (
                (worth - before[1]) / (time - before[0]))
            guess = time - worth / rate if rate else np.nan
            near = kind in (_TURN, _IMPACT) and abs(guess - time) < _NUDGE * h
            if abs(worth) > 1.0 and near and early < guess < late:
                end = self._nudged(end, guess - time, modes)
                margins, time = self._margins(end, modes), guess
                worth = float(margins.min())
            if abs(worth) <= 1.0 or late - early <= _FINEST * h:
                break
            early, late = (time, late) if worth > 0.0 else (early, time)
            before = time, worth
        q, v, theta, omega, z = end.state
        stops = margins[_TURN] <= 1.0
        if modes.springs is not None:
            slips = modes.springs.holds & (margins[_SLIP] <= 1.0)
            z = np.where(slips, np.sign(z), z)
        stopped = MotionState(
            q, np.where(stops, 0.0, v), theta, np.where(stops & ~modes.open, 0.0, omega), z)
        return Event(time, end._replace(state=stopped))

    def _first_guess(
        self, state: MotionState, h: float, modes: GearModes, a: FloatArray, end: StepEnd,
        margins: FloatArray,
    ) -> float:
        """Return the estimated time [s] of the first event, from the motion at both ends."""
        after, times = end.state, [h]
        for kind, j in np.argwhere(margins < 0.0):
            if kind == _TURN:
                way = modes.joints.direction[j]
                times.append(first_crossing(cubic(
                    h, (way * state.v[j], way * a[j]),
                    (way * after.v[j], way * end.a[j])), h))
            elif kind == _IMPACT:
                side = np.sign(after.theta[j] - after.q[j])
                times.append(first_crossing(quintic(
                    h, self._distance(j, side, state, a), self._distance(j, side, after, end.a)),
                    h))
            else:
                at_first = float(self._margins(StepEnd(state, 0.0, a), modes)[kind, j])
                times.append(h * max(at_first, 0.0) / (at_first - margins[kind, j]))
        return min(times)

    def _distance(
        self, j: int, side: float, state: MotionState, a: FloatArray,
    ) -> tuple[float, float, float]:
        """Return the distance of the teeth of joint j on that side, and its two derivatives."""
        assert self._forces.backlash is not None
        q, v, theta, omega, _ = (float(x[j]) for x in state)
        spin_up = float(self._forces.tau[j] / self._forces.backlash.inertia[j])
        return (float(self._forces.backlash.half_gap[j]) - side * (theta - q), -side * (omega - v),
                -side * (spin_up - float(a[j])))

    def _margin_rate(
        self, kind: int, j: int, state: MotionState, a: FloatArray, modes: GearModes,
    ) -> float | None:
        """Return the rate [1/s] of a margin, or None if it is not available."""
        if kind == _TURN:
            return float(modes.joints.direction[j] * a[j] / _AT_REST)
        if kind == _SLIP and modes.springs is not None and modes.springs.holds[j]:
            assert self._forces.bristles is not None
            way = float(np.sign(state.z[j]) * state.v[j])
            return -way / (_SLACK * float(self._forces.bristles.distance[j]))
        if kind == _IMPACT:
            side = np.sign(state.theta[j] - state.q[j])
            return self._distance(j, side, state, a)[1] / _IMPACT_TOLERANCE
        return None

    def _nudged(self, end: StepEnd, dt: float, modes: GearModes) -> StepEnd:
        """Return the motion a short time later or earlier, with constant accelerations."""
        q, v, theta, omega, z = end.state
        spin_up = end.a
        if self._forces.backlash is not None:
            spin_up = np.where(modes.open, self._forces.tau / self._forces.backlash.inertia, end.a)
        moved = v * dt + 0.5 * dt * dt * end.a
        if self._forces.bristles is not None:
            z = self._forces.bristles.after(z, moved, modes.joints.direction)
        state = MotionState(
            q + v * dt + 0.5 * dt * dt * end.a, v + end.a * dt,
            theta + omega * dt + 0.5 * dt * dt * spin_up, omega + spin_up * dt, z)
        friction = self._forces.dry_friction(q, v, modes)
        return StepEnd(state, end.heat + dt * float(friction @ v), end.a)

    def _margins(self, end: StepEnd, modes: GearModes) -> FloatArray:
        """
        Return the margin (4, n) of each kind of event: ∞ if impossible, negative if passed.

        The unit is the tolerance: an event is reached between -1 and 1.
        """
        forces, (q, v, theta, _, z), (direction, stuck) = self._forces, end.state, modes.joints
        margins = np.full((4, len(v)), np.inf)
        if forces.friction.is_dry:
            np.divide(direction * v, _AT_REST, out=margins[_TURN], where=direction != 0.0)
        if stuck.any():
            static = forces.friction.breakaway[stuck]
            effort = forces.effort(q, v, modes.open, modes.springs, direction) - (
                direction * forces.friction.dry(v))
            M = forces.body_with(modes.open).mass_matrix(q)
            needed = constrained_motion(M, effort, stuck).friction
            margins[_SLIP, stuck] = (static - np.abs(needed[stuck])) / (_SLACK * static) + 2.0
        if modes.springs is not None:
            held = modes.springs.holds
            margins[_SLIP, held] = (1.0 - np.abs(z[held])) / _SLACK + 2.0
        if forces.backlash is not None:
            touches = modes.side != 0.0
            clearance = forces.backlash.clearance(q, theta)
            margins[_IMPACT, modes.open] = clearance[modes.open] / _IMPACT_TOLERANCE
            push = modes.side * (forces.tau - forces.backlash.inertia * end.a)
            slack = _SLACK * (np.abs(forces.tau) + 1e-3)
            margins[_PART, touches] = (push / slack)[touches] + 2.0
        return margins


def cubic(h: float, start: Sequence[float], end: Sequence[float]) -> tuple[float, ...]:
    """Return the cubic with these values and rates at both ends of h."""
    c0, c1 = start[0], h * start[1]
    P, V = end[0] - c0 - c1, h * end[1] - c1
    return c0, c1, 3.0 * P - V, V - 2.0 * P


def quintic(h: float, start: Sequence[float], end: Sequence[float]) -> tuple[float, ...]:
    """Return the quintic with these values, rates and second derivatives at both ends of h."""
    c0, c1, c2 = start[0], h * start[1], 0.5 * h * h * start[2]
    P, V, A = end[0] - c0 - c1 - c2, h * end[1] - c1 - 2.0 * c2, h * h * end[2] - 2.0 * c2
    return (c0, c1, c2, 10.0 * P - 4.0 * V + 0.5 * A, 7.0 * V - 15.0 * P - A,
            6.0 * P - 3.0 * V + 0.5 * A)


def first_crossing(coefficients: Sequence[float], h: float) -> float:
    """Return the root t in (0, h) of a polynomial that is positive at 0 and negative at h."""
    low, high, s = 0.0, 1.0, 1.0
    for _ in range(_ROOT_ITERATIONS):
        value = slope = 0.0
        for c in reversed(coefficients):
            slope = slope * s + value
            value = value * s + c
        low, high = (s, high) if value > 0.0 else (low, s)
        newton = s - value / slope if slope else low
        step = newton if low < newton < high else 0.5 * (low + high)
        if abs(step - s) <= _ROOT_ACCURACY * high:
            break
        s = step
    return s * h
