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

The rigid bodies are integrated with the Runge–Kutta method of order 5 of Dormand and Prince
(E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*, Springer 1993,
table II.5.2) at a fixed step, viscous friction with them, or where it is too stiff for that with
`damped_step`. Dry friction makes joints stick or slide (`sticking`); a step ends where a joint
comes to rest or breaks away, so that the method keeps its order, and what sticks does not creep.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arm_dynamics import ArmDynamics
from robot_dynamics.arm_model import ArmModel
from robot_dynamics.damped_step import Acceleration, damped_step, damping_rate
from robot_dynamics.payload import Payload
from robot_dynamics.rigid_body import ExternalWrench
from robot_dynamics.sticking import choose_modes, hold, Modes
from robot_dynamics.validation import check_scalar, check_vector, FloatArray

DEFAULT_MAX_STEP = 1e-3
"""[s]"""
STIFF = 1.0
"""Relaxation rate × step from which viscous friction is integrated exponentially."""
_MAX_EVENTS = 40
_EVENT_ITERATIONS = 60
_EVENT_TOLERANCE = 1e-12

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
        motion = _Motion(self._dynamics, tau, wrenches)
        for _ in range(steps):
            self.q, self.v = motion.step(self.q, self.v, duration / steps)
        return self.state


class _Motion:
    """The motion of an arm while effort and wrenches stay the same."""

    def __init__(
        self, dynamics: ArmDynamics, tau: FloatArray, wrenches: Sequence[ExternalWrench],
    ) -> None:
        self._body, self._tau, self._wrenches = dynamics.rigid_body, tau, wrenches
        self._viscous, self._coulomb = dynamics.friction.viscous, dynamics.friction.coulomb
        self._is_damped, self._is_dry = bool(self._viscous.any()), bool(self._coulomb.any())
        self._slides = Modes(np.zeros_like(tau), np.zeros(len(tau), dtype=bool))

    def step(self, q: FloatArray, v: FloatArray, h: float) -> ArmState:
        """Return the state after h [s]."""
        if not self._is_dry:
            return self._advance(q, v, h, self._slides)
        for _ in range(_MAX_EVENTS):
            modes = choose_modes(
                self._body.mass_matrix(q), v, self._effort(q, v), self._coulomb)
            if modes.stuck.all():
                return ArmState(q, v)
            after = self._advance(q, v, h, modes)
            if self._margin(after, modes).min() >= 0.0:
                return after
            passed, (q, v) = self._until_event(q, v, h, modes)
            h -= passed
            if h <= 0.0:
                return ArmState(q, v)
        return self._advance(q, v, h, modes)  # a quiver that friction damps anyway

    def _until_event(
        self, q: FloatArray, v: FloatArray, h: float, modes: Modes,
    ) -> tuple[float, ArmState]:
        """Return the time [s] until the first joint stops or breaks away, and the state then."""
        early, late, worth_early = 0.0, h, 0.0
        after = self._advance(q, v, h, modes)
        worth_late = float(self._margin(after, modes).min())
        close = _EVENT_TOLERANCE * abs(worth_late)
        for _ in range(_EVENT_ITERATIONS):
            middle = 0.5 * (early + late)
            if worth_early > 0.0:  # the secant, as long as it has two sides to lean on
                middle = late - worth_late * (late - early) / (worth_late - worth_early)
            after = self._advance(q, v, middle, modes)
            worth = float(self._margin(after, modes).min())
            if worth > close:
                early, worth_early, worth_late = middle, worth, 0.5 * worth_late
                continue
            worth_early, late, worth_late = 0.5 * worth_early, middle, worth
            if worth > -close or late - early <= _EVENT_TOLERANCE * h:
                break
        margin = self._margin(after, modes)
        stops = (modes.direction != 0.0) & ((margin <= 0.0) | (margin == margin.min()))
        return middle, ArmState(after.position, np.where(stops, 0.0, after.velocity))

    def _margin(self, after: ArmState, modes: Modes) -> FloatArray:
        """Return (n,), negative where a joint turned round, or slips though it was held."""
        margin = np.where(
            modes.direction != 0.0, modes.direction * after.velocity, np.inf)
        if modes.stuck.any():
            effort = self._effort(*after) - modes.direction * self._coulomb
            friction = hold(
                self._body.mass_matrix(after.position), effort, modes.stuck).friction
            margin = np.where(
                modes.stuck, self._coulomb * (1.0 + 1e-9) - np.abs(friction), margin)
        return margin

    def _effort(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return what is left to accelerate the arm, but for dry friction."""
        body = self._body
        effort = self._tau - body.nonlinear(q, v) - self._viscous * v
        return effort - body.external(q, self._wrenches) if self._wrenches else effort

    def _acceleration(self, q: FloatArray, v: FloatArray, modes: Modes) -> FloatArray:
        if modes.stuck.any():
            effort = self._effort(q, v) - modes.direction * self._coulomb
            return hold(self._body.mass_matrix(q), effort, modes.stuck).acceleration
        effort = self._tau - self._viscous * v - modes.direction * self._coulomb
        return self._body.forward_dynamics(q, v, effort, self._wrenches)

    def _advance(self, q: FloatArray, v: FloatArray, h: float, modes: Modes) -> ArmState:
        """Return the state after h [s] in these modes."""
        def acceleration(q: FloatArray, v: FloatArray) -> FloatArray:
            return self._acceleration(q, v, modes)

        if self._is_damped:
            M = self._body.mass_matrix(q)
            if h * damping_rate(M, self._viscous) > STIFF:
                return ArmState(*damped_step(
                    q, v, h, acceleration, M, self._viscous, ~modes.stuck))
        return runge_kutta_step(q, v, h, acceleration)


def runge_kutta_step(
    q: FloatArray, v: FloatArray, h: float, acceleration: Acceleration,
) -> ArmState:
    """Return position and velocity (n,) after h [s], with an error of order h⁶."""
    velocity, accelerations = np.empty((6, len(q))), np.empty((6, len(q)))
    for i, weights in enumerate(_STAGES):
        velocity[i] = v + h * (weights @ accelerations[:i])
        accelerations[i] = acceleration(q + h * (weights @ velocity[:i]), velocity[i])
    return ArmState(q + h * (_WEIGHTS @ velocity), v + h * (_WEIGHTS @ accelerations))
