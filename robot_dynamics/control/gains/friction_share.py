# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
How much of the compensation of dry friction acts at joints whose feedback is weak.

A surplus of effort x acts for a delay T before the loop reacts, and accelerates the joint to
x T / m. On a wrist with m = 5e-4 kg·m², of which the model contains no rotor, 0.4 N·m too much
reach 8 rad/s in 10 ms: no gain prevents this. If the wrist has a rotor that the model lacks, the
surplus accelerates it slowly, but beyond its velocity limit while it catches up with its
reference. After a joint has run away in one of these ways, only SHARE of its compensation acts.

With a share that is too small the stiffness of such a joint, less than 1 N·m/rad, leaves it far
behind its reference. Beyond the width of the compensation at rest the share then grows, until
the joint catches up. Within this width nothing changes, so that the joint comes to rest.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics

SHARE = 0.75
"""Share of the compensation after each time that a joint has run away."""
SURPLUS = 0.3
"""Share of the given friction that is assumed to be too much."""
REACTION_TIME = 0.1
"""[s] in which a surplus acts before the loop reacts, with slow joint states."""
SPEED_FRACTION, LARGEST_SPEED = 0.4, 4.0
"""Velocity beyond the expected one at which a joint has run away, times its share squared, by the
velocity limit, which counts as 4 rad/s or m/s if it is larger."""
CATCH_UP = 0.6
"""Velocity that a position error explains, by that beyond it, at most."""
PAUSE = 0.2
"""[s] after a reduction, in which its effect is awaited."""
RATE = 0.5
"""[1/s] by which the share of a joint grows again that stays behind."""
PACE, MARGIN = 0.75, 0.25
"""Speed at which a joint has run away while it catches up, by its velocity limit, and by how much
it is at least faster than its reference then."""
SLOW = 0.05
"""[rad/s] or [m/s]: a joint that catches up with its reference at this velocity does not lag."""


class FrictionShare:
    """The shares of the compensation of dry friction that act, for n joints; 1 at heavy ones."""

    def __init__(self, velocity_limit: FloatArray) -> None:
        self.share: FloatArray = np.ones_like(velocity_limit)
        """Shares (n,) in (0, 1]."""
        self._limit = np.minimum(velocity_limit, LARGEST_SPEED)
        self._speed = SPEED_FRACTION * self._limit
        self._earliest = np.full_like(velocity_limit, -np.inf)
        self.least = float(self._speed.min(initial=np.inf))
        """[rad/s] or [m/s] below which no joint has run away."""

    def take(
        self, now: float, dt: float, dynamics: UncheckedArmDynamics, q: FloatArray,
        e: FloatArray, v: FloatArray, v_ref: FloatArray, expected: FloatArray,
        friction: FloatArray,
    ) -> bool:
        """
        Return whether a joint has run away at a time [s], dt [s] after the last state.

        `e` (n,) is the position error, `v` and `v_ref` (n,) are the velocities of joint and
        reference, `expected` (n,) what the position error explains of their difference, and
        `friction` (n,) is the compensation that acts.
        """
        most, ahead, direction = CATCH_UP * self._speed, v - v_ref, np.sign(friction)
        excess = ahead - np.minimum(np.maximum(expected, -most), most)
        pace = np.maximum(np.abs(v_ref) + MARGIN * self._limit, PACE * self._limit)
        runs = (excess * direction * self.share**2 > self._speed) | (v * direction > pace)
        runs &= now >= self._earliest
        lags = (np.abs(e) > dynamics.friction.tracking_width) & (ahead * np.sign(e) < SLOW)
        if not (runs | lags & (self.share < 1.0)).any():
            return False
        m = 1.0 / np.diagonal(np.linalg.pinv(dynamics.rigid_body.mass_matrix(q)))
        is_light = SURPLUS * dynamics.friction.at_rest.static * REACTION_TIME > self._speed * m
        runs &= is_light
        grown = np.minimum(self.share + RATE * dt, 1.0)
        self.share = np.where(runs, SHARE * self.share, np.where(
            lags & is_light, grown, self.share))
        self._earliest = np.where(runs, now + PAUSE, self._earliest)
        return bool(runs.any())
