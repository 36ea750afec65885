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

τ = M(q)(q̈_ref + K_d ė + K_p e) + C(q, q̇) q̇ + g(q) + friction, as in `control_law`. If the effort
acts late, the gains are scaled down, and M, C and g are computed at the position half a period
ahead (`stable_gains`).
"""

from functools import partial

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_law import ErrorFeedback
from robot_dynamics.control.laws import ControlLaw, equation_terms, LawInput, LawOutput
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.model.arm_dynamics import EffortTerms, UncheckedArmDynamics

FRICTION_MODES = ('reference', 'measured', 'none')
"""The velocity at which friction is compensated; see `control_law`."""


class ComputedTorque(ControlLaw):
    """Computed torque with one feedback law, whose gains may be scaled at any time."""

    def __init__(self, feedback: ErrorFeedback, options: ControllerOptions) -> None:
        self._full_feedback = self.feedback = feedback
        self._friction_mode = options.friction_compensation
        self._zero = np.zeros(len(feedback.gains.kp))
        self._zero.setflags(write=False)

    def closed_loop(self, M: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the gains, which are accelerations per error in any pose."""
        gains = self._full_feedback.gains
        return np.diag(gains.kp), np.diag(gains.kd)

    def scale_gains(self, scale: FloatArray) -> None:
        """Use the gains at these factors (n,) of their bandwidth, in (0, 1]."""
        self.feedback = self._full_feedback.scaled(scale) if (scale < 1.0).any() else (
            self._full_feedback)

    def __call__(self, state: LawInput) -> LawOutput:
        """Return the effort that follows the reference."""
        dynamics, q_ahead, v, trajectory = state.dynamics, state.q_ahead, state.v, state.trajectory
        if trajectory is None or v is None:
            raise ValueError('computed torque needs a reference and a velocity')
        a, v_r, is_far = self.feedback.track(trajectory, state.stamp_ns, state.q, v)
        friction, effort = self._zero, dynamics.rigid_body.inverse_dynamics(q_ahead, v, a)
        if not dynamics.is_frictionless:
            friction = self._friction(dynamics, v_r, v, effort)
            effort = effort + friction
        return LawOutput(effort, partial(self._terms, state, a, friction), friction, is_far)

    def _terms(self, state: LawInput, a: FloatArray, friction: FloatArray) -> EffortTerms:
        q, v = state.q_ahead, state.v if state.v is not None else self._zero
        gravity = state.gravity if q is state.q else state.dynamics.rigid_body.gravity(q)
        return equation_terms(state.dynamics, q, v, a, friction, gravity)

    def _friction(
        self, dynamics: UncheckedArmDynamics, v_r: FloatArray, v: FloatArray, load: FloatArray,
    ) -> FloatArray:
        if self._friction_mode == 'reference':
            return dynamics.friction_effort(v_r, load, smooth=True)
        return dynamics.friction_effort(v, load) if self._friction_mode == 'measured' else (
            self._zero)
