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
What an arm does under given efforts: forward dynamics, integrated.

Rigid bodies and viscous friction are integrated with the Runge–Kutta method of order 5 of Dormand
and Prince (E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*,
Springer 1993, table II.5.2) at a fixed step. Coulomb friction follows each step as an impulse: of
all velocities that friction of at most F_c h can lead to, the one that dissipates most, which is
at rest where F_c suffices (D. Stewart and J. Trinkle, Int. J. Numer. Meth. Eng. 39, 1996:
velocity-level time stepping).
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arm_dynamics import ArmDynamics
from robot_dynamics.arm_model import ArmModel
from robot_dynamics.payload import Payload
from robot_dynamics.rigid_body import ExternalWrench
from robot_dynamics.validation import check_scalar, check_vector, FloatArray

DEFAULT_MAX_STEP = 1e-3
"""[s]"""
_FRICTION_SWEEPS = 50

# The method of Dormand and Prince: what of the stages before makes each stage, and their sum.
_STAGES = tuple(np.array(row) for row in (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
))
_WEIGHTS = np.array((35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84))


class ArmState(NamedTuple):
    """Position (n,) [rad] or [m], and velocity (n,)."""

    position: FloatArray
    velocity: FloatArray


class ArmSimulation:
    """
    An arm in motion. It stands with its brakes on until `release`.

    All arrays are (n,) in the order of `arm.joint_names`.
    """

    def __init__(
        self, arm: ArmModel, position: Any = None, velocity: Any = None,
        max_step: float = DEFAULT_MAX_STEP,
    ) -> None:
        """
        Start at `position`, by default 0 or the limit nearest to it, and `velocity`, default 0.

        `max_step` [s] bounds the step of integration. Raises InvalidInputError.
        """
        n, names = arm.joint_count, arm.joint_names
        limits = arm.limits
        home = np.clip(np.zeros(n), limits.lower, limits.upper)
        self._initial = ArmState(
            home if position is None else check_vector('initial_position', position, n, names),
            np.zeros(n) if velocity is None else (
                check_vector('initial_velocity', velocity, n, names)))
        self._max_step = check_scalar('max_step', max_step, 0.0, exclusive_minimum=True)
        self._bare_arm = arm
        self._dynamics = ArmDynamics(arm)
        self.reset()

    @property
    def arm(self) -> ArmModel:
        return self._dynamics.arm

    def reset(self) -> None:
        """Go back to the initial state, brakes on."""
        self.q, self.v = self._initial.position.copy(), self._initial.velocity.copy()
        self.braked = True

    def release(self) -> None:
        """Open the brakes."""
        self.braked = False

    def set_payload(self, payload: Payload | None) -> None:
        """Fix this load to the arm in place of the one before; raise InvalidInputError."""
        self._dynamics = ArmDynamics(self._bare_arm.with_payloads([payload] if payload else []))

    @property
    def state(self) -> ArmState:
        return ArmState(self.q.copy(), self.v.copy())

    def energy(self) -> tuple[float, float]:
        """Return the kinetic and the potential energy [J]."""
        body = self._dynamics.rigid_body
        return body.kinetic_energy(self.q, self.v), body.potential_energy(self.q)

    def step(
        self, tau: FloatArray, duration: float, wrenches: Sequence[ExternalWrench] = (),
    ) -> ArmState:
        """Return the state after `duration` [s] under the constant effort tau."""
        if self.braked:
            return self.state
        steps = max(1, int(np.ceil(duration / self._max_step - 1e-9)))
        h = duration / steps
        for _ in range(steps):
            q, at_rest = self.q, self.v == 0.0
            self._runge_kutta(tau, h, wrenches)
            if self._dynamics.friction.coulomb.any():
                self._rub(h, q, at_rest)
        return self.state

    def _rub(self, h: float, q_before: FloatArray, at_rest: npt.NDArray[np.bool_]) -> None:
        """Let Coulomb friction act over a step; a joint that stays at rest stays where it is."""
        frictionless = self.v
        self.v = coulomb_friction_step(
            self._dynamics.rigid_body.mass_matrix(self.q), frictionless,
            h * self._dynamics.friction.coulomb)
        # what a velocity that changes evenly over the step adds to the way
        self.q = self.q + 0.5 * h * (self.v - frictionless)
        held = at_rest & (self.v == 0.0)
        self.q[held] = q_before[held]

    def _runge_kutta(
        self, tau: FloatArray, h: float, wrenches: Sequence[ExternalWrench],
    ) -> None:
        body, viscous = self._dynamics.rigid_body, self._dynamics.friction.viscous
        q, v = self.q, self.v
        velocity, acceleration = np.empty((6, len(q))), np.empty((6, len(q)))
        for i, weights in enumerate(_STAGES):
            q_i = q + h * (weights @ velocity[:i])
            v_i = v + h * (weights @ acceleration[:i])
            velocity[i] = v_i
            acceleration[i] = body.forward_dynamics(q_i, v_i, tau - viscous * v_i, wrenches)
        self.q = q + h * (_WEIGHTS @ velocity)
        self.v = v + h * (_WEIGHTS @ acceleration)


def coulomb_friction_step(M: FloatArray, v: FloatArray, impulse_limit: FloatArray) -> FloatArray:
    """
    Return the velocity (n,) after friction impulses of at most impulse_limit (n,) [N·m·s].

    They minimise the kinetic energy ½ (v + M⁻¹p)ᵀ M (v + M⁻¹p) subject to |p_i| ≤ limit_i
    (projected Gauss–Seidel on the impulses); a joint comes to rest exactly where that suffices.
    """
    W = np.linalg.inv(M)
    p, u = np.zeros_like(v), v.copy()
    for _ in range(_FRICTION_SWEEPS):
        largest = 0.0
        for i in range(len(v)):
            wanted = p[i] - u[i] / W[i, i]
            change = min(max(wanted, -impulse_limit[i]), impulse_limit[i]) - p[i]
            p[i] += change
            u += change * W[:, i]
            largest = max(largest, abs(change))
        if largest <= 1e-15 * max(float(np.max(impulse_limit)), 1e-300):
            break
    u[np.abs(p) < impulse_limit] = 0.0  # what stays below its limit holds its joint at rest
    return u
