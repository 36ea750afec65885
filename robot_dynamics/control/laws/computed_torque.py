# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Computed torque control: the law that follows references.

τ = M(q)(q̈_ref + K_d ė + K_p e) + C(q, q̇) q̇ + g(q) + friction, as in `error_feedback`. If the
effort acts late, the gains are scaled down, and M, C and g are computed at the position half a
period ahead (`gain_scaling`).
"""

from functools import partial

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.control_law import ControlLaw, equation_terms, LawInput, LawOutput
from robot_dynamics.control.laws.error_feedback import ErrorFeedback
from robot_dynamics.control.laws.friction_compensation import FrictionCompensation
from robot_dynamics.control.laws.rate_limited_feedback import CHANGE_FRACTION, feedback_shares
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.model.arm_dynamics import EffortTerms


class ComputedTorque(ControlLaw):
    """Computed torque with one feedback law, whose gains may be scaled at any time."""

    def __init__(self, feedback: ErrorFeedback, options: ControllerOptions) -> None:
        self._full_feedback = self.feedback = feedback
        n = len(feedback.gains.kp)
        self._friction = FrictionCompensation(options.friction_compensation, n)
        self._effort_rate = np.full(n, np.inf)
        self._free_change = np.inf
        """(K_p + K_d²) ė up to which s is 1 in any pose."""

    def limit_rate(self, effort_rate: FloatArray, inertia: FloatArray) -> None:
        """Limit the change of the feedback to a fraction of the rate limit of the effort."""
        self._effort_rate = effort_rate
        self._free_change = CHANGE_FRACTION * float(
            (effort_rate / np.maximum(inertia, 1e-12)).min(initial=np.inf))

    def closed_loop(self, M: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the gains, which are accelerations per error in any pose."""
        gains = self._full_feedback.gains
        return np.diag(gains.kp), np.diag(gains.kd)

    def stiffness(self, M: FloatArray) -> FloatArray:
        """Return M_jj K_p."""
        return np.diagonal(M) * self.feedback.gains.kp

    def scale_gains(self, scale: FloatArray) -> None:
        """Use the gains at these factors (n,) of their bandwidth, in (0, 1]."""
        self.feedback = self._full_feedback.scaled(scale) if (scale < 1.0).any() else (
            self._full_feedback)

    def __call__(self, state: LawInput) -> LawOutput:
        """Return the effort that follows the reference."""
        dynamics, q_ahead, v, trajectory = state.dynamics, state.q_ahead, state.v, state.trajectory
        if trajectory is None:
            raise ValueError('computed torque needs a reference')
        a, v_ref, e, exceeds_limit, change = self.feedback.track(
            trajectory, state.stamp_ns, state.q, v)
        scale = 1.0
        if change > self._free_change:
            a, scale = self._limited(state)
        friction, effort = self._friction.none, dynamics.rigid_body.inverse_dynamics(q_ahead, v, a)
        if not dynamics.is_frictionless:
            friction = self._friction.effort(
                state, v_ref, e, self.feedback.gains.ratio, effort)
            effort = effort + friction
        return LawOutput(
            effort, partial(self._terms, state, a, friction), friction, exceeds_limit,
            scale=scale)

    def _limited(self, state: LawInput) -> tuple[FloatArray, float]:
        """Return the commanded acceleration with limited feedback, and the factor s."""
        gains, e_dot = self.feedback.gains, state.velocity_error
        M, rate = state.dynamics.rigid_body.mass_matrix(state.q), self._effort_rate
        proportional, damping = gains.kp * state.position_error, gains.kd * e_dot
        share, s = feedback_shares(
            M @ proportional, M @ damping, M @ (gains.change * e_dot), rate,
            proportional * damping)
        return state.reference.acceleration + share * proportional + s * damping, s

    def _terms(self, state: LawInput, a: FloatArray, friction: FloatArray) -> EffortTerms:
        q, v = state.q_ahead, state.v
        gravity = state.gravity if q is state.q else state.dynamics.rigid_body.gravity(q)
        return equation_terms(state.dynamics, q, v, a, friction, gravity)
