# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Friction that is given too large: how fast its compensation grows at a joint that it drives away.

A surplus of effort x acts for a delay T before the loop reacts, and accelerates the joint to
x T / m. On a wrist with m = 5e-4 kg m², of which the model contains no rotor, 0.4 N·m too much
reach 8 rad/s in 10 ms: the joint exceeds its velocity limit, is stopped as a fault, and starts
again. No gain prevents this, but a compensation that grows slowly does, because the joint breaks
away at the true friction: at the rate 2 m Δv / T² its velocity grows by Δv in T.

A joint whose friction is given correctly needs its compensation at once. The limit therefore
begins only at a joint that has run away, and lasts as long as the law. Below SURE_FRACTION the
compensation is at most the true friction, and is never limited.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws import LawInput
from robot_dynamics.control.stable_gains import LOOP_DELAY
from robot_dynamics.joints.friction import smooth_sign, SMOOTHING_VELOCITY

SURE_FRACTION = 0.7
"""Fraction of the given friction that does not exceed the true one: it is given up to 1.4 times."""
AHEAD = 0.3
"""Distance ahead of the reference, in widths of the compensation, from which a joint runs away."""
SPEED_FRACTION = 0.1
"""Δv, and the velocity above the expected one that ends the growth, by the velocity limit."""
CATCH_UP_FRACTION = 0.5
"""Expected velocity of a joint behind its reference, by the velocity limit, at most."""
LARGEST_SPEED = 4.0
"""[rad/s] or [m/s] that counts as the velocity limit if there is none, or a larger one."""
PAUSE = 0.1
"""[s] without a state after which the compensation begins anew."""


class FrictionOnset:
    """The bounds of the sign of the compensation, for one law; n joints."""

    def __init__(self, n: int) -> None:
        self._runs_away = np.zeros(n, dtype=bool)
        self._sign = np.zeros(n)
        self._stamp_ns = 0

    def bounds(
        self, state: LawInput, v: FloatArray, v_ref: FloatArray, e: FloatArray, rate: FloatArray,
    ) -> tuple[FloatArray | float, FloatArray | float]:
        """
        Return the smallest and largest sign (n,) of `JointFriction.tracking_effort`.

        `v` and `v_ref` (n,) are the velocities of the joints and of the reference, `e` (n,) the
        position error, and `rate` (n,) [1/s] is K_p/K_d.
        """
        width, speed = state.dynamics.friction.tracking_width, self._speed_limit(state)
        if not self._runs_away.any() and not (
                (np.abs(e) > AHEAD * width) | (np.abs(v) > speed)).any():
            return -1.0, 1.0
        direction = smooth_sign(v_ref, SMOOTHING_VELOCITY)
        sign = np.clip(direction + e / width, -1.0, 1.0)
        most = np.maximum(CATCH_UP_FRACTION * speed, np.abs(v_ref))
        excess = v - np.clip(v_ref + rate * e, -most, most)
        self._runs_away |= (v * sign > speed) | (
            (-e * direction > AHEAD * width) & (excess * direction > SPEED_FRACTION * speed))
        growth = self._growth(state, speed)
        growth = np.where(self._runs_away & (growth < 1.0 - SURE_FRACTION), growth, 2.0)
        is_limited = growth < 2.0
        upper = np.maximum(SURE_FRACTION, self._sign + growth)
        lower = np.minimum(-SURE_FRACTION, self._sign - growth)
        fast = SPEED_FRACTION * speed
        upper = np.where(is_limited & (excess > fast), SURE_FRACTION, np.minimum(upper, 1.0))
        lower = np.where(is_limited & (excess < -fast), -SURE_FRACTION, np.maximum(lower, -1.0))
        self._sign = np.minimum(np.maximum(sign, lower), upper)
        return lower, upper

    def _growth(self, state: LawInput, speed: FloatArray) -> FloatArray:
        """Return by how much the size of the sign may grow since the last state, (n,)."""
        dt = 1e-9 * (state.stamp_ns - self._stamp_ns)
        self._stamp_ns = state.stamp_ns
        if not 0.0 <= dt < PAUSE:
            self._sign, dt = np.zeros_like(speed), 0.0
        m = 1.0 / np.diagonal(np.linalg.pinv(state.dynamics.rigid_body.mass_matrix(state.q)))
        F = state.dynamics.friction.at_rest.static
        with np.errstate(divide='ignore', invalid='ignore'):
            return np.asarray(
                2.0 * m * SPEED_FRACTION * speed * dt / ((dt + LOOP_DELAY) ** 2 * F))

    @staticmethod
    def _speed_limit(state: LawInput) -> FloatArray:
        return np.minimum(state.dynamics.arm.limits.velocity, LARGEST_SPEED)
