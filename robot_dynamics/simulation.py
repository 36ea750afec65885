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
Where dry friction falls with speed (Stribeck), steps are halved until the method's own estimate of
the error is small: that part of the motion lasts milliseconds.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arm_dynamics import ArmDynamics
from robot_dynamics.arm_model import ArmModel
from robot_dynamics.damped_step import Acceleration, damped_step, damping_rate
from robot_dynamics.drive import Drive
from robot_dynamics.exceptions import InvalidInputError, ModelError
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
_STRIBECK_TOLERANCE = 1e-9
"""[rad/s] or [m/s] of error a step where friction falls with speed."""
_MAX_HALVINGS = 10

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
# What the embedded method of order 4 makes of the stages and the slope at the end, less _WEIGHTS.
_ERROR_WEIGHTS = np.array((
    5179 / 57600, 0.0, 7571 / 16695, 393 / 640, -92097 / 339200, 187 / 2100))
_ERROR_WEIGHTS = _WEIGHTS - _ERROR_WEIGHTS
_ERROR_WEIGHT_OF_END = -1 / 40


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

    def check_inertia(self) -> None:
        """Raise ModelError where a joint moves no mass: no effort accelerates it finitely."""
        inertia = np.diag(self._dynamics.rigid_body.mass_matrix(self._initial.position))
        massless = [
            name for name, value in zip(self.arm.joint_names, inertia) if value == 0.0]
        if massless:
            raise ModelError(
                f'joints {massless} of robot {self.arm.name!r} move no mass or inertia, so that '
                'it cannot be simulated, expected an <inertial> on the links that they move, or '
                'these joints left out of the parameter joints')

    @property
    def arm(self) -> ArmModel:
        return self._dynamics.arm

    def reset(self) -> None:
        """Go back to the initial state, brakes on."""
        self.q, self.v = self._initial.position.copy(), self._initial.velocity.copy()
        self.braked = True
        self.effort = np.zeros_like(self.q)
        """What the actuators delivered last, (n,) [N·m] or [N]."""
        self._drive = None if self.arm.actuators is None else Drive(self.arm.actuators)
        self._a = np.zeros_like(self.q)
        self.work = 0.0
        """Work of the efforts since the start [J]."""
        self.heat = 0.0
        """What friction turned into heat since the start [J]."""

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
        """
        Return the state after `duration` [s] under the constant effort tau.

        Raises InvalidInputError where the motion is not finite, and keeps the state before: a
        joint that moves no mass, or an effort that flings the arm away.
        """
        if self.braked:
            return self.state
        try:
            return self._step(tau, duration, wrenches)
        except np.linalg.LinAlgError as error:
            raise self._not_finite(str(error)) from None

    def _step(
        self, tau: FloatArray, duration: float, wrenches: Sequence[ExternalWrench],
    ) -> ArmState:
        steps = max(1, int(np.ceil(duration / self._max_step - 1e-9)))
        h = duration / steps
        motion, effort, a = _Motion(self._dynamics, tau, wrenches), tau, self._a
        state, heat, work = ArmState(self.q, self.v), 0.0, 0.0
        for _ in range(steps):
            before = state
            if self._drive is not None:
                effort = self._drive.effort_over_step(tau, before.velocity + 0.5 * h * a, h)
                motion = _Motion(self._dynamics, effort, wrenches)
            state, lost = motion.step(before, h)
            heat += lost
            work += float(effort @ (state.position - before.position))
            if self._drive is None and state is before:
                break  # it sticks, and nothing changes any more
            a = (state.velocity - before.velocity) / h
        if not np.isfinite(state).all():
            raise self._not_finite('the state overflows')
        self.heat, self.work = self.heat + heat, self.work + work
        self.q, self.v, self._a, self.effort = *state, a, effort
        return self.state

    def _not_finite(self, reason: str) -> InvalidInputError:
        return InvalidInputError(
            f'the motion from position {self.q.tolist()} has no finite solution ({reason}), '
            'expected every joint to move some mass or inertia, and efforts that it can bear')


