# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Laws of springs and dampers whose modes are known in the present configuration.

τ = M(q) q̈_ref + C(q, q̇) q̇ + g(q) + friction + τ_spring + D ė. Without the first term the arm
would leave a moving reference and pass its end (B. Paden, R. Panja, Int. J. Control 47(6), 1988).
The double diagonalisation M(q) = Q Qᵀ, K = Q Ω² Qᵀ yields the natural frequencies Ω of the
present configuration (A. Albu-Schäffer, C. Ott, U. Frese, G. Hirzinger, *Cartesian impedance
control of redundant robots*, ICRA 2003). Sampled feedback cannot control the fast ones: at most
Ω_c = LARGEST_FREQUENCY times the scale of the gains are permitted.
"""

import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.gain_scaling import CROSSOVER, DELAY_LAG, LOOP_DELAY
from robot_dynamics.control.laws.computed_torque import CHANGE_FRACTION, FollowingLaw
from robot_dynamics.control.laws.control_law import LawInput
from robot_dynamics.control.laws.error_feedback import ErrorFeedback, Tracking
from robot_dynamics.control.options import LawOptions
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics

LARGEST_FREQUENCY = DELAY_LAG / (CROSSOVER * LOOP_DELAY)
"""30 rad/s, of the fastest mode that a loop controls whose effort acts LOOP_DELAY late."""
LEAST_INERTIA = 1e-9
"""Share of M_jj, and [kg·m²] or [kg], added to M_jj, which can be 0 without rotors."""
NEARBY = 0.01
"""[rad] or [m] from the position of the gains in use, within which they are not computed again."""


class ModalImpedance(FollowingLaw):
    """A spring and a damper; a subclass defines `gains`, and `spring` if it is not K e."""

    def __init__(self, feedback: ErrorFeedback, options: LawOptions) -> None:
        super().__init__(feedback.scaled(0.0), options)  # for the reference and the errors
        n = options.arm.joint_count
        self._gains_at: tuple[UncheckedArmDynamics, FloatArray] | None = None
        """The dynamics and the position (n,) of the gains in use."""
        self._K = self._D = np.zeros((n, n))

    def gains(
        self, dynamics: UncheckedArmDynamics, q: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return K and D (n, n) at q (n,); raise LinAlgError far outside of the model's range."""
        raise NotImplementedError

    def spring(self, state: LawInput, e: FloatArray) -> FloatArray:
        """Return the effort (n,) of the spring at an error e (n,) of the joints."""
        return np.asarray(self._K @ e)

    def damper(self, state: LawInput, e: FloatArray, e_dot: FloatArray) -> FloatArray:
        """Return the effort (n,) of the damper at errors (n,) of position and velocity."""
        return np.asarray(self._D @ e_dot)

    @property
    def largest_frequency(self) -> float:
        """Ω_c [rad/s] at the scale of the gains."""
        return LARGEST_FREQUENCY * float(np.min(self.scale, initial=1.0))

    def scale_gains(self, scale: FloatArray) -> None:
        """Scale the largest frequency."""
        super().scale_gains(scale)
        self._gains_at = None

    def closed_loop(self, M: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the closed loop at the largest frequency, which no mode exceeds in any pose."""
        c = LARGEST_FREQUENCY
        return c * c * np.eye(len(M)), 2.0 * c * np.eye(len(M))

    def stiffness(self, M: FloatArray) -> FloatArray:
        """Return the diagonal of K at the last state; before, that of the closed loop."""
        return np.diagonal(self._K) if self._K.any() else super().stiffness(M)

    def correct(
        self, state: LawInput, tracking: Tracking,
    ) -> tuple[FloatArray, FloatArray | None, float]:
        """Return q̈_ref, the effort of spring and damper, and the factor s."""
        dynamics, q, at, s = state.dynamics, state.q_ahead, self._gains_at, 1.0
        if at is None or at[0] is not dynamics or not (
                math.dist(at[1].tolist(), q.tolist()) <= NEARBY):
            try:
                K, D = self.gains(dynamics, q)
            except np.linalg.LinAlgError:  # the rounding of M, or no finite J
                K = D = np.full_like(self._K, np.nan)
            self._K, self._D = K, D
            self._gains_at = dynamics, q
            self.ratio = np.diagonal(K) / np.maximum(np.diagonal(D), 1e-9)
        e, e_dot = tracking.error, tracking.velocity - state.v
        spring = self.spring(state, e)
        damper = self.damper(state, e, e_dot)
        change = 5.0 * (self._K @ e_dot)  # K ė + D M⁻¹ D ė
        if not (np.abs(change) <= CHANGE_FRACTION * self.effort_rate).all():
            share, s = self.shares(spring, damper, change, e * e_dot)
            spring, damper = share * spring, s * damper
        return tracking.acceleration, spring + damper, s


def root_of(M: FloatArray) -> FloatArray:
    """Return L (n, n) with M = L Lᵀ; raise LinAlgError if M is not positive definite."""
    return np.asarray(
        np.linalg.cholesky(M + np.diag(LEAST_INERTIA * np.diagonal(M) + LEAST_INERTIA)))
