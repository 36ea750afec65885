# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Events that change the mode of motion: joints stop or break away, teeth collide or separate.

Each kind of event has a margin, which is positive before the event. If a margin is negative after
a step, the step is repeated up to the first event. Its time is found by the Illinois method (M.
Dowell, P. Jarratt, BIT 11, 1971), a regula falsi, of all margins together.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.stiction import constrained_motion
from robot_dynamics.simulation.backlash import TOUCH
from robot_dynamics.simulation.joint_forces import GearModes, JointForces, MotionState

_ITERATIONS = 60
_FINEST = 1e-12
"""Accuracy of the time of an event, as a fraction of a step."""
# Kinds of events, and the tolerances within which an event is reached.
_TURN, _SLIP, _IMPACT, _PART = range(4)
_AT_REST = 1e-10
"""[rad/s] or [m/s]"""
_IMPACT_TOLERANCE = 0.1 * TOUCH
_SLACK = 1e-9
"""Fraction of an effort, or of a presliding distance."""


class StepEnd(NamedTuple):
    """The end state of a piece of motion, its heat [J], and the accelerations `a` (n,)."""

    state: MotionState
    heat: float
    a: FloatArray


Advance = Callable[[float], StepEnd]
"""From one state, for a time [s], in one mode."""


def first_event(
    forces: JointForces, state: MotionState, h: float, modes: GearModes, a: FloatArray,
    end: StepEnd, advance: Advance,
) -> tuple[float, StepEnd]:
    """
    Return the time [s] and the end of the motion up to its first event, h and `end` without one.

    The motion takes h [s] from `state`; `a` (n,) is the acceleration at its start.
    """
    late_margins = _margins(forces, end, modes)
    if late_margins.min() >= 0.0:
        return h, end
    early, late, side = 0.0, h, 0.0
    early_margins = _margins(forces, StepEnd(state, 0.0, a), modes)
    for i in range(1, _ITERATIONS):
        time = early + (late - early) * _first_root(early_margins, late_margins, i % 4 == 0)
        end = advance(time)
        margins, before = _margins(forces, end, modes), side
        worth = float(margins.min())
        if abs(worth) <= 1.0 or late - early <= _FINEST * h:
            break
        side = np.sign(worth)
        # The margins at an end that remains are halved, so that both ends approach the event.
        share = 0.5 if side == before else 1.0
        if worth > 0.0:
            early, early_margins, late_margins = time, margins, share * late_margins
        else:
            late, late_margins, early_margins = time, margins, share * early_margins
    q, v, theta, omega, z = end.state
    stops = margins[_TURN] <= 1.0
    if modes.springs is not None:
        slips = modes.springs.holds & (margins[_SLIP] <= 1.0)
        z = np.where(slips, np.sign(z), z)
    stopped = MotionState(
        q, np.where(stops, 0.0, v), theta, np.where(stops & ~modes.open, 0.0, omega), z)
    return time, end._replace(state=stopped)


def _first_root(early: FloatArray, late: FloatArray, bisects: bool) -> float:
    """Return where in (0, 1) the first of the margins is 0, if they are linear in the time."""
    with np.errstate(divide='ignore', invalid='ignore'):
        root = float(np.where(late < 0.0, early / (early - late), 1.0).min())
    return 0.5 if bisects or not 0.0 < root < 1.0 else root


def _margins(forces: JointForces, end: StepEnd, modes: GearModes) -> FloatArray:
    """
    Return the margin (4, n) of each kind of event: ∞ if impossible, negative if passed.

    The unit is the tolerance: an event is reached between -1 and 1.
    """
    (q, v, theta, _, z), (direction, stuck) = end.state, modes.joints
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
