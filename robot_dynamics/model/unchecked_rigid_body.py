# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The manipulator equation of the rigid bodies without checks of its inputs, computed by Pinocchio.

Inputs and units are those of `arm_dynamics`, which checks them. Source: R. Featherstone, *Rigid
Body Dynamics Algorithms*, Springer 2008.
"""

from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import all_finite, FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.external_wrench import Wrenches

HAS_PARALLEL_RNEA = hasattr(pin, 'rneaInParallel')
"""Whether Pinocchio was built with OpenMP, which is disabled in its build by default."""
_BATCH = 100
"""Number of samples that are processed in one call."""


class UncheckedRigidBody:
    """
    `RigidBody` without checks, for control loops and simulation.

    Inputs are finite float64 arrays of the right shape; other inputs give errors of Pinocchio or
    wrong results. An instance holds the scratch memory of the algorithms and is therefore not for
    two threads at a time; returned arrays are new.
    """

    def __init__(self, arm: ArmModel) -> None:
        self.arm = arm
        self._x = arm.coordinates
        self._model = arm.pinocchio_model
        self._data = self._model.createData()
        self._zero = np.zeros(self._model.nv)
        self._weightless = self._model.copy()
        self._weightless.gravity.linear = np.zeros(3)
        # Pinocchio's kinetic energy lacks rotors, and its potential energy lacks mass that is
        # fixed to the base (docs/evidence/pinocchio_notes.md).
        base = self._model.inertias[0]
        self._base_energy = float(-base.mass * self._model.gravity.linear @ base.lever)

    # ------------------------------------------------------------------ efforts

    def inverse_dynamics(
        self, q: FloatArray, v: FloatArray, a: FloatArray, wrenches: Wrenches = (),
    ) -> FloatArray:
        """Return M(q) a + C(q, v) v + g(q) − Jᵀ f."""
        x = self._x
        if x.is_identity and not wrenches:
            return np.asarray(pin.rnea(self._model, self._data, q, v, a))
        forces = (self.joint_forces(wrenches),) if wrenches else ()
        return x.effort(pin.rnea(
            self._model, self._data, x.position(q), x.rate(v), x.rate(a), *forces))

    def gravity(self, q: FloatArray) -> FloatArray:
        """Return the gravity-compensation torque g(q)."""
        x = self._x
        return x.effort(pin.computeGeneralizedGravity(self._model, self._data, x.position(q)))

    def nonlinear(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return N(q, v) = C(q, v) v + g(q)."""
        x = self._x
        return x.effort(
            pin.nonLinearEffects(self._model, self._data, x.position(q), x.rate(v)))

    def external(self, q: FloatArray, wrenches: Wrenches) -> FloatArray:
        """Return −Jᵀ f, the effort that balances the external wrenches on the links."""
        if not wrenches:
            return np.zeros(self.arm.joint_count)
        x, zero = self._x, self._zero
        forces = self.joint_forces(wrenches)
        return x.effort(pin.rnea(
            self._weightless, self._data, x.position(q), zero, zero, forces))

    def terms(
        self, q: FloatArray, v: FloatArray, a: FloatArray, wrenches: Wrenches = (),
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, float, float]:
        """
        Return M a, C v, g and −Jᵀ f, (n,) each, which add up to the effort, and the energies [J].

        The energies are the kinetic and the potential one.
        """
        x, data = self._x, self._data
        v_tree = x.rate(v)
        pin.computeAllTerms(self._model, data, x.position(q), v_tree)
        inertial, gravity = data.M @ x.rate(a), data.g.copy()
        # Pinocchio rounds g(q) and N(q, v) differently; at rest there is no Coriolis force.
        coriolis = data.nle - gravity if v.any() else np.zeros_like(gravity)
        return (
            x.effort(inertial), x.effort(coriolis), x.effort(gravity),
            self.external(q, wrenches), 0.5 * float(v_tree @ data.M @ v_tree),
            data.potential_energy + self._base_energy)

    def inverse_dynamics_batch(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return the efforts of many states; all arrays are (samples, n)."""
        x = self._x
        q_tree, v_tree, a_tree = x.position(q), x.rate(v), x.rate(a)
        tau = np.zeros_like(q_tree)
        # In parts: Pinocchio does not let other threads of Python run before it returns.
        for i in range(0, len(q), _BATCH):
            part = slice(i, i + _BATCH)
            states = q_tree[part], v_tree[part], a_tree[part]
            tau[part] = (
                self._rnea_in_parallel(*states) if HAS_PARALLEL_RNEA else
                self._rnea_one_by_one(*states))
        return x.effort(tau)

    def gravity_batch(self, q: FloatArray) -> FloatArray:
        """Return g(q) of many positions; both arrays are (samples, n)."""
        zero = np.zeros_like(q)
        return self.inverse_dynamics_batch(q, zero, zero)

    @cached_property
    def _pool(self) -> Any:
        return pin.ModelPool(self._model, 1)

    def _rnea_in_parallel(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        # Pinocchio expects one sample per column, and returns a flat array for one joint or one
        # sample.
        columns = (np.asfortranarray(rows.T) for rows in (q, v, a))
        tau = pin.rneaInParallel(1, self._pool, *columns)
        return np.asarray(tau.reshape(q.shape[::-1]).T)

    def _rnea_one_by_one(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        model, data = self._model, self._data
        return np.array([pin.rnea(model, data, *state) for state in zip(q, v, a)])

    # ------------------------------------------------------------------ matrices

    def mass_matrix(self, q: FloatArray) -> FloatArray:
        """Return M(q), (n, n): symmetric, positive definite."""
        x = self._x
        return x.form(pin.crba(self._model, self._data, x.position(q)))

    def coriolis_matrix(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return C(q, v), (n, n), with C_ij = Σ_k c_ijk v_k, so that Ṁ − 2 C is skew."""
        x = self._x
        return x.form(
            pin.computeCoriolisMatrix(self._model, self._data, x.position(q), x.rate(v)))

    def christoffel_symbols(self, q: FloatArray) -> FloatArray:
        """
        Return c_ijk = ½ (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_jk/∂q_i), (n, n, n).

        C is linear in v, C_ij(q, v) = Σ_k c_ijk v_k: the symbols are its values at unit vectors.
        """
        return np.stack(
            [self.coriolis_matrix(q, e_k) for e_k in np.eye(self.arm.joint_count)], axis=-1)

    # ------------------------------------------------------------------ motion and energy

    def forward_dynamics(
        self, q: FloatArray, v: FloatArray, tau: FloatArray, wrenches: Wrenches = (),
    ) -> FloatArray:
        """
        Return the acceleration a with M a + C v + g − Jᵀ f = tau.

        Raises InvalidInputError if M(q) is singular, because a joint moves no mass.
        """
        a = self.acceleration(q, v, tau, wrenches)
        if not all_finite(a):
            raise singular_mass_matrix(q)
        return a

    def acceleration(
        self, q: FloatArray, v: FloatArray, tau: FloatArray, wrenches: Wrenches = (),
    ) -> FloatArray:
        """Return the same acceleration unchecked: it is not finite if M(q) is singular."""
        x = self._x
        if x.is_permutation:  # it orders efforts like rates
            forces = (self.joint_forces(wrenches),) if wrenches else ()
            return x.effort(pin.aba(
                self._model, self._data, x.position(q), x.rate(v), x.rate(tau), *forces))
        rest = tau - self.nonlinear(q, v) - self.external(q, wrenches)
        try:
            return np.asarray(np.linalg.solve(self.mass_matrix(q), rest), dtype=np.float64)
        except np.linalg.LinAlgError:
            return np.full_like(rest, np.nan)

    def kinetic_energy(self, q: FloatArray, v: FloatArray) -> float:
        """Return ½ vᵀ M(q) v [J]: links and rotors."""
        v_tree = self._x.rate(v)
        momentum = pin.rnea(
            self._weightless, self._data, self._x.position(q), self._zero, v_tree)
        return 0.5 * float(v_tree @ momentum)

    def potential_energy(self, q: FloatArray) -> float:
        """Return −Σ m gᵀ c [J] of all mass, from the origin of the base frame."""
        return self._base_energy + float(
            pin.computePotentialEnergy(self._model, self._data, self._x.position(q)))

    def joint_forces(self, wrenches: Wrenches) -> pin.StdVec_Force:
        """Return the sum of the wrenches on each joint's bodies, in that joint's frame."""
        forces = [pin.Force.Zero() for _ in range(self._model.njoints)]
        for wrench in wrenches:
            frame = self.arm.link_frame(wrench.link)
            forces[frame.parentJoint] += frame.placement.act(
                pin.Force(wrench.force, wrench.torque))
        return pin.StdVec_Force(forces)


def singular_mass_matrix(q: FloatArray) -> InvalidInputError:
    """Return the error of forward dynamics at a position at which M(q) is singular."""
    return InvalidInputError(
        f'forward dynamics at position {q.tolist()} has no finite solution: the mass matrix is '
        'singular, expected every joint to move some mass or inertia')
