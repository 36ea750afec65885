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
Which joints stick, and what holds them: Coulomb friction at rest.

A joint with dry friction either slides in one direction, or sticks: its velocity is 0, and
friction takes whatever value up to F_s keeps it so. Between changes of these modes the motion is
smooth, so that a method of high order can follow it; where a joint comes to rest, or breaks away,
the modes are chosen anew. Source: F. Pfeiffer and C. Glocker, *Multibody Dynamics with Unilateral
Contacts*, Wiley 1996 (here without contacts: one direction of sliding a joint).
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray

# Relative slack, so that rounding does not break a joint away.
_HOLD_TOLERANCE = 1e-12
# After so many changes of mode the last choice stands; two or three are the rule.
_CHANGES_PER_JOINT = 20


class Modes(NamedTuple):
    """The `direction` (n,) of sliding, 0 where there is none; `stuck` (n,), which joints stick."""

    direction: FloatArray
    stuck: BoolArray


class Holding(NamedTuple):
    """Accelerations (n,), 0 at stuck joints, and the friction (n,) that holds those."""

    acceleration: FloatArray
    friction: FloatArray


def hold(M: FloatArray, effort: FloatArray, stuck: BoolArray) -> Holding:
    """
    Return M a = effort + friction with a = 0 at the stuck joints, friction = 0 at the others.

    `effort` (n,) is what is left to accelerate the arm; `friction` is what the joints must bear,
    with the sign of what it resists.
    """
    a, friction = np.zeros_like(effort), np.zeros_like(effort)
    if not stuck.any():
        return Holding(np.asarray(np.linalg.solve(M, effort), dtype=np.float64), friction)
    free, held = np.flatnonzero(~stuck), np.flatnonzero(stuck)
    if len(free):
        a[free] = np.linalg.solve(M[free[:, None], free], effort[free])
    friction[held] = effort[held] - M[held[:, None], free] @ a[free]
    return Holding(a, friction)


def choose_modes(
    M: FloatArray, v: FloatArray, effort: FloatArray, sliding: FloatArray, static: FloatArray,
) -> Modes:
    """
    Return the modes at a state: a joint at rest sticks if friction of at most F_s can hold it.

    `effort` (n,) is what would accelerate the arm if there were no dry friction, `sliding` (n,)
    the size of dry friction where a joint slides at v, `static` (n,) F_s. Of joints that cannot be
    held, the one that is furthest beyond breaks away first, and the rest is weighed anew. A joint
    that broke away, and that others then push back the other way, sticks again: friction never
    drives.
    """
    dry = static > 0.0
    at_rest = dry & (v == 0.0)
    direction = np.where(dry, np.sign(v), 0.0)
    stuck = at_rest.copy()
    for _ in range(_CHANGES_PER_JOINT * int(at_rest.sum())):
        a, friction = hold(M, effort - direction * sliding, stuck)
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
