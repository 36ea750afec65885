# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
One joint with backlash and viscous friction, solved in segments without numerical integration.

Between events the motion consists of exponentials and parabolas; events are found by bracketing.
"""

from collections.abc import Callable

import numpy as np
from robot_dynamics.simulation.backlash import CONTACT_TIME
from scipy.optimize import brentq

SLOW = 1e-3
"""Velocity [rad/s] below which the contact is kept."""


class ExactJoint:
    """
    A joint of inertia M [kg·m²] with friction F [N·m·s/rad], and its motor J on the joint side.

    Without contact, J θ̈ = τ and M q̈ = −F q̇; in contact, (M + J) q̈ = τ − F q̇.
    """

    def __init__(self, M: float, J: float, F: float, half_gap: float, restitution: float) -> None:
        self._M, self._J, self._F, self._b, self._e = M, J, F, half_gap, restitution
        self.q = self.v = self.theta = self.omega = 0.0
        self._side = 0.0
        """Side of the contact, 0 without contact."""
        self.impacts = self.separations = 0

    def step(self, tau: float, h: float) -> None:
        """Advance by h [s] with a constant motor effort."""
        while h > 0.0:
            h -= self._together(tau, h) if self._side else self._apart(tau, h)

    def _coast(self, tau: float, inertia: float, t: float) -> tuple[float, float]:
        """Return position and velocity of the joint after t [s]."""
        rate = self._F / inertia
        decay, last = np.exp(-rate * t), tau / self._F
        return (self.q + last * t + (self.v - last) * (1.0 - decay) / rate,
                last + (self.v - last) * decay)

    def _push(self, tau: float, v: float) -> float:
        """Return the contact torque [N·m]."""
        return self._side * (tau - self._J * (tau - self._F * v) / (self._M + self._J))

    def _together(self, tau: float, h: float) -> float:
        """Return the time until separation, at most h, and advance to it."""
        until, both = 0.0, self._M + self._J
        if self._push(tau, self.v) >= 0.0:
            until = first_below(lambda t: self._push(tau, self._coast(tau, both, t)[1]), h)
            self.q, self.v = self._coast(tau, both, until)
            self.theta, self.omega = self.q + self._side * self._b, self.v
        if until < h:
            self._side, self.separations = 0.0, self.separations + 1
        return until

    def _apart(self, tau: float, h: float) -> float:
        """Return the time until contact, at most h, and advance to it."""
        def motor(t: float) -> float:
            return self.theta + self.omega * t + 0.5 * tau / self._J * t * t

        until = first_below(
            lambda t: self._b - abs(motor(t) - self._coast(0.0, self._M, t)[0]), h)
        (self.q, self.v), self.theta = self._coast(0.0, self._M, until), motor(until)
        self.omega += tau / self._J * until
        if until < h:
            self._reach_contact(tau)
        return until

    def _reach_contact(self, tau: float) -> None:
        self._side, self.impacts = np.sign(self.theta - self.q), self.impacts + 1
        self.theta = self.q + self._side * self._b
        w, m = self.omega - self.v, self._M * self._J / (self._M + self._J)
        press = self._side * (tau + self._J * self._F * self.v / self._M)
        if abs(w) < SLOW or 2.0 * self._e * abs(w) * self._J < press * CONTACT_TIME:
            e = 0.0
        else:
            e = self._e
        self.v += (1.0 + e) * m * w / self._M
        self.omega -= (1.0 + e) * m * w / self._J
        if e == 0.0:
            self.omega = self.v
        else:
            self._side = 0.0


def first_below(f: Callable[[float], float], h: float) -> float:
    """Return the first time in [0, h] at which f becomes negative, or h; f(0) ≥ 0."""
    times = np.linspace(0.0, h, 65)
    below = [k for k in range(1, len(times)) if f(times[k]) < 0.0]
    if not below:
        return h
    early, late = times[below[0] - 1], times[below[0]]
    if early == 0.0:  # starts at the contact: search for the return to it
        early = 1e-9 * late
        if f(early) < 0.0:
            return 0.0
    return float(brentq(f, early, late, xtol=1e-15, rtol=1e-14))
