# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Presliding: the dry friction of a joint yields like a spring before it slides.

A joint with the presliding distance d has the deflection z in [−1, 1] of its bristles. While it
sticks, z follows the displacement, dz = dq / d, and its dry friction is

    F_s z + σ₁ v + F_o,   σ₁ = 2 ζ √(M_jj F_s / d) exp(−(v / v₀)²),   v₀ = √(F_s d / M_jj)

with ζ = 0.2. σ₁ damps oscillations of the bristles, and fades at the largest speed v₀ of an
oscillation without slip, so that a reversal in a motion has the friction F_s z. When z reaches ±1,
the joint slides at the law of `friction`, with z = ±1, until it comes to rest.

This is the force of the LuGre model (C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky,
IEEE Trans. Automatic Control 40(3), 1995, equation 3) with the elasto-plastic law of z of P.
Dupont, V. Hayward, B. Armstrong, F. Altpeter, IEEE Trans. Automatic Control 47(5), 2002, in its
limit z_ba = z_ss, which is also Dahl's model with the exponent 0 (P. R. Dahl, 1968), and Maxwell's
slip element.

It was chosen instead of the LuGre law ż = v − |v| z σ₀ / g(v) for three reasons. z is that of the
identification (`joints.presliding`), so that `identify` returns the distance of a simulated
recording. A joint under a small vibrating load does not creep, as it does in LuGre. It is passive
for every σ₁: while z changes, the power is that into the spring, plus σ₁ v² ≥ 0; in LuGre σ₁ is
bounded, or fades with speed. Between its events the force is a smooth function of position and
velocity: there is no additional state to integrate, and stiff springs have an exponential step
(`exponential_step`).

The spring stores ½ d (F_s z + F_o)² / F_s. Relaxed bristles, z = −F_o / F_s, have no force.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.joints.friction import JointFriction

DAMPING_RATIO = 0.2
"""ζ of the bristles with the inertia M_jj of their joint."""


class Springs(NamedTuple):
    """
    The bristles of joints that stick, each (n,): 0 for all other joints.

    `stiffness` [N·m/rad] or [N/m], `damping` σ₁ at rest [N·m·s/rad] or [N·s/m], `fading`
    1/v₀ [s/rad] or [s/m], and the positions `anchor` without deflection; `holds` marks these
    joints.
    """

    stiffness: FloatArray
    damping: FloatArray
    fading: FloatArray
    anchor: FloatArray
    holds: BoolArray

    def elastic(self, q: FloatArray) -> FloatArray:
        """Return the force F_s z, (..., n), at the positions q."""
        return self.stiffness * (q - self.anchor)

    def force(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return the friction (..., n), without F_o, that resists the motion."""
        return self.elastic(q) + self.damping_at(v) * v

    def damping_at(self, v: FloatArray) -> FloatArray:
        """Return σ₁ (..., n) at v."""
        ratio = v * self.fading
        return np.asarray(self.damping * np.exp(-ratio * ratio))


class Bristles(NamedTuple):
    """The bristles of n joints: `yields` marks those with a presliding distance, all (n,)."""

    yields: BoolArray
    distance: FloatArray
    static: FloatArray
    offset: FloatArray

    @staticmethod
    def of(friction: JointFriction) -> 'Bristles | None':
        """Return the bristles of this friction, or None if all joints stick rigidly."""
        yields = (friction.presliding_distance > 0.0) & (friction.breakaway > 0.0)
        if not yields.any():
            return None
        return Bristles(
            yields, np.where(yields, friction.presliding_distance, np.inf),
            np.where(yields, friction.breakaway, 0.0), np.where(yields, friction.offset, 0.0))

    def initial(self, v: FloatArray) -> FloatArray:
        """Return z (n,) of joints with an unknown past: they slide, or are relaxed at rest."""
        relaxed = -self.offset / np.where(self.yields, self.static, 1.0)
        return np.where(self.yields & (v != 0.0), np.sign(v), relaxed)

    def stored(self, z: FloatArray) -> float:
        """Return the energy of the springs [J]."""
        F_s, d = self.static[self.yields], self.distance[self.yields]
        force = F_s * z[self.yields] + self.offset[self.yields]
        return 0.5 * float((d / F_s) @ (force * force))

    def sliding(self, z: FloatArray, v: FloatArray) -> FloatArray:
        """Return the direction (n,) of sliding joints with bristles, 0 for all others."""
        return np.where((np.abs(z) >= 1.0) & (z * v > 0.0), np.sign(z), 0.0)

    def springs(
        self, q: FloatArray, z: FloatArray, direction: FloatArray, inertia: FloatArray,
    ) -> Springs | None:
        """
        Return the springs of the joints that do not slide, None if all slide.

        `inertia` (n,) is M_jj.
        """
        holds = self.yields & (direction == 0.0)
        if not holds.any():
            return None
        K = np.where(holds, self.static / self.distance, 0.0)
        anchor = np.where(holds, q - z * np.where(holds, self.distance, 0.0), 0.0)
        root = np.sqrt(K * inertia)
        fading = np.where(holds, root / np.where(holds, self.static, 1.0), 0.0)
        return Springs(K, 2.0 * DAMPING_RATIO * root, fading, anchor, holds)

    def after(self, z: FloatArray, moved: FloatArray, direction: FloatArray) -> FloatArray:
        """Return z (n,) after the displacement `moved` (n,) in a direction of sliding, or 0."""
        return np.where(self.yields & (direction != 0.0), direction, z + moved / self.distance)


def longest_undisturbed(
    springs: Springs, z: FloatArray, v: FloatArray, M: FloatArray, needed: FloatArray,
    free: BoolArray, static: FloatArray,
) -> float:
    """
    Return the time [s] in which no bristle slips unseen; ∞ if none can slip.

    `needed` (n,) is the friction that would hold the joints without a motion of the springs; the
    other joints that move are `free`. The deflections oscillate around it. Their energy does not
    grow, which bounds them. If the bound is beyond z = ±1, an angle of 0.5 of the fastest
    oscillation is the time.
    """
    e, f = np.flatnonzero(springs.holds), np.flatnonzero(free)
    inertia = M[e[:, None], e]
    if len(f):
        inertia = inertia - M[e[:, None], f] @ np.linalg.solve(M[f[:, None], f], M[f[:, None], e])
    K, F_s, u = springs.stiffness[e], static[e], v[e]
    middle = needed[e] / F_s
    away = F_s * (z[e] - middle)
    energy = 0.5 * float(u @ inertia @ u + away @ (away / K))
    if (np.abs(middle) + np.sqrt(2.0 * max(energy, 0.0) * K) / F_s <= 1.0).all():
        return np.inf
    root = np.sqrt(K)
    slowest = float(np.linalg.eigvalsh(inertia / np.outer(root, root)).min())
    return 0.5 * float(np.sqrt(max(slowest, 0.0)))
