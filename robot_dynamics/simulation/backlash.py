# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Backlash of gears: contact between motor and joint, and impacts of the teeth.

On the joint side, the position of the motor is θ (its angle divided by N), and its inertia is
J = N² J_r. θ differs from the joint position q by at most half the gap, |θ − q| ≤ b. Inside the
gap motor and joint move independently; at θ − q = s b, s = ±1, the teeth are in contact on side s,
and transmit only compressive forces. At an impact with the relative velocity w = θ̇ − q̇, an
impulse p acts on the joint and −p on the motor:

    p = (1 + e) m w,   1/m = 1/J + (M⁻¹)_jj,   heat = ½ (1 − e²) m w²

with Newton's restitution e. Momentum is conserved, and only the heat is lost. Source: F.
Pfeiffer and C. Glocker, *Multibody Dynamics with Unilateral Contacts*, Wiley 1996, chapters 6
and 8; on gears: M. Nordin and P.-O. Gutman, Automatica 38, 2002, sections 2 and 3.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.joints.actuator import Actuators

TOUCH = 1e-11
"""Distance [rad] or [m] up to which teeth are in contact, for rounding and event accuracy."""
CONTACT_TIME = 2e-4
"""
Time [s] in which elastic teeth release their stored energy: shorter separations are ignored.

The natural frequency of a steel gear with its load is 1 to 5 kHz. Shorter bounces count as ended.
"""


Impact = tuple[FloatArray, FloatArray, float]
"""Velocities of joints and motors (n,) after an impact of teeth, and the heat [J]."""


class Backlash(NamedTuple):
    """
    The backlash of n joints, each (n,), on the joint side.

    `half_gap` b [rad] or [m], 0 without backlash; `restitution` e in [0, 1]; `inertia` J of
    the motor [kg·m²] or [kg].
    """

    half_gap: FloatArray
    restitution: FloatArray
    inertia: FloatArray
    exists: BoolArray
    """Which joints have backlash."""

    @staticmethod
    def of(actuators: Actuators | None) -> 'Backlash | None':
        """Return the backlash of these motors, or None without backlash."""
        if actuators is None or not actuators.backlash.any():
            return None
        return Backlash(
            0.5 * actuators.backlash, actuators.restitution, actuators.reflected_inertia,
            actuators.backlash > 0.0)

    def touching(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return the side s (n,) on which teeth touch; 0 in the gap and without backlash."""
        offset = theta - q
        touches = self.exists & (self.half_gap - np.abs(offset) <= TOUCH)
        return np.where(touches, np.sign(offset), 0.0)

    def clearance(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return the distance (n,) to the nearest tooth: < 0 in contact, ∞ without backlash."""
        distance = self.half_gap + 0.2 * TOUCH - np.abs(theta - q)
        return np.where(self.exists, distance, np.inf)

    def impact(
        self, j: int, M: FloatArray, side: FloatArray, v: FloatArray, omega: FloatArray,
        push: FloatArray,
    ) -> Impact:
        """
        Return the velocities after an impact of the teeth of joint j.

        M (n, n) is the mass matrix without motors with backlash. Other motors that are in contact
        with their joints at `side` (n,) and move with them remain in contact, unless the impulse
        separates them against `push` (n,), the contact force, over CONTACT_TIME.
        """
        J, e = self.inertia, float(self.restitution[j])
        held = (side != 0.0) & (omega == v)
        w, kept = omega[j] - v[j], np.maximum(push, 0.0) * CONTACT_TIME
        if 2.0 * e * abs(w) * J[j] < kept[j]:
            e = 0.0
        impulse_on_j = np.zeros_like(v)
        impulse_on_j[j] = 1.0
        while True:
            response = np.linalg.solve(M + np.diag(J * held), impulse_on_j)
            m = 1.0 / (1.0 / J[j] + response[j])
            dv = (1.0 + e) * m * w * response
            lifted = held & (side * J * dv > kept)
            if not lifted.any():
                break
            held &= ~lifted
        after = v + dv
        turned = np.where(held, after, omega)
        turned[j] = after[j] - e * w
        return after, turned, 0.5 * m * w * w * (1.0 - e * e)

    def join(
        self, M: FloatArray, joined: BoolArray, v: FloatArray, omega: FloatArray,
    ) -> Impact:
        """Return the velocities after these motors (n,) have assumed that of their joints."""
        J = self.inertia * joined
        after = np.asarray(
            np.linalg.solve(M + np.diag(J), M @ v + J * omega), dtype=np.float64)
        change = v - after
        heat = 0.5 * float(change @ M @ change + J @ (omega - after)**2)
        return after, np.where(joined, after, omega), heat
