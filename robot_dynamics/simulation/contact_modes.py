# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The contact modes of an arm at a state: sticking joints, teeth in contact, and impacts.

Motors whose teeth are in contact push their joints; motors that would have to pull separate from
them. The modes are found iteratively: each iteration changes the mode with the largest violation.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.joints.stiction import choose_modes, constrained_motion, Modes
from robot_dynamics.simulation.bristles import longest_undisturbed, Springs
from robot_dynamics.simulation.joint_forces import GearModes, JointForces, MotionState

_BOUNCES = 40
"""Number of impacts at one time after which teeth stay in contact."""
_SLOW = 1e-3
"""Velocity [rad/s] or [m/s] below which teeth stay in contact, which ends infinite bounces."""
_TRIES_PER_JOINT = 4


class StepResult(NamedTuple):
    """The state after a step or impacts, the heat during it [J], and whether teeth had impacts."""

    state: MotionState
    heat: float
    had_impact: bool


class ContactModeSolver:
    """Chooses the modes of motions under the same forces."""

    def __init__(self, forces: JointForces) -> None:
        self._forces = forces
        friction = forces.friction
        n = len(friction.viscous)
        self._none, self._nowhere = np.zeros(n, dtype=bool), np.zeros(n)
        yields = self._none if forces.bristles is None else forces.bristles.yields
        self._rigid = np.where(yields, 0.0, friction.breakaway)
        self._has_dry_friction = self._rigid > 0.0
        self._dry_limit, self._smooth_limit = friction.steep_below
        self.can_be_steep = bool(self._dry_limit.any() or self._smooth_limit.any())
        """Whether friction of some joint changes fast with speed, at some speed."""

    def choose(self, state: MotionState) -> tuple[GearModes, FloatArray]:
        """Return the modes of the motion from a state, and the joint acceleration (n,)."""
        if self._forces.backlash is None:
            return self._modes(state, self._none, self._nowhere)
        touching = self._forces.backlash.touching(state.q, state.theta)
        parted = self._forces.backlash.exists & (touching == 0.0)
        opened = self._forces.backlash.exists & (touching * (state.omega - state.v) < 0.0) | parted
        J, tau, tried = self._forces.backlash.inertia, self._forces.tau, 0
        while True:
            modes, a = self._modes(state, opened, np.where(opened, 0.0, touching))
            push = touching * (tau - J * a)
            wrong = np.where(opened, push, -push)
            wrong[state.omega != state.v] = 0.0  # teeth that separate
            worst = int(np.argmax(wrong))
            slack = 1e-12 * float(np.abs(tau).max() + np.abs(J * a).max())
            if wrong[worst] <= slack or tried > _TRIES_PER_JOINT * len(tau):
                return modes, a
            opened, tried = opened.copy(), tried + 1
            opened[worst] = not opened[worst]

    def _modes(
        self, state: MotionState, opened: BoolArray, side: FloatArray,
    ) -> tuple[GearModes, FloatArray]:
        """Return the modes with these motors separated, and the joint acceleration (n,)."""
        bristles, slides = self._forces.bristles, self._nowhere
        if bristles is not None:
            slides = bristles.sliding(state.z, state.v)
        springs = self._springs(state, opened, slides)
        joints = self._joint_modes(state, opened, slides, springs)
        modes = GearModes(
            joints, side, opened, self.is_steep(joints, state.v, state.v), springs)
        a = self._forces.acceleration(modes)(state.q, state.v)
        if springs is None:
            return modes, a
        # A joint at rest with its full deflection starts to slide, with the same acceleration.
        full = springs.holds & (state.v == 0.0) & (np.abs(state.z) >= 1.0)
        starts = full & (state.z * a > 0.0)
        if starts.any():
            joints = joints._replace(
                direction=np.where(starts, np.sign(state.z), joints.direction))
            modes = GearModes(
                joints, side, opened, self.is_steep(joints, state.v, state.v),
                self._springs(state, opened, joints.direction))
        return modes, a

    def _springs(
        self, state: MotionState, opened: BoolArray, direction: FloatArray,
    ) -> Springs | None:
        if self._forces.bristles is None:
            return None
        inertia = np.diag(self._forces.body_with(opened).mass_matrix(state.q))
        return self._forces.bristles.springs(state.q, state.z, direction, inertia)

    def _joint_modes(
        self, state: MotionState, opened: BoolArray, slides: FloatArray, springs: Springs | None,
    ) -> Modes:
        v = state.v
        if v[self._has_dry_friction].all():
            return Modes(np.where(self._has_dry_friction, np.sign(v), slides), self._none)
        forces = self._forces
        sliding = forces.friction.dry(v)
        effort = forces.effort(
            state.q, v, opened, springs, np.where(self._has_dry_friction, np.sign(v), slides))
        modes = choose_modes(
            forces.body_with(opened).mass_matrix(state.q), v, effort - slides * sliding, sliding,
            self._rigid)
        return modes._replace(direction=np.where(self._has_dry_friction, modes.direction, slides))

    def undisturbed(self, state: MotionState, modes: GearModes) -> float:
        """Return the time [s] after which events of the bristles must be looked for, or ∞."""
        springs, direction, forces = modes.springs, modes.joints.direction, self._forces
        if springs is None:
            return np.inf
        assert forces.bristles is not None
        v = np.where(springs.holds, 0.0, state.v)
        M = forces.body_with(modes.open).mass_matrix(state.q)
        effort = forces.effort(state.q, v, modes.open, direction=direction)
        held = springs.holds | modes.joints.stuck
        needed = constrained_motion(M, effort - direction * forces.friction.dry(v), held).friction
        return longest_undisturbed(
            springs, state.z, state.v, M, needed, ~held, forces.bristles.static)

    def impact(self, state: MotionState, a: FloatArray | None, plastic: bool) -> StepResult:
        """
        Return the state after the impacts of all approaching teeth in contact.

        `a` (n,) is the acceleration of the joints before the impacts, if it is known.
        """
        assert self._forces.backlash is not None
        backlash, (q, v, theta, omega, z) = self._forces.backlash, state
        side = backlash.touching(q, theta)
        closing = side * (omega - v)
        if closing.max() <= 0.0:
            return StepResult(state, 0.0, False)
        push = side * (self._forces.tau - backlash.inertia * a) if a is not None else self._nowhere
        M = self._forces.body_with(backlash.exists).mass_matrix(q)
        heat, impacts = 0.0, 0
        while closing.max() > 0.0:
            if plastic or closing.max() < _SLOW or impacts > _BOUNCES:
                # All at once: in sequence, they would separate each other indefinitely.
                v, omega, lost = backlash.join(M, (side != 0.0) & (closing > -_SLOW), v, omega)
            else:
                v, omega, lost = backlash.impact(int(np.argmax(closing)), M, side, v, omega, push)
            heat, impacts = heat + lost, impacts + 1
            closing = side * (omega - v)
        theta = np.where(side != 0.0, q + side * backlash.half_gap, theta)
        return StepResult(MotionState(q, v, theta, omega, z), heat, True)

    def is_steep(self, joints: Modes, v: FloatArray, after: FloatArray) -> bool:
        """Return whether friction changes fast with speed between the velocities v and `after`."""
        if not self.can_be_steep:
            return False
        nearest = np.where(v * after > 0.0, np.minimum(np.abs(v), np.abs(after)), 0.0)
        if (~joints.stuck & (nearest < self._smooth_limit)).any():
            return True
        slowest = np.minimum(v * joints.direction, after * joints.direction)
        return bool(((joints.direction != 0.0) & (slowest < self._dry_limit)).any())
