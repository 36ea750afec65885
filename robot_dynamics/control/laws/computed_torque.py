# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Computed torque control: the law that follows references.

τ = M(q)(q̈_ref + K_d ė + K_p e) + C(q, q̇) q̇ + g(q) + friction, as in `error_feedback`. If the
effort acts late, the gains are scaled down, and M, C and g are computed at the position half a
period ahead (`gain_scaling`).

PD feedback of a fast error computes a large effort, and soon after an effort of opposite sign. If
the rate limit τ̇ of the effort delays it, the effort excites an oscillation instead of damping it.
The feedback s² K_p e + s K_d ė has the same damping ratio. With ë ≈ −s K_d ė its effort changes by
s² M (K_p + K_d²) ė per second. The largest factor s for which this is at most 0.3 τ̇ is used,
or the larger one for which s M (K_p e + K_d ė) is at most τ̇ 60 ms, an effort that the rate limit
reverses in 120 ms. The effort of the position error alone, M K_p e, is in any case lowered to no
less than this: it holds a load that falls. While a joint returns to its reference, the effort of
its position error is lowered by a further s, so that the rate limit can brake the joint there. A
steady error, such as that under an unknown load, has s = 1.
"""

from functools import partial
import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.control_law import ControlLaw, equation_terms, LawInput, LawOutput
from robot_dynamics.control.laws.error_feedback import ErrorFeedback
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.model.arm_dynamics import EffortTerms

CHANGE_FRACTION = 0.3
"""Fraction of the rate limit of the effort that the feedback may take."""
REVERSAL_TIME = 0.12
"""[s] in which the rate limit reverses an effort of the feedback that is not limited."""
FRICTION_MODES = ('reference', 'measured', 'none')
"""The velocity at which friction is compensated; see `error_feedback`."""


class ComputedTorque(ControlLaw):
    """Computed torque with one feedback law, whose gains may be scaled at any time."""

    def __init__(self, feedback: ErrorFeedback, options: ControllerOptions) -> None:
        self._full_feedback = self.feedback = feedback
        self._friction_mode = options.friction_compensation
        self._zero = np.zeros(len(feedback.gains.kp))
        self._zero.setflags(write=False)
        self._stiffness: FloatArray | float = 1.0
        self._share: FloatArray | float = 1.0
        self._effort_rate = np.full(len(self._zero), np.inf)
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

    def scale_gains(self, scale: FloatArray) -> None:
        """Use the gains at these factors (n,) of their bandwidth, in (0, 1]."""
        self.feedback = self._full_feedback.scaled(scale) if (scale < 1.0).any() else (
            self._full_feedback)

    def scale_compensation(self, stiffness: FloatArray, share: FloatArray) -> None:
        """Scale the compensation of dry friction; see `JointFriction.tracking_effort`."""
        self._stiffness, self._share = stiffness, share

    def __call__(self, state: LawInput) -> LawOutput:
        """Return the effort that follows the reference."""
        dynamics, q_ahead, v, trajectory = state.dynamics, state.q_ahead, state.v, state.trajectory
        if trajectory is None or v is None:
            raise ValueError('computed torque needs a reference and a velocity')
        a, v_ref, e, exceeds_limit, change = self.feedback.track(
            trajectory, state.stamp_ns, state.q, v)
        scale = 1.0
        if change > self._free_change:
            a, scale = self._limited(state)
        friction, effort = self._zero, dynamics.rigid_body.inverse_dynamics(q_ahead, v, a)
        if not dynamics.is_frictionless:
            friction = self._friction(state, v_ref, e, v, effort)
            effort = effort + friction
        return LawOutput(
            effort, partial(self._terms, state, a, friction), friction, exceeds_limit,
            scale=scale)

    def _limited(self, state: LawInput) -> tuple[FloatArray, float]:
        """Return the commanded acceleration with limited feedback, and the factor s."""
        gains, e_dot = self.feedback.gains, state.velocity_error
        M, rate = state.dynamics.rigid_body.mass_matrix(state.q), self._effort_rate
        proportional, damping = gains.kp * state.position_error, gains.kd * e_dot
        reversible = 0.5 * REVERSAL_TIME * rate
        with np.errstate(divide='ignore', over='ignore', invalid='ignore'):
            of_change, of_size, of_position = (
                float(np.min(most / np.abs(M @ effort), initial=1.0)) for most, effort in (
                    (CHANGE_FRACTION * rate, gains.change * e_dot),
                    (reversible, proportional + damping), (reversible, proportional)))
        s = max(math.sqrt(of_change), of_size)
        share = max(s * s, of_position) * np.where(proportional * damping > 0.0, 1.0, s)
        return state.reference.acceleration + share * proportional + s * damping, s

    def _terms(self, state: LawInput, a: FloatArray, friction: FloatArray) -> EffortTerms:
        q, v = state.q_ahead, state.v if state.v is not None else self._zero
        gravity = state.gravity if q is state.q else state.dynamics.rigid_body.gravity(q)
        return equation_terms(state.dynamics, q, v, a, friction, gravity)

    def _friction(
        self, state: LawInput, v_ref: FloatArray, e: FloatArray, v: FloatArray, load: FloatArray,
    ) -> FloatArray:
        dynamics, rate = state.dynamics, self.feedback.gains.ratio
        if self._friction_mode == 'reference':
            return dynamics.friction.tracking_effort(
                v_ref, e, rate, load, self._stiffness, self._share)
        return dynamics.friction_effort(v, load) if self._friction_mode == 'measured' else (
            self._zero)
