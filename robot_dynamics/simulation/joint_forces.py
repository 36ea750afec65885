# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The forces on the joints of an arm that slide, stick, or are separated from their motors.

Sliding dry friction has one direction between two events. The bristles of joints that yield before
they slide are springs (`bristles`). Motors in the gap of their gears do not act on their joints,
and their rotors do not move with the joints.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.joints.stiction import constrained_motion, Modes
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.unchecked_rigid_body import UncheckedRigidBody
from robot_dynamics.simulation.backlash import Backlash
from robot_dynamics.simulation.bristles import Bristles, Springs
from robot_dynamics.simulation.runge_kutta import Acceleration


class MotionState(NamedTuple):
    """
    Position q and velocity v of the joints, θ and ω of their motors, all (n,), on the joint side.

    Without backlash, motor and joint have the same position. z (n,) is the deflection of the
    bristles.
    """

    q: FloatArray
    v: FloatArray
    theta: FloatArray
    omega: FloatArray
    z: FloatArray


class GearModes(NamedTuple):
    """
    The modes of an arm between two events.

    `joints` are the modes of the joints; `side` (n,) is the side on which teeth are in contact;
    `open` marks separated motors; `is_steep` states whether friction changes fast with speed;
    `springs` are the bristles of joints that stick elastically, None without such a joint.
    """

    joints: Modes
    side: FloatArray
    open: BoolArray
    is_steep: bool
    springs: Springs | None = None


class JointForces:
    """The forces on the joints under the efforts and wrenches of the last call of `drive`."""

    def __init__(self, dynamics: UncheckedArmDynamics) -> None:
        self.friction, self.body = dynamics.friction, dynamics.rigid_body
        self.backlash = Backlash.of(dynamics.arm.actuators)
        self.bristles = Bristles.of(self.friction)
        self._dynamics = dynamics
        self._apart: dict[bytes, UncheckedArmDynamics] = {}

    def drive(self, tau: FloatArray, wrenches: Sequence[ExternalWrench] = ()) -> None:
        """Set the efforts of the motors (n,) and the wrenches that act from now on."""
        self.tau, self.wrenches = tau, wrenches

    def kinetic_energy(self, state: MotionState) -> float:
        """Return the kinetic energy of links and rotors [J]."""
        energy = self.body.kinetic_energy(state.q, state.v)
        if self.backlash is not None:
            difference = self.backlash.inertia * (state.omega**2 - state.v**2)
            energy += 0.5 * float(difference @ self.backlash.exists)
        return energy

    def potential_energy(self, state: MotionState) -> float:
        """Return the potential energy of the bodies and of the bristles [J]."""
        energy = self.body.potential_energy(state.q)
        return energy if self.bristles is None else energy + self.bristles.stored(state.z)

    def motor_inertia(self, state: MotionState) -> FloatArray:
        """Return the mass matrix (n, n) on the motor side; that of the rotors for open gears."""
        if self.backlash is None:
            return self.body.mass_matrix(state.q)
        opened = self.backlash.exists & (self.backlash.touching(state.q, state.theta) == 0.0)
        M = np.where(opened | opened[:, None], 0.0, self.body.mass_matrix(state.q))
        return np.asarray(M + np.diag(self.backlash.inertia * opened))

    def body_with(self, opened: BoolArray) -> UncheckedRigidBody:
        """Return the rigid bodies without the rotors of separated motors."""
        return self._dynamics_with(opened).rigid_body

    def _dynamics_with(self, opened: BoolArray) -> UncheckedArmDynamics:
        """Return the same with the friction, which depends on no load at separated motors."""
        if self.backlash is None or not opened.any():
            return self._dynamics
        key = opened.tobytes()
        if key not in self._apart:
            arm, load = self._dynamics.arm, np.where(opened, 0.0, self.friction.load_coefficient)
            self._apart[key] = UncheckedArmDynamics(arm.with_rotors_apart(opened).with_friction(
                self.friction.replaced(load_coefficient=load)))
        return self._apart[key]

    def effort(
        self, q: FloatArray, v: FloatArray, opened: BoolArray, springs: Springs | None = None,
        direction: FloatArray | None = None,
    ) -> FloatArray:
        """
        Return the effort that accelerates the joints, without dry friction except `springs`.

        `direction` (n,) is that of sliding, by default the sign of v.
        """
        tau = np.where(opened, 0.0, self.tau)
        if springs is not None:
            tau = tau - springs.force(q, v)
        effort = self._dynamics_with(opened).friction.without_dry(
            v, tau, None if self.bristles is None else direction)
        effort = effort - self.body.nonlinear(q, v)
        return effort - self.body.external(q, self.wrenches) if self.wrenches else effort

    def after_friction(self, q: FloatArray, v: FloatArray, modes: GearModes) -> FloatArray:
        """Return the efforts at the joints after friction, (..., n), at q and v."""
        tau = self.tau if self.backlash is None else np.where(modes.open, 0.0, self.tau)
        if modes.springs is not None:
            tau = tau - modes.springs.force(q, v)
        return self._dynamics_with(modes.open).friction.load_behind(v, tau, modes.joints.direction)

    def damping(self, q: FloatArray, v: FloatArray, modes: GearModes) -> FloatArray:
        """Return the viscous friction (n,) that equals all smooth friction at v."""
        damping = self.friction.viscous
        if not self.friction.is_linear:
            damping = self._dynamics_with(modes.open).friction.damping(
                v, self.after_friction(q, v, modes))
        return damping if modes.springs is None else damping + modes.springs.damping_at(v)

    def dry_friction(self, q: FloatArray, v: FloatArray, modes: GearModes) -> FloatArray:
        """Return the friction (..., n) at q and v that is not stored in springs."""
        friction = np.where(modes.open, 0.0, self.tau) - self.after_friction(q, v, modes)
        if modes.springs is None:
            return friction
        return friction - np.where(
            modes.springs.holds, modes.springs.elastic(q) + self.friction.offset, 0.0)

    def acceleration(self, modes: GearModes) -> Acceleration:
        """Return the joint acceleration (n,) in these modes as a function of q and v."""
        body, wrenches, stuck = self.body_with(modes.open), self.wrenches, modes.joints.stuck
        if not stuck.any():
            return lambda q, v: body.acceleration(
                q, v, self.after_friction(q, v, modes), wrenches)

        def acceleration(q: FloatArray, v: FloatArray) -> FloatArray:
            effort = self.after_friction(q, v, modes) - body.nonlinear(q, v)
            if wrenches:
                effort = effort - body.external(q, wrenches)
            return constrained_motion(body.mass_matrix(q), effort, stuck).acceleration

        return acceleration
