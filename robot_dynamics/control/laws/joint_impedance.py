# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Joint impedance: a spring and a damper between each joint and its reference.

τ = M(q) q̈_ref + C(q, q̇) q̇ + g(q) + friction + K e + D ė. Without the first term the arm would
leave a moving reference and pass its end (B. Paden, R. Panja, Int. J. Control 47(6), 1988). With
the given stiffness K_0, diagonal, the double diagonalisation M(q) = Q Qᵀ, K_0 = Q Ω² Qᵀ yields the
natural frequencies Ω of the present configuration (A. Albu-Schäffer, C. Ott, U. Frese,
G. Hirzinger, *Cartesian impedance control of redundant robots*, ICRA 2003). Sampled feedback
cannot control the fast ones, of light joints and of joints that turn against each other: with Ω_c,
at most LARGEST_FREQUENCY times the scale of the gains, K = Q min(Ω, Ω_c)² Qᵀ, and
D = 2 ζ Q min(Ω, Ω_c) Qᵀ. Slower modes keep K_0. A given damping D_0 replaces this D, raised to
2 LEAST_RATIO Q min(Ω, Ω_c) Qᵀ and lowered to 2 Ω_c M.
"""

from functools import partial
import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.control_law import ControlLaw, equation_terms, LawInput, LawOutput
from robot_dynamics.control.laws.error_feedback import ErrorFeedback, LEAST_RATIO
from robot_dynamics.control.laws.friction_compensation import FrictionCompensation
from robot_dynamics.control.laws.rate_limited_feedback import CHANGE_FRACTION, feedback_shares
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm_dynamics import EffortTerms, UncheckedArmDynamics

LARGEST_FREQUENCY = 30.0
"""[rad/s] of the fastest mode, which a loop controls whose effort acts 8 ms late."""
LEAST_INERTIA = 1e-9
"""Share of M_jj, and [kg·m²] or [kg], added to M_jj, which can be 0 without rotors."""
NEARBY = 0.01
"""[rad] or [m] from the position of the gains in use, within which they are not computed again."""


class JointImpedance(ControlLaw):
    """The law τ = M q̈_ref + C q̇ + g + friction + K e + D ė."""

    def __init__(self, feedback: ErrorFeedback, options: ControllerOptions) -> None:
        """Raise InvalidInputError if the options contain no impedance."""
        if options.impedance is None:
            raise InvalidInputError(
                'impedance is not given, expected that of make_impedance for joint_impedance')
        self._stiffness, self._damping_ratio, self._damping = options.impedance
        if self._damping is not None:  # between LEAST_RATIO and 1 at the largest frequency
            self._damping_ratio = np.ones_like(self._stiffness)
        n = len(self._stiffness)
        self._friction = FrictionCompensation(options.friction_compensation, n)
        self._reference = feedback.scaled(0.0)
        """Returns the reference and the errors, without an effort of their own."""
        self._effort_rate = np.full(n, np.inf)
        self._gains_at: tuple[UncheckedArmDynamics, FloatArray] | None = None
        """The dynamics and the position (n,) of the gains in use."""
        self._K = self._D = np.zeros((n, n))

    def limit_rate(self, effort_rate: FloatArray, inertia: FloatArray) -> None:
        """Limit the change of the feedback to a fraction of the rate limit of the effort."""
        self._effort_rate = effort_rate

    def scale_compensation(self, stiffness: FloatArray, share: FloatArray) -> None:
        """Scale the compensation of dry friction."""
        self._friction.scale(stiffness, share)

    def scale_gains(self, scale: FloatArray) -> None:
        """Scale the largest frequency."""
        super().scale_gains(scale)
        self._gains_at = None

    def closed_loop(self, M: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the closed loop at the largest frequency, which no mode exceeds in any pose."""
        c = LARGEST_FREQUENCY
        return c * c * np.eye(len(M)), np.diag(2.0 * c * self._damping_ratio)

    def stiffness(self, M: FloatArray) -> FloatArray:
        """Return the diagonal of K."""
        return np.diagonal(self._gains(M)[0])

    def _gains(self, M: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return K and D (n, n) at M(q), NaN far outside of the range of the model."""
        try:
            L = np.linalg.cholesky(M + np.diag(LEAST_INERTIA * np.diagonal(M) + LEAST_INERTIA))
        except np.linalg.LinAlgError:  # M is not positive definite, because of its rounding
            return np.full_like(M, np.nan), np.full_like(M, np.nan)
        to_modes = np.linalg.inv(L)
        squares, V = np.linalg.eigh((to_modes * self._stiffness) @ to_modes.T)
        omega = np.sqrt(np.maximum(squares, 0.0))
        largest = LARGEST_FREQUENCY * float(np.min(self.scale, initial=1.0))
        if omega[-1] <= largest:
            K = np.diag(self._stiffness)
        else:
            omega = np.minimum(omega, largest)
            K = (L @ V * omega**2) @ (L @ V).T
        if self._damping is None:
            zeta = np.sqrt(self._damping_ratio)
            return K, 2.0 * zeta[:, np.newaxis] * ((L @ V * omega) @ (L @ V).T) * zeta
        least, most = np.diag(2.0 * LEAST_RATIO * omega), 2.0 * largest * np.eye(len(M))
        given = (V.T @ to_modes * self._damping) @ (V.T @ to_modes).T
        D = most - _positive_part(most - (least + _positive_part(given - least)))
        return K, L @ V @ D @ (L @ V).T

    def _update_gains(self, dynamics: UncheckedArmDynamics, q: FloatArray) -> None:
        """Use the gains at q (n,), unless those in use are from nearby."""
        at = self._gains_at
        if at is None or at[0] is not dynamics or not (
                math.dist(at[1].tolist(), q.tolist()) <= NEARBY):
            self._K, self._D = self._gains(dynamics.rigid_body.mass_matrix(q))
            self._gains_at = dynamics, q

    def __call__(self, state: LawInput) -> LawOutput:
        """Return the effort of spring and damper, and that of the arm along the reference."""
        dynamics, q, v, trajectory = state.dynamics, state.q_ahead, state.v, state.trajectory
        if trajectory is None or v is None:
            raise ValueError('joint impedance needs a reference and a velocity')
        a_ref, v_ref, e, exceeds_limit, _ = self._reference.track(
            trajectory, state.stamp_ns, state.q, v)
        e_dot, s = v_ref - v, 1.0
        self._update_gains(dynamics, q)
        K, D = self._K, self._D
        spring, damper = K @ e, D @ e_dot
        change = (1.0 + 4.0 * self._damping_ratio**2) * (K @ e_dot)  # K ė + D M⁻¹ D ė
        if not (np.abs(change) <= CHANGE_FRACTION * self._effort_rate).all():
            share, s = feedback_shares(spring, damper, change, self._effort_rate, e * e_dot)
            spring, damper = share * spring, s * damper
        feedback = spring + damper
        effort = dynamics.rigid_body.inverse_dynamics(q, v, a_ref) + feedback
        friction = self._friction.none
        if not dynamics.is_frictionless:
            damping = np.diagonal(D)
            rate = np.divide(
                np.diagonal(K), damping, out=np.zeros_like(e), where=damping > 0.0)
            friction = self._friction.effort(dynamics, v_ref, e, v, rate, effort)
            effort = effort + friction
        return LawOutput(
            effort, partial(self._terms, state, a_ref, feedback, friction), friction,
            exceeds_limit, scale=s)

    def _terms(
        self, state: LawInput, a_ref: FloatArray, feedback: FloatArray, friction: FloatArray,
    ) -> EffortTerms:
        q, v, body = state.q_ahead, state.v, state.dynamics.rigid_body
        assert v is not None
        a = a_ref + np.linalg.solve(body.mass_matrix(q), feedback)
        return equation_terms(state.dynamics, q, v, a, friction, body.gravity(q))


def _positive_part(A: FloatArray) -> FloatArray:
    """Return a symmetric matrix (n, n) with its negative eigenvalues replaced by 0."""
    values, vectors = np.linalg.eigh(A)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)
