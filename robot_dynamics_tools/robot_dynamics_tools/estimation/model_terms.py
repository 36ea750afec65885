# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The effort of a model by term, at many states."""

from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm_dynamics import ArmDynamics


@dataclass(frozen=True, eq=False)
class TermSeries:
    """
    The model's effort at m states by term, each (m, n) [N·m] or [N]; energies (m,) [J].

    Friction is that of `ArmDynamics.friction_along`, because the sign of a measured velocity is
    meaningless around rest.
    """

    inertial: FloatArray
    coriolis: FloatArray
    gravity: FloatArray
    friction: FloatArray
    kinetic_energy: FloatArray
    potential_energy: FloatArray

    @property
    def effort(self) -> FloatArray:
        """The sum of the terms, which is the effort of the actuators, (m, n)."""
        return np.asarray(self.inertial + self.coriolis + self.gravity + self.friction)

    @property
    def by_name(self) -> dict[str, FloatArray]:
        """The four terms, (m, n) each, by name."""
        return {'inertial': self.inertial, 'coriolis': self.coriolis, 'gravity': self.gravity,
                'friction': self.friction}


def model_terms(
    dynamics: ArmDynamics, position: FloatArray, velocity: FloatArray, acceleration: FloatArray,
) -> TermSeries:
    """
    Return the model's effort, split by term, and the energies, at m states.

    The terms come only from the recursive Newton–Euler algorithm (Featherstone 2008, section 5.3),
    τ = ID(q, q̇, q̈): g = ID(q, 0, 0), C q̇ = ID(q, q̇, 0) − g and M q̈ = ID(q, q̇, q̈) − ID(q, q̇, 0);
    kinetic energy is ½ q̇ᵀ M q̇ with M q̇ = ID(q, 0, q̇) − g. Pinocchio's function for many states
    therefore computes all of them.

    `position`, `velocity` and `acceleration` are (m, n) [rad or m, per second, per second²] in the
    order of `dynamics.arm.joint_names`, finite; the states are in the order of time, which matters
    if gears have a presliding distance.
    """
    body, zero = dynamics.unchecked.rigid_body, np.zeros_like(position)
    q, v, a = (np.ascontiguousarray(x) for x in (position, velocity, acceleration))
    gravity = body.gravity_batch(q)
    nonlinear = body.inverse_dynamics_batch(q, v, zero)
    whole = body.inverse_dynamics_batch(q, v, a)
    momentum = body.inverse_dynamics_batch(q, zero, v) - gravity
    return TermSeries(
        inertial=whole - nonlinear,
        coriolis=nonlinear - gravity,
        gravity=gravity,
        friction=dynamics.unchecked.friction_along(q, v, whole),
        kinetic_energy=np.asarray(0.5 * np.einsum('ij,ij->i', v, momentum)),
        potential_energy=np.array([body.potential_energy(row) for row in q]))