class Leg(NamedTuple):
    """A piece of motion: the state at its end, and the heat of friction on the way [J]."""

    state: ArmState
    heat: float


class _Motion:
    """The motion of an arm while effort and wrenches stay the same."""

    def __init__(
        self, dynamics: ArmDynamics, tau: FloatArray, wrenches: Sequence[ExternalWrench],
    ) -> None:
        friction = dynamics.friction
        self._body, self._wrenches, self._friction = dynamics.rigid_body, wrenches, friction
        self._tau = tau - friction.offset
        self._is_damped, self._is_dry = bool(friction.viscous.any()), bool(friction.static.any())
        self._slides = Modes(np.zeros_like(tau), np.zeros(len(tau), dtype=bool))

    def step(self, state: ArmState, h: float) -> Leg:
        """Return the state after h [s]; the very same one where the arm sticks."""
        if not self._is_dry:
            return self._advance(state, h, self._slides)
        heat = 0.0
        for _ in range(_MAX_EVENTS):
            q, v = state
            modes = choose_modes(
                self._body.mass_matrix(q), v, self._effort(q, v), self._friction.dry(v),
                self._friction.static)
            if modes.stuck.all():
                return Leg(state, heat)
            leg = self._advance(state, h, modes)
            if self._margin(leg.state, modes).min() < 0.0:
                passed, leg = self._until_event(state, h, modes)
                h -= passed
            else:
                h = 0.0
            state, heat = leg.state, heat + leg.heat
            if h <= 0.0:
                return Leg(state, heat)
        leg = self._advance(state, h, modes)  # a quiver that friction damps anyway
        return Leg(leg.state, heat + leg.heat)

    def _until_event(self, state: ArmState, h: float, modes: Modes) -> tuple[float, Leg]:
        """Return the time [s] until the first joint stops or breaks away, and the way there."""
        early, late, worth_early = 0.0, h, 0.0
        leg = self._advance(state, h, modes)
        worth_late = float(self._margin(leg.state, modes).min())
        close = _EVENT_TOLERANCE * abs(worth_late)
        for _ in range(_EVENT_ITERATIONS):
            middle = 0.5 * (early + late)
            if worth_early > 0.0:  # the secant, as long as it has two sides to lean on
                middle = late - worth_late * (late - early) / (worth_late - worth_early)
            leg = self._advance(state, middle, modes)
            worth = float(self._margin(leg.state, modes).min())
            if worth > close:
                early, worth_early, worth_late = middle, worth, 0.5 * worth_late
                continue
            worth_early, late, worth_late = 0.5 * worth_early, middle, worth
            if worth > -close or late - early <= _EVENT_TOLERANCE * h:
                break
        (q, v), heat = leg
        margin = self._margin(leg.state, modes)
        stops = (modes.direction != 0.0) & ((margin <= 0.0) | (margin == margin.min()))
        return middle, Leg(ArmState(q, np.where(stops, 0.0, v)), heat)

    def _margin(self, after: ArmState, modes: Modes) -> FloatArray:
        """Return (n,), negative where a joint turned round, or slips though it was held."""
        q, v = after
        margin = np.where(modes.direction != 0.0, modes.direction * v, np.inf)
        if modes.stuck.any():
            effort = self._effort(q, v) - modes.direction * self._friction.dry(v)
            friction = hold(self._body.mass_matrix(q), effort, modes.stuck).friction
            margin = np.where(
                modes.stuck, self._friction.static * (1.0 + 1e-9) - np.abs(friction), margin)
        return margin

    def _effort(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return what is left to accelerate the arm, but for dry friction."""
        body = self._body
        effort = self._tau - body.nonlinear(q, v) - self._friction.viscous * v
        return effort - body.external(q, self._wrenches) if self._wrenches else effort

    def _acceleration(self, q: FloatArray, v: FloatArray, modes: Modes) -> FloatArray:
        dry = modes.direction * self._friction.dry(v) if self._is_dry else 0.0
        if modes.stuck.any():
            effort = self._effort(q, v) - dry
            return hold(self._body.mass_matrix(q), effort, modes.stuck).acceleration
        effort = self._tau - self._friction.viscous * v - dry
        return self._body.forward_dynamics(q, v, effort, self._wrenches)

    def _advance(self, state: ArmState, h: float, modes: Modes) -> Leg:
        """Return the state after h [s] in these modes."""
        def acceleration(q: FloatArray, v: FloatArray) -> FloatArray:
            return self._acceleration(q, v, modes)

        q, v = state
        if self._is_damped:
            M = self._body.mass_matrix(q)
            if h * damping_rate(M, self._friction.viscous) > STIFF:
                after = ArmState(*damped_step(
                    q, v, h, acceleration, M, self._friction.viscous, ~modes.stuck))
                return Leg(after, self._lost(state, after))
        halvings = _MAX_HALVINGS if self._friction.has_stribeck_effect else 0
        return self._runge_kutta(state, h, acceleration, modes, halvings)

    def _runge_kutta(
        self, state: ArmState, h: float, acceleration: Acceleration, modes: Modes, halvings: int,
    ) -> Leg:
        step = runge_kutta_step(*state, h, acceleration)
        if halvings and step.error(h, acceleration) > _STRIBECK_TOLERANCE:
            first = self._runge_kutta(state, 0.5 * h, acceleration, modes, halvings - 1)
            second = self._runge_kutta(first.state, 0.5 * h, acceleration, modes, halvings - 1)
            return Leg(second.state, first.heat + second.heat)
        if not (self._is_dry or self._is_damped):
            return Leg(step.state, 0.0)
        v = step.velocities
        friction = self._friction.viscous * v + modes.direction * self._friction.dry(v) + (
            self._friction.offset)
        return Leg(step.state, h * float(_WEIGHTS @ (friction * v).sum(axis=1)))

    def _lost(self, before: ArmState, after: ArmState) -> float:
        """Return the work less the gain in energy: what friction took, by energy balance [J]."""
        body, way = self._body, after.position - before.position
        effort = self._tau + self._friction.offset
        if self._wrenches:  # at both ends: of the order of the step that this is the balance of
            effort = effort - 0.5 * sum(
                body.external(q, self._wrenches) for q, _ in (before, after))
        return float(effort @ way) + (
            body.kinetic_energy(*before) - body.kinetic_energy(*after)) + (
            body.potential_energy(before.position) - body.potential_energy(after.position))


class RungeKuttaStep(NamedTuple):
    """The state after a step; velocities and accelerations (6, n) of its stages."""

    state: ArmState
    velocities: FloatArray
    accelerations: FloatArray

    def error(self, h: float, acceleration: Acceleration) -> float:
        """Return the estimated error of the velocity after the step of h [s]."""
        end = acceleration(*self.state)
        error = _ERROR_WEIGHTS @ self.accelerations + _ERROR_WEIGHT_OF_END * end
        return h * float(np.abs(error).max())


def runge_kutta_step(
    q: FloatArray, v: FloatArray, h: float, acceleration: Acceleration,
) -> RungeKuttaStep:
    """Return position and velocity (n,) after h [s], with an error of order h⁶."""
    velocities, accelerations = np.empty((6, len(q))), np.empty((6, len(q)))
    for i, weights in enumerate(_STAGES):
        velocities[i] = v + h * (weights @ accelerations[:i])
        accelerations[i] = acceleration(q + h * (weights @ velocities[:i]), velocities[i])
    after = ArmState(q + h * (_WEIGHTS @ velocities), v + h * (_WEIGHTS @ accelerations))
    return RungeKuttaStep(after, velocities, accelerations)
