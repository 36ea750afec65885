# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Stiction, which is Coulomb friction at rest: the sticking joints and their friction.

A joint with dry friction either slides in one direction, or sticks: its velocity is 0, and
friction has the value up to F_s that keeps it at rest. Between changes of these modes the motion
is smooth, so that a method of high order can integrate it; when a joint comes to rest, or breaks
away, the modes are determined again. Source: F. Pfeiffer and C. Glocker, *Multibody Dynamics with
Unilateral Contacts*, Wiley 1996 (here without contacts: one direction of sliding per joint).
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray

# Relative tolerance, so that rounding does not cause a joint to break away.
_HOLD_TOLERANCE = 1e-12
# After this number of mode changes the last choice is used; usually there are two or three.
_CHANGES_PER_JOINT = 20


class Modes(NamedTuple):
    """The `direction` (n,) of sliding, 0 without sliding; `stuck` (n,) marks sticking joints."""

    direction: FloatArray
    stuck: BoolArray


class ConstrainedMotion(NamedTuple):
    """Accelerations (n,), 0 at stuck joints, and the friction (n,) that holds these joints."""

    acceleration: FloatArray
    friction: FloatArray


def constrained_motion(M: FloatArray, effort: FloatArray, stuck: BoolArray) -> ConstrainedMotion:
    """
    Return M a = effort + friction with a = 0 at the stuck joints, friction = 0 at the others.

    `effort` (n,) is the net effort that accelerates the arm; `friction` is the effort that
    friction must compensate, with the sign of the effort that it resists.
    """
    a, friction = np.zeros_like(effort), np.zeros_like(effort)
    free, held = np.flatnonzero(~stuck), np.flatnonzero(stuck)
    if len(free):
        a[free] = np.linalg.solve(M[free[:, None], free], effort[free])
    friction[held] = effort[held] - M[held[:, None], free] @ a[free]
    return ConstrainedMotion(a, friction)


def choose_modes(
    M: FloatArray, v: FloatArray, effort: FloatArray, sliding: FloatArray, static: FloatArray,
) -> Modes:
    """
    Return the modes at a state: a joint at rest sticks if friction of at most F_s can hold it.

    `effort` (n,) is the effort that would accelerate the arm without dry friction, `sliding` (n,)
    is the magnitude of dry friction of a joint that slides at v, and `static` (n,) is F_s. Of the
    joints that friction cannot hold, the one with the largest excess breaks away first; then the
    modes of the others are determined again. If a joint that broke away is accelerated in the
    opposite direction by other joints, it sticks again, because friction never drives a joint.
    """
    dry = static > 0.0
    at_rest = dry & (v == 0.0)
    direction = np.where(dry, np.sign(v), 0.0)
    stuck = at_rest.copy()
    for _ in range(_CHANGES_PER_JOINT * int(at_rest.sum())):
        a, friction = constrained_motion(M, effort - direction * sliding, stuck)
        forward = np.where(at_rest & ~stuck, a * direction, 0.0)
        hindmost = int(np.argmin(forward))
        if forward[hindmost] < -_HOLD_TOLERANCE * np.abs(a).max():
            direction[hindmost], stuck[hindmost] = 0.0, True
            continue
        excess = np.where(stuck, np.abs(friction) - static * (1.0 + _HOLD_TOLERANCE), -np.inf)
        worst = int(np.argmax(excess))
        if excess[worst] <= 0.0:
            break
        direction[worst], stuck[worst] = np.sign(friction[worst]), False
    return Modes(direction, stuck)
