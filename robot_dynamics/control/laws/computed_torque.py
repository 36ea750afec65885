# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Laws along a reference, and the one of them that is used by default: computed torque.

A law along a reference has the effort of the equation of motion, feedback and friction.
Computed torque is τ = M(q)(q̈_ref + K_d ė + K_p e) + C(q, q̇) q̇ + g(q) + friction, as in
`error_feedback`. If the effort acts late, the gains are scaled down, and M, C and g are computed
at the position half a period ahead (`gain_scaling`).

Friction is best compensated not at the measured velocity but at that of the reference, and at rest
in the direction of the error (`JointFriction.tracking_effort`). Compensation at the measured
velocity, fed back with any delay, accelerates a light joint in its direction of motion, and is
zero for a joint that sticks. Compensation at the velocity of the reference starts a sticking joint
if its reference moves, and the uncompensated part of the friction damps the error.

Feedback of a fast error computes a large effort, and soon after one of opposite sign. If the rate
limit τ̇ of the effort delays it, it excites an oscillation instead of damping it. Let p and d be
the efforts of the errors of position and velocity. The feedback s² p + s d has the same damping
ratio. With ë ≈ −s M⁻¹ D ė its effort changes by s² times the rate of s = 1. The largest factor s
for which this is at most 0.3 τ̇ is used, or the larger one for which s (p + d) is at most τ̇ 60 ms,
an effort that the rate limit reverses in 120 ms. The effort p of the position error alone is in
any case lowered to no less than this: it holds a load that falls. While a joint returns to its
reference, p is lowered by a further s, so that the rate limit can brake the joint there. A steady
error, such as that under an unknown load, has s = 1.
"""

import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.control_law import ControlLaw, LawInput, LawOutput
from robot_dynamics.control.laws.error_feedback import ErrorFeedback, Tracking
from robot_dynamics.control.options import ControllerOptions

FRICTION_MODES = ('reference', 'measured', 'none')
"""The velocity at which friction is compensated."""
CHANGE_FRACTION = 0.3
"""Fraction of the rate limit of the effort that the feedback may take. Without it 2 of 3 hits of a
stretched UR5 end in `overspeed` (docs/evidence/control_path.md)."""
REVERSAL_TIME = 0.12
"""[s] in which the rate limit reverses an effort of the feedback that is not limited."""


class FollowingLaw(ControlLaw):
    """The law τ = M(q) a + C q̇ + g + τ_f + u; a subclass defines `correct`."""

    def __init__(self, feedback: ErrorFeedback, options: ControllerOptions) -> None:
        self.feedback, self._friction_mode = feedback, options.friction_compensation
        self._none = np.zeros(len(feedback.gains.kp))
        self._none.setflags(write=False)
        self.effort_rate: FloatArray = self._none + np.inf
        self.ratio: FloatArray = self._none
        """Stiffness by damping (n,) [1/s]."""

    def limit_rate(self, effort_rate: FloatArray, inertia: FloatArray) -> None:
        """Limit the change of the feedback to a fraction of the rate limit of the effort."""
        self.effort_rate = effort_rate

    def correct(
        self, state: LawInput, tracking: Tracking,
    ) -> tuple[FloatArray, FloatArray | None, float]:
        """
        Return a (n,) [rad/s²] or [m/s²], u (n,) [N·m] or [N] or None, and the factor s.

        s is that by which large errors have scaled the feedback down.
        """
        raise NotImplementedError

    def __call__(self, state: LawInput) -> LawOutput:
        """Return the effort that follows the reference; raise ValueError without one."""
        dynamics, trajectory, friction = state.dynamics, state.trajectory, self._none
        if trajectory is None:
            raise ValueError('a law that follows needs a reference')
        tracking = self.feedback.track(trajectory, state.stamp_ns, state.q, state.v)
        a, u, scale = self.correct(state, tracking)
        effort = dynamics.rigid_body.inverse_dynamics(state.q_ahead, state.v, a)
        if u is not None:
            effort = effort + u
        if not dynamics.is_frictionless and self._friction_mode != 'none':
            if self._friction_mode == 'measured':
                friction = dynamics.friction.effort(state.v, effort)
            else:  # a stop from a measured velocity is not helped along: friction brakes the arm
                v = self._none if trajectory.is_from_measurement else tracking.velocity
                friction = dynamics.friction.tracking_effort(
                    v, tracking.error, self.ratio, effort)
            effort = effort + friction
        return LawOutput(effort, friction, tracking, scale=scale)

    def shares(
        self, position: FloatArray, velocity: FloatArray, change: FloatArray, returns: FloatArray,
    ) -> tuple[FloatArray, float]:
        """
        Return the shares (n,) of the effort `position`, and the factor s of the effort `velocity`.

        Both efforts are (n,) [N·m] or [N]; `change` (n,) is the rate of their sum. A joint whose
        `returns` (n,) is not positive returns to its reference.
        """
        rate, reversible = self.effort_rate, 0.5 * REVERSAL_TIME * self.effort_rate
        with np.errstate(divide='ignore', over='ignore', invalid='ignore'):
            of_change, of_size, of_position = (
                float(np.min(most / np.abs(effort), initial=1.0)) for most, effort in (
                    (CHANGE_FRACTION * rate, change), (reversible, position + velocity),
                    (reversible, position)))
        s = max(math.sqrt(of_change), of_size)
        return max(s * s, of_position) * np.where(returns > 0.0, 1.0, s), s


class ComputedTorque(FollowingLaw):
    """Computed torque with one feedback law, whose gains may be scaled at any time."""

    def __init__(self, feedback: ErrorFeedback, options: ControllerOptions) -> None:
        super().__init__(feedback, options)
        self._full_feedback, self.ratio = feedback, feedback.gains.ratio
        self._free = np.inf
        """ė up to which s is 1 in any pose."""

    def limit_rate(self, effort_rate: FloatArray, inertia: FloatArray) -> None:
        """Limit the change of the feedback to a fraction of the rate limit of the effort."""
        super().limit_rate(effort_rate, inertia)
        change = self._full_feedback.gains.change.max(initial=0.0) * inertia
        self._free = CHANGE_FRACTION * float(
            (effort_rate / np.maximum(change, 1e-12)).min(initial=np.inf))

    def closed_loop(self, M: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the gains, which are accelerations per error in any pose."""
        gains = self._full_feedback.gains
        return np.diag(gains.kp), np.diag(gains.kd)

    def scale_gains(self, scale: FloatArray) -> None:
        """Use the gains at these factors (n,) of their bandwidth, in (0, 1]."""
        super().scale_gains(scale)
        self.feedback = self._full_feedback.scaled(scale) if (scale < 1.0).any() else (
            self._full_feedback)
        self.ratio = self.feedback.gains.ratio

    def correct(
        self, state: LawInput, tracking: Tracking,
    ) -> tuple[FloatArray, FloatArray | None, float]:
        """Return the acceleration with its feedback, limited for large errors."""
        if tracking.largest <= self._free:
            return tracking.acceleration, None, 1.0
        gains, e_dot = self.feedback.gains, tracking.velocity - state.v
        M = state.dynamics.rigid_body.mass_matrix(state.q)
        proportional, damping = gains.kp * tracking.error, gains.kd * e_dot
        share, s = self.shares(
            M @ proportional, M @ damping, M @ (gains.change * e_dot), proportional * damping)
        a = tracking.acceleration - (1.0 - share) * proportional - (1.0 - s) * damping
        return a, None, s
