# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The motion of an arm under constant efforts of its motors.

`runge_kutta` integrates the rigid bodies with viscous friction; if viscous friction is too stiff,
`exponential_step` does. Between events the motion is smooth, so that the method keeps its order; a
step ends when a joint comes to rest or breaks away (`stiction`), and when teeth collide or
separate (`backlash`). If friction changes fast with speed (Stribeck effect, friction of gears
around rest), steps are divided into pieces for which the error estimate of the method is small.
The pieces are explicit steps even if friction is stiff; only if it is extremely stiff, the whole
step is exponential. A joint that creeps in the friction of its gears is also integrated with
exponential steps, while their estimated error is small.

Joints that yield before they slide (`bristles`) are springs between events. Explicit steps
integrate slow springs, and exponential steps stiff ones, halved until their estimated error is
small. While a spring oscillates so far that its joint may slip, steps are divided so that the
event is found.
"""

from functools import partial

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.simulation.contact_modes import ContactModeSolver, StepResult
from robot_dynamics.simulation.events import first_event, StepEnd
from robot_dynamics.simulation.exponential_step import exponential_step
from robot_dynamics.simulation.joint_forces import GearModes, JointForces, MotionState
from robot_dynamics.simulation.runge_kutta import (
    Acceleration,
    runge_kutta_step,
    RungeKuttaStep,
    WEIGHTS,
)

STIFF = 1.0
"""Relaxation rate × step from which viscous friction is integrated exponentially."""
_SPRING_RATE = 2.0
"""The relaxation rate that counts for the frequency [rad/s] of a spring."""
_STIFFEST_IN_PIECES = 100.0
"""The same value from which a step is not divided into explicit pieces, which are too many."""
_MAX_EVENTS = 60
_MAX_BOUNCES = 40
"""Number of events in a step after which teeth stay in contact after an impact."""
_STEEP_TOLERANCE = 1e-7
"""Largest error of √M q̇ [J^½] of a piece of a step if friction changes fast with speed."""
_CREEP_TOLERANCE = 1e-5
"""The same for an exponential step in gear friction, estimated by its second-stage correction."""
_FINEST = 2.0**-10
"""Smallest fraction of a step that such a piece has."""
_FINEST_SPRING = 2.0**-5
"""The same if springs are integrated: their faster oscillations are exact, slips are late."""
_MAX_PIECES = 10_000
"""Number of pieces of a step, including rejected ones, after which they are not divided."""


class MotionIntegrator:
    """The motion of one arm under the efforts and wrenches of the last `JointForces.drive`."""

    def __init__(self, forces: JointForces) -> None:
        self._forces = forces
        self._modes = ContactModeSolver(forces)

    def step(self, state: MotionState, h: float) -> StepResult:
        """Return the state after h [s]; the same object if all joints stick rigidly."""
        forces = self._forces
        if self._modes.can_be_steep:
            self._root_inertia = np.sqrt(np.diag(forces.body.mass_matrix(state.q)))
        self._pieces, self._shortest = 0, _FINEST_SPRING * h
        if forces.bristles is None:
            return self._through_events(state, h)
        result = self._through_events(state, h)
        return result._replace(state=result.state._replace(
            z=np.clip(result.state.z, -1.0, 1.0)))

    def _through_events(self, state: MotionState, h: float) -> StepResult:
        forces = self._forces
        heat, had_impact, a, event_count = 0.0, False, None, 0
        while event_count < _MAX_EVENTS:
            if forces.backlash is not None:
                impact = self._modes.impact(state, a, plastic=event_count >= _MAX_BOUNCES)
                state, heat = impact.state, heat + impact.heat
                had_impact = had_impact or impact.had_impact
            modes, a = self._modes.choose(state)
            if modes.joints.stuck.all() and not modes.open.any():
                return StepResult(state, heat, had_impact)
            piece = self._undisturbed(state, h, modes)
            end = self._advance(state, piece, modes, a)
            passed, end = first_event(
                forces, state, piece, modes, a, end,
                partial(self._advance, state, modes=modes, a=a))
            event_count += passed < piece
            state, heat, a, h = end.state, heat + end.heat, end.a, h - passed
            if h <= 0.0:
                return StepResult(state, heat, had_impact)
        end = self._advance(state, h, modes, None)  # a small oscillation, which friction damps
        return StepResult(end.state, heat + end.heat, had_impact)

    # ------------------------------------------------------------------ integration

    def _undisturbed(self, state: MotionState, h: float, modes: GearModes) -> float:
        """Return the part of h [s] after which events must be looked for."""
        if modes.springs is None or self._stiffness(state.q, h, modes) <= STIFF:
            return h
        piece = max(self._modes.undisturbed(state, modes), self._shortest)
        return h if piece > 0.9 * h else piece

    def _stiffness(self, q: FloatArray, h: float, modes: GearModes) -> float:
        """Return a bound of (relaxation rate × h) of the moving joints."""
        forces, springs = self._forces, modes.springs
        in_gears = modes.is_steep and not forces.friction.is_linear
        if springs is None and not (forces.friction.viscous.any() or in_gears):
            return 0.0
        M, free = forces.body_with(modes.open).mass_matrix(q), ~modes.joints.stuck
        compliance = np.diag(np.linalg.inv(M[np.ix_(free, free)]))
        # The friction of gears is stiffest at rest.
        viscous = forces.friction.viscous if springs is None and not in_gears else (
            forces.damping(q, np.zeros_like(q), modes))
        rate = compliance @ viscous[free]  # at least the largest rate: the trace of M⁻¹F_v
        if springs is not None:
            rate = max(rate, _SPRING_RATE * np.sqrt(compliance @ springs.stiffness[free]))
        return h * float(rate)

    def _advance(
        self, state: MotionState, h: float, modes: GearModes, a: FloatArray | None,
    ) -> StepEnd:
        """Return the state after h [s] in these modes; `a` (n,) is the initial acceleration."""
        n, alone = len(state.q), np.flatnonzero(modes.open)
        acceleration = self._forces.acceleration(modes)
        q, v = state.q, state.v
        if len(alone):  # separated motors are additional coordinates
            assert self._forces.backlash is not None
            spin_up = self._forces.tau[alone] / self._forces.backlash.inertia[alone]
            of_joints = acceleration

            def acceleration(q: FloatArray, v: FloatArray) -> FloatArray:
                return np.concatenate((of_joints(q[:n], v[:n]), spin_up))

            q, v = np.concatenate((q, state.theta[alone])), np.concatenate((v, state.omega[alone]))
            a = None if a is None else np.concatenate((a, spin_up))
        stiffness = self._stiffness(state.q, h, modes)
        if stiffness > STIFF:
            end, correction = self._damped(state, q, v, h, acceleration, modes)
            is_fine = correction <= _CREEP_TOLERANCE
            if modes.springs is not None:
                if is_fine or h <= self._shortest:
                    return end
                first = self._advance(state, 0.5 * h, modes, None)
                end = self._advance(first.state, 0.5 * h, modes, None)
                return end._replace(heat=first.heat + end.heat)
            if is_fine and modes.is_steep and not self._forces.friction.is_linear:
                return end
        if modes.is_steep and (
                stiffness <= _STIFFEST_IN_PIECES and self._pieces < _MAX_PIECES):
            return self._in_pieces(state, q, v, a, h, acceleration, modes)
        if stiffness <= STIFF:
            end = self._end(state, q, runge_kutta_step(q, v, h, acceleration, a), h, modes)
        if modes.is_steep or not self._modes.is_steep(modes.joints, state.v, end.state.v):
            return end
        return self._advance(state, h, modes._replace(is_steep=True), None)

    def _gather(
        self, before: MotionState, q: FloatArray, v: FloatArray, modes: GearModes,
    ) -> MotionState:
        """Return the state of joints and motors from the coordinates of `_advance`."""
        n, z = len(before.q), before.z
        if self._forces.bristles is not None:
            z = self._forces.bristles.after(z, q[:n] - before.q, modes.joints.direction)
        if self._forces.backlash is None:
            return MotionState(q, v, q, v, z)
        joint_q, joint_v = q[:n], v[:n]
        theta, omega = joint_q + modes.side * self._forces.backlash.half_gap, joint_v.copy()
        theta[modes.open], omega[modes.open] = q[n:], v[n:]
        return MotionState(joint_q, joint_v, theta, omega, z)

    def _damped(
        self, state: MotionState, q: FloatArray, v: FloatArray, h: float,
        acceleration: Acceleration, modes: GearModes,
    ) -> tuple[StepEnd, float]:
        """Return the end of an exponential step, and its estimated error of √M q̇ [J^½]."""
        n, alone = len(state.q), modes.open
        M, free = np.zeros((len(q), len(q))), np.ones(len(q), bool)
        viscous, stiffness = np.zeros(len(q)), np.zeros(len(q))
        M[:n, :n] = self._forces.body_with(alone).mass_matrix(state.q)
        viscous[:n] = self._forces.damping(q[:n], v[:n], modes)
        free[:n] = ~modes.joints.stuck
        if len(q) > n:
            assert self._forces.backlash is not None
            np.fill_diagonal(M[n:, n:], self._forces.backlash.inertia[alone])
        if modes.springs is not None:
            stiffness[:n] = modes.springs.stiffness
        q, v, correction = exponential_step(q, v, h, acceleration, M, viscous, stiffness, free)
        after = self._gather(state, q, v, modes)
        error = float(np.max(np.sqrt(np.diag(M)) * np.abs(correction)))
        return StepEnd(after, self._lost(state, after), acceleration(q, v)[:n]), error

    def _in_pieces(
        self, state: MotionState, q: FloatArray, v: FloatArray, a: FloatArray | None, h: float,
        acceleration: Acceleration, modes: GearModes,
    ) -> StepEnd:
        """Return the end of steps that are as short as their estimated errors require."""
        weights = np.ones_like(q)
        weights[:len(state.q)] = self._root_inertia
        heat, rest, piece = 0.0, h, h
        while True:
            self._pieces += 1
            if self._pieces > _MAX_PIECES:
                end = self._advance(self._gather(state, q, v, modes), rest, modes, None)
                return end._replace(heat=heat + end.heat)
            step = runge_kutta_step(q, v, piece, acceleration, a)
            error = step.error(piece, acceleration, weights)
            ratio = 0.9 * (_STEEP_TOLERANCE / (error + 1e-30))**0.2
            if ratio < 0.9 and piece > _FINEST * h:
                piece = max(piece * max(ratio, 0.1), _FINEST * h)
                continue
            end = self._end(state, q, step, piece, modes)
            heat, rest = heat + end.heat, rest - piece
            if rest <= 1e-12 * h:
                return end._replace(heat=heat)
            q, v, a = step.position, step.velocity, None
            piece = min(rest, max(piece * min(ratio, 5.0), _FINEST * h))

    def _end(
        self, state: MotionState, q: FloatArray, step: RungeKuttaStep, h: float,
        modes: GearModes,
    ) -> StepEnd:
        """Return the end of a step of h [s] from q, and the heat of friction during the step."""
        n = len(state.q)
        after = self._gather(state, step.position, step.velocity, modes)
        # The last stage is at the end of the step, except for an error of order h⁵.
        a_end = step.accelerations[-1, :n]
        if self._forces.friction.is_zero:
            return StepEnd(after, 0.0, a_end)
        v = step.velocities[:, :n]
        if modes.springs is not None:
            q = step.positions(q, h)
        friction = self._forces.dry_friction(q[..., :n], v, modes)
        return StepEnd(after, h * float(WEIGHTS @ (friction * v).sum(axis=1)), a_end)

    def _lost(self, before: MotionState, after: MotionState) -> float:
        """Return the heat of friction [J] by energy balance: the work minus the energy gain."""
        forces, body = self._forces, self._forces.body
        work = float(forces.tau @ (after.theta - before.theta))
        if forces.wrenches:  # values at both ends, with the order of accuracy of the step
            work -= 0.5 * float((after.q - before.q) @ sum(
                body.external(state.q, forces.wrenches) for state in (before, after)))
        return work + forces.kinetic_energy(before) - forces.kinetic_energy(after) + (
            forces.potential_energy(before) - forces.potential_energy(after))
