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
Backlash of gears: where motor and joint touch, and impacts of the teeth.

Seen from the joint, the motor stands at θ (its angle over N), with the inertia J = N² J_r. It may
be up to half the gap away from the joint's q, |θ − q| ≤ b. In between the two move on their own;
at θ − q = s b, s = ±1, the teeth touch on side s, and push, but never pull. Where they meet at
the relative velocity w = θ̇ − q̇, an impulse p acts on the joint and −p on the motor:

    p = (1 + e) m w,   1/m = 1/J + (M⁻¹)_jj,   heat = ½ (1 − e²) m w²

with Newton's restitution e. Momentum is conserved, and nothing but the heat is lost. Source: F.
Pfeiffer and C. Glocker, *Multibody Dynamics with Unilateral Contacts*, Wiley 1996, chapters 6
and 8; on gears: M. Nordin and P.-O. Gutman, Automatica 38, 2002, sections 2 and 3.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.joints.actuator import Actuators

TOUCH = 1e-11
"""[rad] or [m] within which teeth touch: rounding, and the accuracy of an event."""
CONTACT_TIME = 2e-4
"""
[s] that elastic teeth take to give back what they store: they do not leave each other for less.

A steel gear with the load that it drives rings at 1 to 5 kHz. Shorter bounces are taken as over.
"""


class ImpactResult(NamedTuple):
    """Velocities of joints and motors (n,) after teeth met, and the heat [J]."""

    v: FloatArray
    omega: FloatArray
    heat: float


@dataclass(frozen=True, eq=False)
class Backlash:
    """
    The backlash of n joints, each (n,), on the joint side.

    `half_gap` b [rad] or [m], 0 without backlash; `restitution` e in [0, 1]; `inertia` J of
    the motor [kg·m²] or [kg].
    """

    half_gap: FloatArray
    restitution: FloatArray
    inertia: FloatArray
    exists: BoolArray = field(init=False)
    """Which joints have backlash."""

    @staticmethod
    def of(actuators: Actuators | None) -> 'Backlash | None':
        """Return the backlash of these motors, or None without backlash."""
        if actuators is None or not actuators.backlash.any():
            return None
        return Backlash(
            0.5 * actuators.backlash, actuators.restitution, actuators.reflected_inertia)

    def __post_init__(self) -> None:
        object.__setattr__(self, 'exists', np.asarray(self.half_gap > 0.0))

    def resting_side(self, q: FloatArray, effort: FloatArray) -> FloatArray:
        """Return θ (n,) of motors that bear an effort (n,): on the side to which they push."""
        return np.asarray(q + np.sign(effort) * self.half_gap)

    def touching(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return the side s (n,) on which teeth touch; 0 in the gap and without backlash."""
        offset = theta - q
        touches = self.exists & (self.half_gap - np.abs(offset) <= TOUCH)
        return np.where(touches, np.sign(offset), 0.0)

    def clearance(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return how far (n,) the nearest tooth is; below 0 in contact, ∞ without backlash."""
        distance = self.half_gap + 0.2 * TOUCH - np.abs(theta - q)
        return np.where(self.exists, distance, np.inf)

    def impact(
        self, j: int, M: FloatArray, side: FloatArray, v: FloatArray, omega: FloatArray,
        push: FloatArray,
    ) -> ImpactResult:
        """
        Return the velocities after the teeth of joint j met.

        M (n, n) is the mass matrix without motors with backlash. Other motors that touch their
        joints at `side` (n,) and move with them go along, unless the impulse lifts them off:
        against `push` (n,), the force that holds them there, over CONTACT_TIME.
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
        return ImpactResult(after, turned, 0.5 * m * w * w * (1.0 - e * e))

    def join(
        self, M: FloatArray, joined: BoolArray, v: FloatArray, omega: FloatArray,
    ) -> ImpactResult:
        """Return the velocities after these motors (n,) took the velocity of their joints."""
        J = self.inertia * joined
        after = np.asarray(
            np.linalg.solve(M + np.diag(J), M @ v + J * omega), dtype=np.float64)
        change = v - after
        heat = 0.5 * float(change @ M @ change + J @ (omega - after)**2)
        return ImpactResult(after, np.where(joined, after, omega), heat)
