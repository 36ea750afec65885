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
What the actuators of an arm must deliver: rigid bodies and friction together.

τ = M(q) q̈ + C(q, q̇) q̇ + g(q) + τ_friction(q̇) − Jᵀ f; τ is on the joint side of the gearbox.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from robot_dynamics.arm_model import ArmModel
from robot_dynamics.rigid_body import ExternalWrench, RigidBody, singular_mass_matrix
from robot_dynamics.sticking import choose_modes, hold
from robot_dynamics.validation import FloatArray


class EffortTerms(NamedTuple):
    """
    An effort by term, each (n,) [N·m] or [N], and the energies [J].

    effort = inertial + coriolis + gravity + friction + external.
    """

    inertial: FloatArray
    coriolis: FloatArray
    gravity: FloatArray
    friction: FloatArray
    external: FloatArray
    effort: FloatArray
    kinetic_energy: float
    potential_energy: float


class ArmDynamics:
    """Dynamics of an arm with friction; conventions as in `RigidBody`, not for two threads."""

    def __init__(self, arm: ArmModel) -> None:
        self.arm = arm
        self.rigid_body = RigidBody(arm)
        self.friction = arm.friction
        self._dry = arm.friction.static > 0.0
        self._is_dry = bool(self._dry.any())
        self._is_frictionless = self.friction.is_zero

    def inverse_dynamics(
        self, q: FloatArray, v: FloatArray, a: FloatArray,
        wrenches: Sequence[ExternalWrench] = (),
    ) -> FloatArray:
        """
        Return the effort (n,) that produces the acceleration a at the state (q, v).

        At rest any dry friction up to F_s fits; it is taken as 0.
        """
        effort = self.rigid_body.inverse_dynamics(q, v, a, wrenches)
        return effort if self._is_frictionless else effort + self.friction.effort(v)

    def inverse_dynamics_batch(
        self, q: FloatArray, v: FloatArray, a: FloatArray, threads: int = 1,
    ) -> FloatArray:
        """Return the efforts of many states; all arrays are (samples, n)."""
        effort = self.rigid_body.inverse_dynamics_batch(q, v, a, threads)
        return effort if self._is_frictionless else effort + self.friction.effort(v)

    def forward_dynamics(
        self, q: FloatArray, v: FloatArray, tau: FloatArray,
        wrenches: Sequence[ExternalWrench] = (),
    ) -> FloatArray:
        """
        Return the acceleration (n,) that the effort tau produces at the state (q, v).

        A joint with dry friction at rest, its velocity exactly 0, stays there while at most F_s
        holds it (`sticking`); beyond, it breaks away against F_s. Raises InvalidInputError where
        M(q) is singular: a joint that moves no mass.
        """
        if self._is_dry and bool((self._dry & (v == 0.0)).any()):
            return self._acceleration_from_rest(q, v, tau, wrenches)
        if not self._is_frictionless:
            tau = tau - self.friction.effort(v)
        return self.rigid_body.forward_dynamics(q, v, tau, wrenches)

    def _acceleration_from_rest(
        self, q: FloatArray, v: FloatArray, tau: FloatArray, wrenches: Sequence[ExternalWrench],
    ) -> FloatArray:
        body, friction = self.rigid_body, self.friction
        M, sliding = body.mass_matrix(q), friction.dry(v)
        effort = tau - body.nonlinear(q, v) - friction.viscous * v - friction.offset
        if wrenches:
            effort = effort - body.external(q, wrenches)
        try:
            modes = choose_modes(M, v, effort, sliding, friction.static)
            a = hold(M, effort - modes.direction * sliding, modes.stuck).acceleration
        except np.linalg.LinAlgError:
            a = np.full_like(effort, np.nan)
        if not np.isfinite(a).all():
            raise singular_mass_matrix(q)
        return a

    def terms(
        self, q: FloatArray, v: FloatArray, a: FloatArray,
        wrenches: Sequence[ExternalWrench] = (), friction: FloatArray | None = None,
    ) -> EffortTerms:
        """
        Return the effort of `inverse_dynamics` split by term, and the energies.

        `friction` (n,) takes the place of that at the velocity v, where it is given.
        """
        inertial, coriolis, gravity, external, *energies = self.rigid_body.terms(
            q, v, a, wrenches)
        if friction is None:
            friction = self.friction.effort(v)
        return EffortTerms(
            inertial, coriolis, gravity, friction, external,
            inertial + coriolis + gravity + friction + external, *energies)
