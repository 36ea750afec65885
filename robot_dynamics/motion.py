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
The motion of an arm while the efforts of its motors stay the same.

The rigid bodies are integrated with `runge_kutta`, viscous friction with them, or where it is too
stiff for that with `damped_step`. Between events the motion is smooth, so that the method keeps
its order; a step ends where a joint comes to rest or breaks away (`sticking`), and where teeth
meet or part (`backlash`). Where dry friction falls with speed (Stribeck), steps are cut into
pieces for which the method's own estimate of the error is small: that part of the motion lasts
milliseconds.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from robot_dynamics.arm_dynamics import ArmDynamics
from robot_dynamics.backlash import Backlash, TOUCH
from robot_dynamics.crossing import cubic, first_crossing, quintic
from robot_dynamics.damped_step import damped_step, damping_rate
from robot_dynamics.rigid_body import ExternalWrench, RigidBody
from robot_dynamics.runge_kutta import (
    Acceleration,
    runge_kutta_step,
    RungeKuttaStep,
    WEIGHTS,
)
from robot_dynamics.sticking import BoolArray, choose_modes, hold, Modes
from robot_dynamics.validation import FloatArray

STIFF = 1.0
"""Relaxation rate × step from which viscous friction is integrated exponentially."""
_MAX_EVENTS = 60
_BOUNCES = 40
"""Events in a step after which teeth stay together where they meet."""
_SLOW = 1e-3
"""[rad/s] or [m/s] below which they do so too: bounces without end are over in no time."""
_EVENT_ITERATIONS = 60
_EVENT_TOLERANCE = 1e-12
_NUDGE = 1e-3
"""Share of a step over which accelerations are taken as constant to reach an event exactly."""
# Kinds of events, and what counts as having reached one.
_TURN, _SLIP, _MEET, _PART = range(4)
_AT_REST = 1e-10
"""[rad/s] or [m/s]"""
_MET = 0.1 * TOUCH
_SLACK = 1e-9
"""Share of an effort."""
_STRIBECK_TOLERANCE = 1e-7
"""Error of √M q̇ [J^½] that a piece of a step may have where friction falls with speed."""
_STRIBECK_RANGE = 4.0
"""Multiple of v_s beyond which friction no longer falls: exp(−4²) is 1e-7."""
_FINEST = 2.0**-10
"""Share of a step that such a piece is at least."""


class MotionState(NamedTuple):
    """
    Position q and velocity v of the joints, θ and ω of their motors, all (n,), on the joint side.

    Without backlash the motor is where the joint is.
    """

    q: FloatArray
    v: FloatArray
    theta: FloatArray
    omega: FloatArray


class Leg(NamedTuple):
    """A piece of motion: its end, the heat on the way [J], and whether teeth met."""

    state: MotionState
    heat: float
    jolted: bool = False


class GearModes(NamedTuple):
    """
    How an arm moves between two events.

    The modes of the joints; `side` (n,) where teeth touch; `open`, motors on their own; `falls`,
    whether dry friction changes with speed.
    """

    joints: Modes
    side: FloatArray
    open: BoolArray
    falls: bool


class _End(NamedTuple):
    state: MotionState
    heat: float
    a: FloatArray
    """The joints' acceleration (n,) there."""


