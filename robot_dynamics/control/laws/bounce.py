# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Bounces of an arm off a stiff surface.

An impact reverses the velocity within a few ms. The damping of the fall acts T later, 8 to 12 ms
at 250 Hz with a delay of 8 ms, and then accelerates the rise. In a bounce of the time P the
velocity changes linearly, and damping that is late by T does the work 1 − 6 x + 6 x², x = T/P, of
damping without delay: bounces of 5 T never end. The damping of the rise alone takes energy out of
bounces down to 3 T. Within MEMORY after an impact only motions away from the surface are therefore
damped.

The impulse M Δq̇ of an impact is the direction of the surface at the joints. Impacts differ from
oscillations of the loop: the feedback does not explain them, and all have the same direction.
"""

from collections.abc import Callable
import math

import numpy as np
from robot_dynamics.arrays import FloatArray

MEMORY, FORGOTTEN = 0.08, 0.5
"""[s] after an impact without damping towards the surface, and until that surface is forgotten."""
UNEXPLAINED = 1.5
"""Change of the velocity by that of the feedback, at least, in an impact."""
IMPACTS = 3
"""On the same surface without others: noise of the velocity looks like impacts on any surface."""


class Bounce:
    """The last impact of n joints."""

    def __init__(self, n: int) -> None:
        self._v = self._e_dot = self._impulse = self._direction = np.zeros(n)
        """Last velocity and its error, M u and u (n,), the change of velocity with uᵀ M u = 1."""
        self._stamp_ns = self._impact_ns = self._count = 0
        self.is_near = False
        """Whether the last IMPACTS were on the same surface, and the last within MEMORY."""

    def take(
        self, stamp_ns: int, v: FloatArray, e_dot: FloatArray, M: FloatArray,
        acceleration: Callable[[], FloatArray],
    ) -> None:
        """
        Take the velocity and its error (n,) at a state, with M (n, n).

        `acceleration` returns M⁻¹ τ (n,) with the effort τ of the feedback.
        """
        dt, before, change = 1e-9 * (stamp_ns - self._stamp_ns), self._v, self._e_dot - e_dot
        self._stamp_ns, self._v, self._e_dot = stamp_ns, v, e_dot
        impulse = M @ change
        if impulse @ before < 0.0 < impulse @ v and 0.0 < dt < MEMORY:
            self._take_reversal(stamp_ns, M, change, dt * acceleration())
        self.is_near = self._count >= IMPACTS and stamp_ns - self._impact_ns < 1e9 * MEMORY

    def _take_reversal(
        self, stamp_ns: int, M: FloatArray, change: FloatArray, explained: FloatArray,
    ) -> None:
        unexplained = change - explained
        impulse = M @ unexplained
        size = math.sqrt(float(impulse @ unexplained))
        if size > UNEXPLAINED * math.sqrt(float(explained @ M @ explained)):
            is_same = stamp_ns - self._impact_ns < 1e9 * FORGOTTEN and bool(
                impulse @ self._direction > 0.0)
            self._count = self._count + 1 if is_same else 1
            self._direction, self._impulse = unexplained / size, impulse / size
            self._impact_ns = stamp_ns

    def approach(self, v: FloatArray) -> FloatArray | float:
        """Return the part (n,) of a velocity (n,) towards the surface, 0 without one."""
        return self._direction * min(float(self._impulse @ v), 0.0) if self.is_near else 0.0
