# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Observer of the motion of joints without a signal, from the motion of the other joints."""

import math

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics

POSITION, VELOCITY = 0.003, 0.2
"""[rad], [rad/s]: standard deviations of the first estimate."""
ACCELERATION = 0.2
"""[rad/s² √s] of the noise that accelerates the joints."""
EFFORT = 0.001
"""[√s] of the noise of the effort of the other joints, as a fraction of their effort limit."""
NOISE = 0.3
"""[rad/s² √s] of the noise of the measured accelerations."""
UNKNOWN_EFFORT = 0.01
"""RMS by which noise, friction or a load may disturb the other joints, by their effort limits."""
FILTER_TIME = 0.05
"""[s] of the low-pass filters of this disturbance and of its square."""
LONGEST_STEP = 0.0055
"""[s] between two states up to which one step of integration is exact enough."""
STEADY = 0.5
"""Fraction of the square that the square of the mean has, if friction or a load is the cause."""
_STEP = 1e-5


class FrozenJointObserver:
    """
    An extended Kalman filter of position and velocity of the joints m without a signal.

    The state is x = (q_m, q̇_m). Its motion follows from the measured accelerations a_o of the
    other joints: q̈_m = M_mm⁻¹ (τ_m − h_m − M_mo a_o), h = C q̇ + g. The measurement is
    r_o = τ_o − h_o − M_oo a_o − M_om q̈_m, which is 0 at the true state. It makes the estimate
    follow a joint that gravity would topple, whose predicted motion alone diverges.

    Noise, unknown friction or a load at the other joints changes r_o, and so the estimate.
    `is_valid` becomes false when the RMS of r_o exceeds UNKNOWN_EFFORT. It is false for joints
    with known dry friction, and if all joints are frozen. `is_held` tells whether a steady r_o
    has been found: friction, which probably holds the joints m too.

    Source: D. Simon, *Optimal State Estimation*, Wiley 2006, section 13.2.
    """

    def __init__(
        self, marks: BoolArray, dynamics: UncheckedArmDynamics, q: FloatArray, v: FloatArray,
    ) -> None:
        """Begin at (q, v), (n,) each, of which the joints `marks` (n,) are estimated."""
        self.q, self.v = q, v
        self._m, self._o = np.flatnonzero(marks), np.flatnonzero(~marks)
        arm, k = dynamics.arm, len(self._m)
        self.is_valid = len(self._o) > 0 and not arm.friction.at_rest.static[marks].any()
        self.is_held = False
        limit = arm.limits.effort[self._o]
        self._limit = np.where(np.isfinite(limit), limit, 0.0)
        self._mean, self._power = np.zeros((2, len(limit)))
        self._weight = 0.0
        """Sum of the weights of both means, 1 after some time."""
        self._P = np.diag(np.repeat(np.square([POSITION, VELOCITY]), k))

    @property
    def is_used(self) -> bool:
        """Whether the estimate is valid, and was for FILTER_TIME."""
        return self.is_valid and self._is_known

    @property
    def _is_known(self) -> bool:
        """Whether the states of FILTER_TIME have shown how large the disturbance is."""
        return self._weight > 1.0 - math.exp(-1.0)

    def update(
        self, dynamics: UncheckedArmDynamics, torque: FloatArray, dt: float, q: FloatArray,
        v: FloatArray | None,
    ) -> None:
        """
        Take a measured state, dt > 0 [s] after the last one, and the torque (n,) since then.

        v is None if no velocity is measured.
        """
        try:
            r = self._correct(dynamics, torque, dt, q, (q - self.q) / dt if v is None else v)
        except np.linalg.LinAlgError:  # no finite estimate, or no inertia at a joint
            self.is_valid = False
            return
        weight = 1.0 - math.exp(-dt / FILTER_TIME)
        self._mean += weight * (r - self._mean)
        self._power += weight * (r * r - self._power)
        self._weight += weight * (1.0 - self._weight)
        is_disturbed = self._is_known & (self._power > (UNKNOWN_EFFORT * self._limit) ** 2)
        is_steady = self._mean ** 2 > STEADY * self._weight * self._power
        self.is_held = bool((is_disturbed & is_steady).any())
        self.is_valid = dt <= LONGEST_STEP and not is_disturbed.any() and bool(
            np.isfinite(self.q).all() and np.isfinite(self.v).all())

    def _correct(
        self, dynamics: UncheckedArmDynamics, torque: FloatArray, dt: float, q: FloatArray,
        v: FloatArray,
    ) -> FloatArray:
        """Estimate the present state; return r_o since the last one."""
        m, o, k = self._m, self._o, len(self._m)
        a_o = (v - self.v)[o] / dt
        a, r, M = self._equation(dynamics, torque, a_o, self.q, self.v)
        A, H = self._derivatives(dynamics, torque, a_o, a, r)
        F = np.eye(2 * k)
        F[:k, k:] = dt * np.eye(k)
        F[k:] += dt * A
        P = F @ self._P @ F.T
        P[k:, k:] += ACCELERATION ** 2 * dt * np.eye(k)
        M_om = M[np.ix_(o, m)]
        S = M[np.ix_(o, o)] - M_om @ np.linalg.solve(M[np.ix_(m, m)], M_om.T)  # −∂r/∂a_o
        R = (np.diag((EFFORT * self._limit) ** 2) + NOISE ** 2 * S @ S.T) / dt
        K = np.linalg.lstsq(H @ P @ H.T + R, H @ P)[0].T
        correction = -K @ r
        P = P - K @ H @ P
        self._P = 0.5 * (P + P.T)
        position = self.q[m] + dt * (self.v[m] + 0.5 * dt * a) + correction[:k]
        velocity = self.v[m] + dt * a + correction[k:]
        self.q, self.v = q.copy(), v.copy()
        self.q[m], self.v[m] = position, velocity
        return r

    def _equation(
        self, dynamics: UncheckedArmDynamics, torque: FloatArray, a_o: FloatArray, q: FloatArray,
        v: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return q̈_m, r_o and M(q)."""
        m, o = self._m, self._o
        M, h = dynamics.rigid_body.mass_matrix(q), dynamics.rigid_body.nonlinear(q, v)
        if not dynamics.is_frictionless:
            h = h + dynamics.friction_effort(v, h)
        free, M_mo = torque - h, M[np.ix_(m, o)]
        a_m = np.asarray(
            np.linalg.solve(M[np.ix_(m, m)], free[m] - M_mo @ a_o), dtype=np.float64)
        r_o: FloatArray = free[o] - M[np.ix_(o, o)] @ a_o - M_mo.T @ a_m
        return a_m, r_o, M

    def _derivatives(
        self, dynamics: UncheckedArmDynamics, torque: FloatArray, a_o: FloatArray, a: FloatArray,
        r: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of q̈_m (k, 2k) and r_o (n − k, 2k) by the state."""
        columns = []
        for i in range(2 * len(self._m)):
            x = np.array([self.q, self.v])
            x[divmod(i, len(self._m))[0], self._m[i % len(self._m)]] += _STEP
            moved_a, moved_r, _ = self._equation(dynamics, torque, a_o, *x)
            columns.append(np.concatenate([moved_a - a, moved_r - r]) / _STEP)
        both = np.transpose(columns)
        return both[:len(self._m)], both[len(self._m):]