class Motion:
    """The motion of one arm, under the efforts and wrenches given last to `drive`."""

    def __init__(self, dynamics: ArmDynamics) -> None:
        arm, friction = dynamics.arm, dynamics.friction
        n = arm.joint_count
        self._arm, self._body, self._friction = arm, dynamics.rigid_body, friction
        self._bodies: dict[bytes, RigidBody] = {}
        self._play = Backlash.of(arm.actuators)
        self._is_damped, self._is_dry = bool(friction.viscous.any()), bool(friction.static.any())
        self._has_stribeck_effect = friction.has_stribeck_effect
        self._falls_below = np.where(
            friction.static > friction.coulomb, _STRIBECK_RANGE * friction.stribeck_velocity, 0.0)
        self._rubs = friction.static > 0.0
        self._none, self._nowhere = np.zeros(n, dtype=bool), np.zeros(n)
        self._slides = GearModes(
            Modes(self._nowhere, self._none), self._nowhere, self._none, False)
        self._slowest_damping = np.inf
        if arm.actuators is not None:  # M is at least the rotors' share: a bound of rates
            with np.errstate(divide='ignore', invalid='ignore'):
                rates = friction.viscous / arm.actuators.reflected_inertia
            self._slowest_damping = float(np.where(friction.viscous > 0.0, rates, 0.0).sum())

    def drive(self, tau: FloatArray, wrenches: Sequence[ExternalWrench] = ()) -> None:
        """Let these efforts of the motors (n,) and wrenches act from now on."""
        self._tau, self._wrenches = tau, wrenches
        self._joint_tau = tau - self._friction.offset

    def kinetic_energy(self, state: MotionState) -> float:
        """Return that of links and rotors [J]."""
        energy = self._body.kinetic_energy(state.q, state.v)
        if self._play is not None:
            share = self._play.inertia * (state.omega**2 - state.v**2)
            energy += 0.5 * float(share @ self._play.exists)
        return energy

    def step(self, state: MotionState, h: float) -> Leg:
        """Return the state after h [s]; the very same one where the arm sticks."""
        if self._has_stribeck_effect:
            self._root_inertia = np.sqrt(np.diag(self._body.mass_matrix(state.q)))
        if self._play is None and not self._is_dry:
            end = self._advance(state, h, self._slides, None)
            return Leg(end.state, end.heat)
        heat, jolted, a = 0.0, False, None
        for event in range(_MAX_EVENTS):
            if self._play is not None:
                met = self._meet(state, a, plastic=event >= _BOUNCES)
                state, heat, jolted = met.state, heat + met.heat, jolted or met.jolted
            modes, a = self._choose_modes(state)
            if modes.joints.stuck.all() and not modes.open.any():
                return Leg(state, heat, jolted)
            end = self._advance(state, h, modes, a)
            margins = self._margins(end, modes)
            if margins.min() < 0.0:
                passed, end = self._until_event(state, h, modes, a, end, margins)
                h -= passed
            else:
                h = 0.0
            state, heat, a = end.state, heat + end.heat, end.a
            if h <= 0.0:
                return Leg(state, heat, jolted)
        end = self._advance(state, h, modes, None)  # a quiver that friction damps anyway
        return Leg(end.state, heat + end.heat, jolted)

    # ------------------------------------------------------------------ modes

    def _choose_modes(self, state: MotionState) -> tuple[GearModes, FloatArray]:
        """Return how the joints move on from a state, and their acceleration (n,)."""
        if self._play is None:
            joints = self._joint_modes(state, self._none)
            modes = GearModes(
                joints, self._nowhere, self._none, self._falls(joints, state.v, state.v))
            return modes, self._joint_acceleration(modes)(state.q, state.v)
        touching = self._play.touching(state.q, state.theta)
        parted = self._play.exists & (touching == 0.0)
        opened = self._play.exists & (touching * (state.omega - state.v) < 0.0) | parted
        J, tau, tried = self._play.inertia, self._tau, 0
        while True:
            joints = self._joint_modes(state, opened)
            modes = GearModes(
                joints, np.where(opened, 0.0, touching), opened,
                self._falls(joints, state.v, state.v))
            a = self._joint_acceleration(modes)(state.q, state.v)
            push = touching * (tau - J * a)
            wrong = np.where(opened, push, -push)
            wrong[state.omega != state.v] = 0.0  # teeth that part
            worst = int(np.argmax(wrong))
            slack = 1e-12 * float(np.abs(tau).max() + np.abs(J * a).max())
            if wrong[worst] <= slack or tried > 4 * len(tau):
                return modes, a
            opened, tried = opened.copy(), tried + 1
            opened[worst] = not opened[worst]

    def _joint_modes(self, state: MotionState, opened: BoolArray) -> Modes:
        v = state.v
        if not self._is_dry:
            return self._slides.joints
        if v.all():
            return Modes(np.where(self._rubs, np.sign(v), 0.0), self._none)
        return choose_modes(
            self._body_with(opened).mass_matrix(state.q), v, self._effort(state.q, v, opened),
            self._friction.dry(v), self._friction.static)

    def _meet(self, state: MotionState, a: FloatArray | None, plastic: bool) -> Leg:
        """
        Return the state after all teeth that touch and approach have met.

        `a` (n,) is the acceleration of the joints so far, where it is known.
        """
        assert self._play is not None
        play, (q, v, theta, omega) = self._play, state
        side = play.touching(q, theta)
        closing = side * (omega - v)
        if closing.max() <= 0.0:
            return Leg(state, 0.0)
        push = self._nowhere if a is None else side * (self._tau - play.inertia * a)
        M = self._body_with(play.exists).mass_matrix(q)
        heat, meetings = 0.0, 0
        while closing.max() > 0.0:
            if plastic or closing.max() < _SLOW or meetings > _BOUNCES:
                # All at once: one after the other they would lift each other off without end.
                v, omega, lost = play.join(M, (side != 0.0) & (closing > -_SLOW), v, omega)
            else:
                v, omega, lost = play.meet(int(np.argmax(closing)), M, side, v, omega, push)
            heat, meetings = heat + lost, meetings + 1
            closing = side * (omega - v)
        theta = np.where(side != 0.0, q + side * play.half_gap, theta)
        return Leg(MotionState(q, v, theta, omega), heat, True)

    # ------------------------------------------------------------------ events

    def _until_event(
        self, state: MotionState, h: float, modes: GearModes, a: FloatArray, end: _End,
        margins: FloatArray,
    ) -> tuple[float, _End]:
        """Return the time [s] until the first event before `end`, after h [s], and the way."""
        early, late, time, before = 0.0, h, h, (0.0, 1.0)
        guess = self._first_guess(state, h, modes, a, end, margins)
        for i in range(1, _EVENT_ITERATIONS):
            # Newton's step, kept between the trials on either side.
            time = guess if i % 4 and early < guess < late else 0.5 * (early + late)
            end = self._advance(state, time, modes, a)
            margins = self._margins(end, modes)
            kind, j = divmod(int(np.argmin(margins)), len(a))
            worth = float(margins[kind, j])
            rate = self._margin_rate(kind, j, end.state, end.a, modes) or (
                (worth - before[1]) / (time - before[0]))
            guess = time - worth / rate if rate else np.nan
            near = kind in (_TURN, _MEET) and abs(guess - time) < _NUDGE * h
            if abs(worth) > 1.0 and near and early < guess < late:
                end = self._nudged(end, guess - time, modes)
                margins, time = self._margins(end, modes), guess
                worth = float(margins.min())
            if abs(worth) <= 1.0 or late - early <= _EVENT_TOLERANCE * h:
                break
            early, late = (time, late) if worth > 0.0 else (early, time)
            before = time, worth
        q, v, theta, omega = end.state
        stops = margins[_TURN] <= 1.0
        stopped = MotionState(
            q, np.where(stops, 0.0, v), theta, np.where(stops & ~modes.open, 0.0, omega))
        return time, end._replace(state=stopped)

    def _first_guess(
        self, state: MotionState, h: float, modes: GearModes, a: FloatArray, end: _End,
        margins: FloatArray,
    ) -> float:
        """Return when [s] the first event happens, by what is known at both ends."""
        after, times = end.state, [h]
        for kind, j in np.argwhere(margins < 0.0):
            if kind == _TURN:
                way = modes.joints.direction[j]
                times.append(first_crossing(cubic(
                    h, (way * state.v[j], way * a[j]),
                    (way * after.v[j], way * end.a[j])), h))
            elif kind == _MEET:
                side = np.sign(after.theta[j] - after.q[j])
                times.append(first_crossing(quintic(
                    h, self._distance(j, side, state, a), self._distance(j, side, after, end.a)),
                    h))
            else:
                at_first = float(self._margins(_End(state, 0.0, a), modes)[kind, j])
                times.append(h * max(at_first, 0.0) / (at_first - margins[kind, j]))
        return min(times)

    def _distance(
        self, j: int, side: float, state: MotionState, a: FloatArray,
    ) -> tuple[float, float, float]:
        """Return how far the teeth of joint j are on that side, and its two derivatives."""
        assert self._play is not None
        q, v, theta, omega = (float(x[j]) for x in state)
        spin_up = float(self._tau[j] / self._play.inertia[j])
        return (float(self._play.half_gap[j]) - side * (theta - q), -side * (omega - v),
                -side * (spin_up - float(a[j])))

    def _margin_rate(
        self, kind: int, j: int, state: MotionState, a: FloatArray, modes: GearModes,
    ) -> float | None:
        """Return how fast a margin changes [1/s], or None where that is not at hand."""
        if kind == _TURN:
            return float(modes.joints.direction[j] * a[j] / _AT_REST)
        if kind == _MEET:
            side = np.sign(state.theta[j] - state.q[j])
            return self._distance(j, side, state, a)[1] / _MET
        return None

    def _nudged(self, end: _End, dt: float, modes: GearModes) -> _End:
        """Return what follows so little later or earlier that accelerations stay the same."""
        q, v, theta, omega = end.state
        spin_up = end.a
        if self._play is not None:
            spin_up = np.where(modes.open, self._tau / self._play.inertia, end.a)
        state = MotionState(
            q + v * dt + 0.5 * dt * dt * end.a, v + end.a * dt,
            theta + omega * dt + 0.5 * dt * dt * spin_up, omega + spin_up * dt)
        return _End(state, end.heat + dt * float(self._rubbing(v, modes) @ v), end.a)

    def _margins(self, end: _End, modes: GearModes) -> FloatArray:
        """
        Return how far (4, n) each kind of event is, ∞ where it cannot be, negative where it was.

        The unit is what counts as reached: an event is between -1 and 1.
        """
        q, v, theta, _ = end.state
        direction, stuck = modes.joints
        margins = np.full((4, len(v)), np.inf)
        if self._is_dry:
            np.divide(direction * v, _AT_REST, out=margins[_TURN], where=direction != 0.0)
        if stuck.any():
            effort = self._effort(q, v, modes.open) - direction * self._friction.dry(v)
            M = self._body_with(modes.open).mass_matrix(q)
            friction = hold(M, effort, stuck).friction
            slack = _SLACK * self._friction.static[stuck]
            margins[_SLIP, stuck] = (
                self._friction.static[stuck] - np.abs(friction[stuck])) / slack + 2.0
        if self._play is not None:
            play, touches = self._play, modes.side != 0.0
            margins[_MEET, modes.open] = play.room(q, theta)[modes.open] / _MET
            push = modes.side * (self._tau - play.inertia * end.a)
            margins[_PART, touches] = (push / (_SLACK * (np.abs(self._tau) + 1e-3)))[touches] + 2.0
        return margins

    # ------------------------------------------------------------------ forces

    def _body_with(self, opened: BoolArray) -> RigidBody:
        """Return the rigid bodies without the rotors of motors on their own."""
        if self._play is None or not opened.any():
            return self._body
        key = opened.tobytes()
        if key not in self._bodies:
            self._bodies[key] = RigidBody(self._arm.with_rotors_apart(opened))
        return self._bodies[key]

    def _effort(self, q: FloatArray, v: FloatArray, opened: BoolArray) -> FloatArray:
        """Return what is left to accelerate the joints, but for dry friction."""
        body = self._body
        effort = self._joint_tau - body.nonlinear(q, v) - self._friction.viscous * v
        if opened.any():
            effort = effort - self._tau * opened
        return effort - body.external(q, self._wrenches) if self._wrenches else effort

    def _against_friction(self, modes: GearModes) -> Callable[[FloatArray], FloatArray]:
        """Return what sliding friction leaves of the efforts at the joints, (..., n), by v."""
        friction, direction = self._friction, modes.joints.direction
        tau = self._joint_tau
        if self._play is not None:
            tau = np.where(modes.open, -friction.offset, tau)
        if not (self._is_dry or self._is_damped):
            return lambda v: tau
        F_v, base = friction.viscous, tau - direction * friction.coulomb
        if not modes.falls:
            return lambda v: base - F_v * v
        rise, rate = direction * (friction.static - friction.coulomb), (
            1.0 / friction.stribeck_velocity)

        def remaining(v: FloatArray) -> FloatArray:
            ratio = v * rate
            return np.asarray(base - F_v * v - rise * np.exp(-ratio * ratio))

        return remaining

    def _rubbing(self, v: FloatArray, modes: GearModes) -> FloatArray:
        """Return sliding friction (..., n) at the velocities v."""
        return np.where(modes.open, 0.0, self._tau) - self._against_friction(modes)(v)

    def _joint_acceleration(self, modes: GearModes) -> Acceleration:
        """Return the joints' acceleration (n,) in these modes, by q and v."""
        body, wrenches, stuck = self._body_with(modes.open), self._wrenches, modes.joints.stuck
        remaining = self._against_friction(modes)
        if not stuck.any():
            return lambda q, v: body.acceleration(q, v, remaining(v), wrenches)

        def acceleration(q: FloatArray, v: FloatArray) -> FloatArray:
            effort = remaining(v) - body.nonlinear(q, v)
            if wrenches:
                effort = effort - body.external(q, wrenches)
            return hold(body.mass_matrix(q), effort, stuck).acceleration

        return acceleration

    # ------------------------------------------------------------------ integration

    def _is_stiff(self, q: FloatArray, h: float, opened: BoolArray) -> bool:
        if not self._is_damped:
            return False
        if self._slowest_damping * h <= STIFF and not opened.any():
            return False
        M = self._body_with(opened).mass_matrix(q)
        return damping_rate(M, self._friction.viscous) * h > STIFF

    def _advance(
        self, state: MotionState, h: float, modes: GearModes, a: FloatArray | None,
    ) -> _End:
        """Return the state after h [s] in these modes; `a` (n,) is the acceleration at first."""
        n, alone = len(state.q), np.flatnonzero(modes.open)
        acceleration = self._joint_acceleration(modes)
        q, v = state.q, state.v
        if len(alone):  # motors on their own are coordinates of their own
            assert self._play is not None
            spin_up = self._tau[alone] / self._play.inertia[alone]
            of_joints = acceleration

            def acceleration(q: FloatArray, v: FloatArray) -> FloatArray:
                return np.concatenate((of_joints(q[:n], v[:n]), spin_up))

            q, v = np.concatenate((q, state.theta[alone])), np.concatenate((v, state.omega[alone]))
            a = None if a is None else np.concatenate((a, spin_up))
        if self._is_stiff(state.q, h, modes.open):
            return self._damped(state, q, v, h, acceleration, modes)
        if not modes.falls:
            step = runge_kutta_step(q, v, h, acceleration, a)
            if not self._falls(modes.joints, state.v, step.velocity[:n]):
                return self._end(state, step, h, modes)
            return self._advance(state, h, modes._replace(falls=True), None)
        return self._in_pieces(state, q, v, a, h, acceleration, modes)

    def _falls(self, joints: Modes, v: FloatArray, after: FloatArray) -> bool:
        """Tell whether dry friction changes noticeably with speed on the way."""
        if not self._has_stribeck_effect:
            return False
        slowest = np.minimum(v * joints.direction, after * joints.direction)
        return bool(((joints.direction != 0.0) & (slowest < self._falls_below)).any())

    def _gather(
        self, before: MotionState, q: FloatArray, v: FloatArray, modes: GearModes,
    ) -> MotionState:
        """Return the state of joints and motors from the coordinates of `_advance`."""
        n = len(before.q)
        if self._play is None:
            return MotionState(q, v, q, v)
        joint_q, joint_v = q[:n], v[:n]
        theta, omega = joint_q + modes.side * self._play.half_gap, joint_v.copy()
        theta[modes.open], omega[modes.open] = q[n:], v[n:]
        return MotionState(joint_q, joint_v, theta, omega)

    def _damped(
        self, state: MotionState, q: FloatArray, v: FloatArray, h: float,
        acceleration: Acceleration, modes: GearModes,
    ) -> _End:
        n, alone = len(state.q), modes.open
        M, viscous, free = np.zeros((len(q), len(q))), np.zeros(len(q)), np.ones(len(q), bool)
        M[:n, :n] = self._body_with(alone).mass_matrix(state.q)
        viscous[:n], free[:n] = self._friction.viscous, ~modes.joints.stuck
        if len(q) > n:
            assert self._play is not None
            np.fill_diagonal(M[n:, n:], self._play.inertia[alone])
        q, v = damped_step(q, v, h, acceleration, M, viscous, free)
        after = self._gather(state, q, v, modes)
        return _End(after, self._lost(state, after), acceleration(q, v)[:n])

    def _in_pieces(
        self, state: MotionState, q: FloatArray, v: FloatArray, a: FloatArray | None, h: float,
        acceleration: Acceleration, modes: GearModes,
    ) -> _End:
        """Return the same with steps as short as the error of each asks for."""
        weights = np.ones_like(q)
        weights[:len(state.q)] = self._root_inertia
        heat, rest, piece = 0.0, h, h
        while True:
            step = runge_kutta_step(q, v, piece, acceleration, a)
            error = step.error(piece, acceleration, weights)
            ratio = 0.9 * (_STRIBECK_TOLERANCE / (error + 1e-30))**0.2
            if ratio < 0.9 and piece > _FINEST * h:
                piece = max(piece * max(ratio, 0.1), _FINEST * h)
                continue
            end = self._end(state, step, piece, modes)
            heat, rest = heat + end.heat, rest - piece
            if rest <= 1e-12 * h:
                return end._replace(heat=heat)
            q, v, a = step.position, step.velocity, None
            piece = min(rest, piece * min(ratio, 5.0))

    def _end(
        self, state: MotionState, step: RungeKuttaStep, h: float, modes: GearModes,
    ) -> _End:
        """Return where a step of h [s] leads, and the heat of friction on the way."""
        n = len(state.q)
        after = self._gather(state, step.position, step.velocity, modes)
        # The last stage is at the end of the step, but for an error of order h⁵.
        a_end = step.accelerations[-1, :n]
        if not (self._is_dry or self._is_damped):
            return _End(after, 0.0, a_end)
        v = step.velocities[:, :n]
        friction = self._rubbing(v, modes)
        return _End(after, h * float(WEIGHTS @ (friction * v).sum(axis=1)), a_end)

    def _lost(self, before: MotionState, after: MotionState) -> float:
        """Return the work less the gain in energy: what friction took, by energy balance [J]."""
        body, work = self._body, float(self._tau @ (after.theta - before.theta))
        if self._wrenches:  # at both ends: of the order of the step that this is the balance of
            work -= 0.5 * float((after.q - before.q) @ sum(
                body.external(state.q, self._wrenches) for state in (before, after)))
        return work + self.kinetic_energy(before) - self.kinetic_energy(after) + (
            body.potential_energy(before.q) - body.potential_energy(after.q))
