# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Computed torque control: the law that follows references.

τ = M(q)(q̈_ref + K_d ė + K_p e) + C(q, q̇) q̇ + g(q) + friction, as in `control_law`, with two
changes if the effort acts late: the gains are scaled down for large errors (`gain_softening`), and
M, C and g are computed at the position half a period ahead (`stable_gains`).
"""

from functools import partial
import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_law import ErrorFeedback
from robot_dynamics.control.gain_softening import crossover_frequency, gain_scale
from robot_dynamics.control.laws import ControlLaw, equation_terms, LawInput, LawOutput
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.control.segment_tracking import FEW, TrackingLaw, TrackingOutput
from robot_dynamics.model.arm_dynamics import EffortTerms, UncheckedArmDynamics
from robot_dynamics.trajectories.follower import ActiveTrajectory
from robot_dynamics.trajectories.interpolation import Reference

FRICTION_MODES = ('reference', 'measured', 'none')
"""The velocity at which friction is compensated; see `control_law`."""


class ComputedTorque(ControlLaw):
    """Computed torque with one feedback law, whose gains may be scaled at any time."""

    follows = True

    def __init__(self, feedback: ErrorFeedback, options: ControllerOptions) -> None:
        self._full_feedback = self.feedback = feedback
        self._friction_mode = options.friction_compensation
        self._segment: TrackingLaw | None = None
        self._zero = np.zeros(len(feedback.gains.kp))
        self._zero.setflags(write=False)
        self._prompt_effort = np.full(len(self._zero), math.inf)
        self._prompt_feedback = math.inf

    @np.errstate(over='ignore')  # gains near 0: no rate is too low
    def limit_rate(self, effort_rate: FloatArray, inertia: FloatArray) -> None:
        """Scale the gains down from now on for errors whose effort the rate limit would delay."""
        omega = crossover_frequency(self._full_feedback.gains)
        self._prompt_effort = effort_rate / omega if omega > 0.0 else (
            np.full_like(effort_rate, math.inf))
        self._prompt_feedback = float(
            (self._prompt_effort / np.maximum(inertia, 1e-12)).min(initial=math.inf))

    def scale_gains(self, scale: float) -> None:
        """Use the gains at this factor of their bandwidth, in (0, 1]."""
        self.feedback = self._full_feedback.scaled(scale) if scale < 1.0 else self._full_feedback

    def __call__(self, state: LawInput) -> LawOutput:
        """Return the effort that follows the reference."""
        dynamics, stamp_ns, q, v, q_ahead, gravity, reference = state
        if reference is None or v is None:
            raise ValueError('computed torque needs a reference and a velocity')
        friction, scale = self._zero, 1.0
        a, v_r, feedback, is_far = self._track(reference, stamp_ns, q, v)
        nominal = effort = dynamics.rigid_body.inverse_dynamics(q_ahead, v, a)
        if not dynamics.is_frictionless:
            friction = self._friction(dynamics, v_r, v, effort)
            nominal = effort = effort + friction
        if feedback > self._prompt_feedback:
            a_soft, scale = self._softened(dynamics, reference.sample(stamp_ns), q, v, a)
            if scale < 1.0:
                a = a_soft
                effort = dynamics.rigid_body.inverse_dynamics(q_ahead, v, a) + friction
        terms = partial(self._terms, dynamics, q, v, q_ahead, a, friction, gravity)
        return LawOutput(effort, terms, friction, nominal, scale, is_far)

    def _terms(
        self, dynamics: UncheckedArmDynamics, q: FloatArray, v: FloatArray, q_ahead: FloatArray,
        a: FloatArray, friction: FloatArray, gravity: FloatArray,
    ) -> EffortTerms:
        if q_ahead is not q:
            gravity = dynamics.rigid_body.gravity(q_ahead)
        return equation_terms(dynamics, q_ahead, v, a, friction, gravity)

    def _track(
        self, reference: ActiveTrajectory, now_ns: int, q: FloatArray, v: FloatArray,
    ) -> TrackingOutput:
        """Return q̈_ref + K_d ė + K_p e and v_r; computed joint by joint if that is quicker."""
        segment, feedback = reference.segment(now_ns), self.feedback
        if segment is None or len(q) > FEW:
            sample = reference.sample(now_ns)
            a = feedback.acceleration(sample, q, v)
            return TrackingOutput(
                a, feedback.reference_velocity(sample, q),
                float(np.abs(a - sample.acceleration).max(initial=0.0)),
                feedback.is_far(sample.position, q))
        law = self._segment
        if law is None or law.segment is not segment or law.feedback is not feedback:
            law = self._segment = TrackingLaw(segment, feedback)
        return law.at(now_ns, q, v)

    def _softened(
        self, dynamics: UncheckedArmDynamics, reference: Reference, q: FloatArray, v: FloatArray,
        a: FloatArray,
    ) -> tuple[FloatArray, float]:
        """Return the acceleration with gains that the effort can follow, and their scale s."""
        gains = self.feedback.gains
        proportional = gains.kp * self.feedback.position_error(reference.position, q)
        damping = gains.kd * (reference.velocity - v)
        M = dynamics.rigid_body.mass_matrix(q)
        s = gain_scale(M @ proportional, M @ damping, self._prompt_effort)
        return a - (1.0 - s * s) * proportional - (1.0 - s) * damping, s

    def _friction(
        self, dynamics: UncheckedArmDynamics, v_r: FloatArray, v: FloatArray, load: FloatArray,
    ) -> FloatArray:
        if self._friction_mode == 'reference':
            return dynamics.friction_effort(v_r, load, smooth=True)
        return dynamics.friction_effort(v, load) if self._friction_mode == 'measured' else (
            self._zero)
