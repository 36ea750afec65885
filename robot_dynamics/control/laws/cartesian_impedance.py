# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Cartesian impedance: a spring and a damper between a frame and its reference, and a posture.

The reference pose is that of the reference of the joints, so that it has their limits. With the
error e_q (n,) of the joints and M = L Lᵀ, A = L⁻¹ Jᵀ,

    τ_spring = C (Jᵀ K J e_q + ω_n² L N Lᵀ e_q).

J e_q (6,) is the error of the frame to first order. The difference of the poses itself vanishes in
other joint positions too: near a singularity it would pull the arm there, and a rotation error
jumps at 180°.

N (n, n) projects onto the null space of J, consistently with the dynamics: the posture e_q does
not accelerate the frame. Directions that J is about to lose pass over to the posture: with
S J = U σ Vᵀ, B = L⁻¹ V and weights w = min(1, σ/σ_0)², N = I − B √w Y⁻¹ √w Bᵀ,
Y = √w BᵀB √w + m (1 − w); m is the mean of the diagonal of BᵀB.

A K Aᵀ + ω_n² N = V Ω² Vᵀ contains the double diagonalisation of Λ and K of `modal_impedance`,
because Λ⁻¹ = AᵀA, and the same for the posture. D = 2 L V min(Ω, Ω_c) Vᵀ Lᵀ with
Ω ≥ LEAST_FREQUENCY damps each direction for itself, and C = L V min(1, Ω_c²/Ω²) Vᵀ L⁻¹ slows down
the fast ones. A joint that approaches a position limit faster than its reference, and faster than
the limit is away, is braked, and so is one that is faster than its reference and than references
may be (`_braked`).
"""

from dataclasses import replace

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.control_law import LawInput, LawParameter, LawTopic
from robot_dynamics.control.laws.error_feedback import ErrorFeedback
from robot_dynamics.control.laws.modal_impedance import ModalImpedance, root_of
from robot_dynamics.control.options import ControllerOptions, LawOptions
from robot_dynamics.control.pose_reference import follow_pose, FRAME, frame_name
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.references.motion_limits import FRACTION
from robot_dynamics.task_space.frame_kinematics import FrameKinematics

LARGEST_DISTANCE, LARGEST_ANGLE = 0.1, 0.5
"""[m] of the frame, and [rad], also [rad] or [m] of all joints together: the springs do not extend
further."""
LENGTH = LARGEST_DISTANCE / LARGEST_ANGLE
"""[m] that weighs as much as 1 rad."""
SINGULAR = 0.1
"""σ_0 [rad/rad] or [rad/m]."""
LIMIT_MARGIN, LIMIT_SHARE = 0.05, 0.1
"""[rad] or [m] before a position limit, at most this share of the range, where a joint stops."""
NULL_SPACE_FREQUENCY = 10.0
"""[rad/s] of the posture, which does not move the frame: a third of Ω_c."""
LEAST_FREQUENCY = 2.0
"""[rad/s] at which directions with little stiffness are damped at least."""


class CartesianImpedance(ModalImpedance):
    """The law τ = M q̈_ref + C q̇ + g + friction + τ_spring + D ė."""

    PARAMETERS = (
        FRAME,
        LawParameter('cartesian.translation_stiffness', (500.0,), (
            'Stiffness [N/m] of cartesian_impedance; one value for all axes or one per axis of '
            'the base frame.'), entries=('x', 'y', 'z')),
        LawParameter('cartesian.rotation_stiffness', 30.0, (
            'Stiffness [N·m/rad] of cartesian_impedance.')),
        LawParameter('cartesian.force_limit', 100.0, (
            'Largest force [N] of the spring of cartesian_impedance.'), maximum=1e4),
        LawParameter('cartesian.torque_limit', 30.0, (
            'Largest torque [N·m] of the spring of cartesian_impedance.'), maximum=1e4),
    )
    REFERENCES = (LawTopic('~/pose_reference', 'geometry_msgs/msg/PoseStamped', follow_pose),)

    @classmethod
    def options(cls, arm: ArmModel, options: ControllerOptions) -> LawOptions:
        """Return the options with the frame; raise InvalidInputError also for an unknown one."""
        frame = frame_name(arm, options.parameters)
        return super().options(
            arm, replace(options, parameters={**options.parameters, FRAME.name: frame}))

    def __init__(self, feedback: ErrorFeedback, options: LawOptions) -> None:
        (frame, translation, rotation, self._force_limit,
         self._torque_limit) = options.parameters.values()
        arm, n = options.arm, options.arm.joint_count
        super().__init__(feedback, options)
        self._stiffness = np.array([*translation, rotation, rotation, rotation])
        self._frame = FrameKinematics(arm, frame)
        self._C = self._posture = np.zeros((n, n))
        self._brake = np.zeros(n)
        limits = arm.limits
        margin = np.minimum(LIMIT_MARGIN, LIMIT_SHARE * (limits.upper - limits.lower))
        self._lower, self._upper = limits.lower + margin, limits.upper - margin
        self._fastest = FRACTION * limits.velocity

    def gains(
        self, dynamics: UncheckedArmDynamics, q: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return K and D (n, n) at q (n,); raise LinAlgError far outside of the model's range."""
        L = root_of(dynamics.rigid_body.mass_matrix(q))
        inverse = np.asarray(np.linalg.inv(L), dtype=np.float64)
        J = self._frame.jacobian(q)[2]
        A = inverse @ J.T
        posture = NULL_SPACE_FREQUENCY**2 * self._null_space(J, inverse)
        squares, V = np.linalg.eigh((A * self._stiffness) @ A.T + posture)
        largest, Q = self.largest_frequency, L @ V
        natural = np.sqrt(np.maximum(squares, 0.0))
        omega = np.minimum(natural, largest)
        with np.errstate(divide='ignore'):
            self._C = (Q * np.minimum(1.0, (largest / natural)**2)) @ V.T @ inverse
        self._posture = L @ posture @ L.T
        damping = 2.0 * np.maximum(omega, min(LEAST_FREQUENCY, largest))
        damped = np.einsum('ij,ij->i', inverse.T @ (V * damping), Q)  # diagonal of M⁻¹ D
        self._brake = np.maximum(2.0 * largest - damped, 0.0) / np.einsum(
            'ij,ij->j', inverse, inverse)  # diagonal of M⁻¹
        return (Q * omega**2) @ Q.T, (Q * damping) @ Q.T

    @staticmethod
    def _null_space(J: FloatArray, inverse: FloatArray) -> FloatArray:
        """Return N (n, n); `inverse` is L⁻¹."""
        S = np.array([1.0 / LENGTH] * 3 + [1.0] * 3)
        _, sigma, Vt = np.linalg.svd(S[:, np.newaxis] * J, full_matrices=False)
        w = np.minimum(1.0, sigma / SINGULAR)**2
        B = inverse @ Vt.T
        G = B.T @ B
        B *= np.sqrt(w)
        Y = np.sqrt(np.outer(w, w)) * G + np.diag((1.0 - w) * np.diagonal(G).mean())
        return np.asarray(np.eye(len(inverse)) - B @ np.linalg.solve(Y, B.T))

    def spring(self, state: LawInput, e: FloatArray) -> FloatArray:
        """Return C (Jᵀ F + the effort of the posture) at an error e (n,) of the joints."""
        J = self._frame.jacobian(state.q)[2]
        twist, K = J @ e, self._stiffness
        F = np.concatenate([
            _at_most(self._force_limit, K[:3] * _at_most(LARGEST_DISTANCE, twist[:3])),
            _at_most(self._torque_limit, K[3:] * _at_most(LARGEST_ANGLE, twist[3:]))])
        return np.asarray(self._C @ (J.T @ F + self._posture @ _at_most(LARGEST_ANGLE, e)))

    def damper(self, state: LawInput, e: FloatArray, e_dot: FloatArray) -> FloatArray:
        """Return D ė and the brakes."""
        return super().damper(state, e, e_dot) + self._braked(state, e, e_dot)

    def _braked(self, state: LawInput, e: FloatArray, e_dot: FloatArray) -> FloatArray:
        """
        Return the effort (n,) that brakes joints before their limits of position and velocity.

        With D it is critically damped at Ω_c. It acts on these joints only, as a stop does: an
        effort at other joints would keep their springs from returning them. A reference beyond the
        margin, or faster, is no limit of its joint: the arm follows it undisturbed.
        """
        rate, v, fastest = 0.5 * self.largest_frequency, state.v, self._fastest
        above = np.maximum(
            -e_dot - rate * np.maximum(self._upper - state.q, e), np.minimum(v - fastest, -e_dot))
        below = np.maximum(
            e_dot - rate * np.maximum(state.q - self._lower, -e), np.minimum(-fastest - v, e_dot))
        return np.asarray(self._brake * (np.maximum(below, 0.0) - np.maximum(above, 0.0)))


def _at_most(length: float, vector: FloatArray) -> FloatArray:
    """Return a vector, shortened to this length."""
    norm = float(np.sqrt(vector @ vector))
    return vector if norm <= length else vector * (length / norm)
