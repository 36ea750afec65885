# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Friction that is given too large: how fast its compensation grows at a joint that it drives away.

A surplus of effort x acts for a delay T before the loop reacts, and accelerates the joint to
x T / m. On a wrist with m = 5e-4 kg m², of which the model contains no rotor, 0.4 N·m too much
reach 8 rad/s in 10 ms: the joint exceeds its velocity limit, is stopped as a fault, and starts
again, or it swings around its goal. Gains do not prevent this, but a compensation that grows
slowly does, because the joint breaks away at the true friction: at the rate 2 m Δv / T² its
velocity grows by Δv in T.

A joint whose friction is given correctly needs its compensation at once. The limit therefore
begins only at a joint that has run away, and lasts as long as the law. SURE_FRACTION of the
compensation is never limited: the rest of the true friction still damps the joint.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.gain_scaling import LOOP_DELAY
from robot_dynamics.control.laws.control_law import LawInput
from robot_dynamics.joints.friction import SMOOTHING_VELOCITY
from robot_dynamics.joints.friction_terms import smooth_sign
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics

SURE_FRACTION = 0.5
"""Fraction of the given friction that is below the true one, also if 1.4 times it is given."""
AHEAD = 0.3
"""Distance ahead of the reference, in widths of the compensation, from which a joint runs away."""
SPEED_FRACTION = 0.1
"""Δv, and the velocity above the expected one that ends the growth, by the velocity limit."""
CATCH_UP_FRACTION = 0.5
"""Expected velocity of a joint behind its reference, by the velocity limit, at most."""
LARGEST_SPEED = 4.0
"""[rad/s] or [m/s] that counts as the velocity limit if that is not set, or larger."""
PAUSE = 0.1
"""[s] without a state after which the compensation is reset."""


class FrictionOnset:
    """The bounds of the sign of the compensation, for one law; n joints."""

    def __init__(self, n: int) -> None:
        self._runs_away, self._limits = np.zeros(n, dtype=bool), False
        self._sign = np.zeros(n)
        self._stamp_ns = 0
        self._dynamics: UncheckedArmDynamics | None = None

    def bounds(
        self, state: LawInput, v: FloatArray, v_ref: FloatArray, e: FloatArray, rate: FloatArray,
    ) -> tuple[FloatArray | float, FloatArray | float]:
        """
        Return the smallest and largest sign (n,) of `JointFriction.tracking_effort`.

        `v` and `v_ref` (n,) are the velocities of the joints and of the reference, `e` (n,) the
        position error, and `rate` (n,) [1/s] is K_p/K_d.
        """
        if state.dynamics is not self._dynamics:
            self._use(state.dynamics)
        if not self._limits and e.dot(e) < self._near and v.dot(v) < self._slow:
            return -1.0, 1.0
        width, speed = self._width, self._speed
        direction = smooth_sign(v_ref, SMOOTHING_VELOCITY)
        sign = np.clip(direction + e / width, -1.0, 1.0)
        most = np.maximum(CATCH_UP_FRACTION * speed, np.abs(v_ref))
        excess = v - np.clip(v_ref + rate * e, -most, most)
        fast = SPEED_FRACTION * speed
        self._runs_away |= (excess * sign > CATCH_UP_FRACTION * speed) | (
            (-e * direction > AHEAD * width) & ((v - v_ref) * direction > fast))
        self._limits = bool(self._runs_away.any())
        growth = self._growth(state, fast)
        is_free = ~self._runs_away | (growth >= 1.0 - SURE_FRACTION)
        upper = np.where(is_free, 1.0, np.where(excess > fast, SURE_FRACTION, np.clip(
            self._sign + growth, SURE_FRACTION, 1.0)))
        lower = np.where(is_free, -1.0, np.where(excess < -fast, -SURE_FRACTION, np.clip(
            self._sign - growth, -1.0, -SURE_FRACTION)))
        self._sign = np.clip(sign, lower, upper)
        return lower, upper

    def _use(self, dynamics: UncheckedArmDynamics) -> None:
        """Take the limits of an arm; joints nearer and slower than the least do not run away."""
        self._dynamics, self._width = dynamics, dynamics.friction.tracking_width
        self._speed = np.minimum(dynamics.arm.limits.velocity, LARGEST_SPEED)
        self._near = float((AHEAD * self._width).min()) ** 2
        self._slow = float((CATCH_UP_FRACTION * self._speed).min()) ** 2

    def _growth(self, state: LawInput, change: FloatArray) -> FloatArray:
        """
        Return by how much the size of the sign may grow since the last state, (n,).

        `change` (n,) is Δv.
        """
        dt = 1e-9 * (state.stamp_ns - self._stamp_ns)
        self._stamp_ns = state.stamp_ns
        if not 0.0 <= dt < PAUSE:
            self._sign, dt = np.zeros_like(change), 0.0
        m = 1.0 / np.diagonal(np.linalg.pinv(state.dynamics.rigid_body.mass_matrix(state.q)))
        with np.errstate(divide='ignore', invalid='ignore'):
            rate = 2.0 * m * change / (dt + LOOP_DELAY) ** 2
            return np.asarray(rate * dt / state.dynamics.friction.at_rest.static)
