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
The manipulator equation of the rigid bodies: τ = M(q) q̈ + C(q, q̇) q̇ + g(q) − Jᵀ f.

Source: R. Featherstone, *Rigid Body Dynamics Algorithms*, Springer 2008: the recursive
Newton–Euler algorithm (section 5.3), the composite rigid body algorithm (6.2), the articulated
body algorithm (7.3); Christoffel symbols: B. Siciliano et al., *Robotics*, Springer 2009,
eqs. (7.43) to (7.45). Friction is not part of it: see `arm_dynamics`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from robot_dynamics.arrays import all_finite, FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.validation import check_samples, check_scalar, check_states, check_vector

HAS_PARALLEL_RNEA = hasattr(pin, 'rneaInParallel')
"""Whether this Pinocchio was built with OpenMP, which is off in its own build by default."""
_BATCH = 100
"""Samples that are worked on in one go."""


@dataclass(frozen=True, eq=False)
class ExternalWrench:
    """
    What the environment exerts on a link, in that link's frame, at its origin.

    `force` (3,) [N], `torque` (3,) [N·m]. Raises InvalidInputError on another length or a value
    that is not finite.
    """

    link: str
    force: FloatArray
    torque: FloatArray

    def __post_init__(self) -> None:
        for field in ('force', 'torque'):
            value = check_vector(field, getattr(self, field), 3, ('x', 'y', 'z'))
            object.__setattr__(self, field, value)


class RigidBodyTerms(NamedTuple):
    """The terms of the manipulator equation at one state, each (n,) [N·m] or [N]; energies [J]."""

    inertial: FloatArray
    coriolis: FloatArray
    gravity: FloatArray
    external: FloatArray
    kinetic_energy: float
    potential_energy: float


class UncheckedRigidBody:
    """
    `RigidBody` without checks, for control loops and simulation.

    Inputs are finite float64 arrays of the right shape; other inputs give errors of Pinocchio or
    wrong results. An instance holds the scratch memory of the algorithms, so it is not for two
    threads at a time; what it returns is new.
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
        # fixed to the base (docs/pinocchio_notes.md).
        base = self._model.inertias[0]
        self._base_energy = float(-base.mass * self._model.gravity.linear @ base.lever)
        self._pool: Any = None

    # ------------------------------------------------------------------ efforts

    def inverse_dynamics(
        self, q: FloatArray, v: FloatArray, a: FloatArray,
        wrenches: Sequence[ExternalWrench] = (),
    ) -> FloatArray:
        """Return M(q) a + C(q, v) v + g(q) − Jᵀ f."""
        x = self._x
        if x.is_identity and not wrenches:
            return np.asarray(pin.rnea(self._model, self._data, q, v, a))
        q_tree, v_tree, a_tree = x.position(q), x.rate(v), x.rate(a)
        if not wrenches:
            return x.effort(pin.rnea(self._model, self._data, q_tree, v_tree, a_tree))
        forces = self._joint_forces(wrenches)
        return x.effort(pin.rnea(self._model, self._data, q_tree, v_tree, a_tree, forces))

    def gravity(self, q: FloatArray) -> FloatArray:
        """Return g(q): what holds the arm still."""
        x = self._x
        if x.is_identity:
            return np.asarray(pin.computeGeneralizedGravity(self._model, self._data, q))
        return x.effort(pin.computeGeneralizedGravity(self._model, self._data, x.position(q)))

    def nonlinear(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return N(q, v) = C(q, v) v + g(q)."""
        x = self._x
        return x.effort(
            pin.nonLinearEffects(self._model, self._data, x.position(q), x.rate(v)))

    def external(self, q: FloatArray, wrenches: Sequence[ExternalWrench]) -> FloatArray:
        """Return −Jᵀ f: what bears the wrenches that the environment puts on the links."""
        if not wrenches:
            return np.zeros(self.arm.joint_count)
        x, zero = self._x, self._zero
        forces = self._joint_forces(wrenches)
        return x.effort(pin.rnea(
            self._weightless, self._data, x.position(q), zero, zero, forces))

    def terms(
        self, q: FloatArray, v: FloatArray, a: FloatArray,
        wrenches: Sequence[ExternalWrench] = (),
    ) -> RigidBodyTerms:
        """Return the efforts of inverse_dynamics, split; they add up to it. One pass for all."""
        x, data = self._x, self._data
        v_tree = x.rate(v)
        pin.computeAllTerms(self._model, data, x.position(q), v_tree)
        inertial, gravity = data.M @ x.rate(a), data.g.copy()
        # Pinocchio rounds g(q) and N(q, v) differently; at rest there is no Coriolis force.
        coriolis = data.nle - gravity if v.any() else np.zeros_like(gravity)
        return RigidBodyTerms(
            x.effort(inertial), x.effort(coriolis), x.effort(gravity),
            self.external(q, wrenches), 0.5 * float(v_tree @ data.M @ v_tree),
            data.potential_energy + self._base_energy)

    def inverse_dynamics_batch(
        self, q: FloatArray, v: FloatArray, a: FloatArray, threads: int = 1,
    ) -> FloatArray:
        """
        Return the efforts of many states; all arrays are (samples, n).

        `threads` share the work where Pinocchio was built with OpenMP; elsewhere there is one.
        """
        x = self._x
        q_tree, v_tree, a_tree = x.position(q), x.rate(v), x.rate(a)
        tau = np.zeros_like(q_tree)
        # In parts: Pinocchio does not let other threads of Python run before it returns.
        for i in range(0, len(q), _BATCH):
            part = slice(i, i + _BATCH)
            states = q_tree[part], v_tree[part], a_tree[part]
            tau[part] = (
                self._rnea_in_parallel(*states, threads) if HAS_PARALLEL_RNEA else
                self._rnea_one_by_one(*states))
        return x.effort(tau)

    def _rnea_in_parallel(
        self, q: FloatArray, v: FloatArray, a: FloatArray, threads: int,
    ) -> FloatArray:
        if self._pool is None or self._pool.size() < threads:
            self._pool = pin.ModelPool(self._model, threads)
        # Pinocchio takes one sample a column, and gives a flat array back for one joint or one
        # sample.
        columns = (np.asfortranarray(rows.T) for rows in (q, v, a))
        tau = pin.rneaInParallel(threads, self._pool, *columns)
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

        Row i of the equation of motion has Σ_jk c_ijk v_j v_k, a quadratic form in v; its
        symmetric coefficients follow exactly from the values at e_j and e_j + e_k.
        """
        n = self._model.nv
        q_tree, zero = self._x.position(q), self._zero

        def quadratic(v: FloatArray) -> FloatArray:
            return np.asarray(pin.rnea(self._weightless, self._data, q_tree, v, zero))

        e = np.eye(n)
        square = [quadratic(e[j]) for j in range(n)]
        c = np.empty((n, n, n))
        for j in range(n):
            c[:, j, j] = square[j]
            for k in range(j):
                c[:, j, k] = 0.5 * (quadratic(e[j] + e[k]) - square[j] - square[k])
                c[:, k, j] = c[:, j, k]
        if self._x.is_identity:
            return c
        G = self._x.G
        return np.asarray(np.einsum('abc,ai,bj,ck->ijk', c, G, G, G, optimize=True))

    # ------------------------------------------------------------------ motion and energy

    def forward_dynamics(
        self, q: FloatArray, v: FloatArray, tau: FloatArray,
        wrenches: Sequence[ExternalWrench] = (),
    ) -> FloatArray:
        """
        Return the acceleration a with M a + C v + g − Jᵀ f = tau.

        Raises InvalidInputError where M(q) is singular: a joint that moves no mass.
        """
        a = self.acceleration(q, v, tau, wrenches)
        if not all_finite(a):
            raise singular_mass_matrix(q)
        return a

    def acceleration(
        self, q: FloatArray, v: FloatArray, tau: FloatArray,
        wrenches: Sequence[ExternalWrench] = (),
    ) -> FloatArray:
        """Return the same unchecked: not finite where M(q) is singular."""
        x = self._x
        if x.is_identity and not wrenches:
            a: FloatArray = pin.aba(self._model, self._data, q, v, tau)
            return a
        if x.is_identity or x.is_permutation:
            tau_tree = tau if x.is_identity else tau @ x.G.T
            arguments = (self._model, self._data, x.position(q), x.rate(v), tau_tree)
            return np.asarray(x.effort(
                pin.aba(*arguments, self._joint_forces(wrenches)) if wrenches else
                pin.aba(*arguments)))
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

    def potential_energy_batch(self, q: FloatArray) -> FloatArray:
        """Return the potential energy (samples,) [J] of many positions (samples, n)."""
        model, data, compute = self._model, self._data, pin.computePotentialEnergy
        moving = np.array([compute(model, data, row) for row in self._x.position(q)])
        return np.asarray(moving + self._base_energy)

    def _joint_forces(self, wrenches: Sequence[ExternalWrench]) -> pin.StdVec_Force:
        """Return the sum of the wrenches on each joint's bodies, in that joint's frame."""
        forces = [pin.Force.Zero() for _ in range(self._model.njoints)]
        for wrench in wrenches:
            frame = self.arm.link_frame(wrench.link)
            forces[frame.parentJoint] += frame.placement.act(
                pin.Force(wrench.force, wrench.torque))
        return pin.StdVec_Force(forces) if forces else pin.StdVec_Force()


def singular_mass_matrix(q: FloatArray) -> InvalidInputError:
    """Return the error of forward dynamics at a position where M(q) has no inverse."""
    return InvalidInputError(
        f'forward dynamics at position {q.tolist()} has no finite solution: the mass matrix is '
        'singular, expected every joint to move some mass or inertia')


class ManipulatorEquation:
    """
    The terms M(q), C(q, v), g(q) and −Jᵀ f of one arm, and its energies.

    All vectors are (n,) in the order of `arm.joint_names`: q [rad] or [m], v and a its
    derivatives, tau [N·m] or [N]. Each method accepts lists, tuples and arrays of numbers, and
    raises InvalidInputError, naming field, index, joint and value, if a length is wrong or a
    value is not a finite number. Not for two threads at a time.
    """

    def __init__(self, arm: ArmModel, body: UncheckedRigidBody) -> None:
        self.arm = arm
        self._body = body

    def __repr__(self) -> str:
        return f'<{type(self).__name__} of {self.arm!r}>'

    def mass_matrix(self, q: npt.ArrayLike) -> FloatArray:
        """
        Return the mass matrix M(q), (n, n), of τ = M(q) q̈ + C(q, q̇) q̇ + g(q).

        Symmetric and positive definite; ½ q̇ᵀ M q̇ is the kinetic energy, with the reflected
        inertia of the rotors. M_ij is [kg·m²] between two revolute joints, [kg·m] between a
        revolute and a prismatic one, [kg] between two prismatic ones. Composite rigid body
        algorithm (Featherstone 2008, section 6.2).
        """
        return self._body.mass_matrix(**self._vectors(q=q))

    def coriolis_matrix(self, q: npt.ArrayLike, v: npt.ArrayLike) -> FloatArray:
        """
        Return C(q, v), (n, n), with C_ij = Σ_k c_ijk v_k and the Christoffel symbols c_ijk.

        C(q, v) v are the Coriolis and centrifugal torques [N·m] or forces [N]. With this choice
        of C, Ṁ − 2 C is skew-symmetric (Siciliano et al. 2009, eq. (7.44)).
        """
        return self._body.coriolis_matrix(**self._vectors(q=q, v=v))

    def christoffel_symbols(self, q: npt.ArrayLike) -> FloatArray:
        """
        Return c_ijk = ½ (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_jk/∂q_i), (n, n, n).

        Row i of C(q, v) v is Σ_jk c_ijk v_j v_k (Siciliano et al. 2009, eq. (7.45)). Units are
        those of M per [rad] or [m].
        """
        return self._body.christoffel_symbols(**self._vectors(q=q))

    def gravity(self, q: npt.ArrayLike) -> FloatArray:
        """
        Return g(q), (n,) [N·m] or [N]: the effort that holds the arm still.

        g(q) = ∂U/∂q with the potential energy U(q) of all links and payloads.
        """
        return self._body.gravity(**self._vectors(q=q))

    def nonlinear(self, q: npt.ArrayLike, v: npt.ArrayLike) -> FloatArray:
        """Return N(q, v) = C(q, v) v + g(q), (n,) [N·m] or [N]."""
        return self._body.nonlinear(**self._vectors(q=q, v=v))

    def external(self, q: npt.ArrayLike, wrenches: Sequence[ExternalWrench]) -> FloatArray:
        """Return −J(q)ᵀ f, (n,) [N·m] or [N]: the effort that balances the external wrenches."""
        return self._body.external(**self._vectors(q=q), wrenches=wrenches)

    def kinetic_energy(self, q: npt.ArrayLike, v: npt.ArrayLike) -> float:
        """Return ½ vᵀ M(q) v [J], of links and rotors."""
        return self._body.kinetic_energy(**self._vectors(q=q, v=v))

    def potential_energy(self, q: npt.ArrayLike) -> float:
        """Return U(q) = −Σ m gᵀ c [J] of all mass, measured from the origin of the base frame."""
        return self._body.potential_energy(**self._vectors(q=q))

    def potential_energy_batch(self, q: npt.ArrayLike) -> FloatArray:
        """Return the potential energy (samples,) [J] of many positions (samples, n)."""
        return self._body.potential_energy_batch(**self._samples(q=q))

    def _vectors(self, **values: npt.ArrayLike) -> dict[str, FloatArray]:
        """Return vectors (n,), checked; raise InvalidInputError."""
        names = self.arm.joint_names
        return {
            field: check_vector(field, value, len(names), names)
            for field, value in values.items()}

    def _samples(self, **values: npt.ArrayLike) -> dict[str, FloatArray]:
        """Return matrices (samples, n) with equal numbers of samples; raise InvalidInputError."""
        names = self.arm.joint_names
        return _of_one_shape({
            field: check_samples(field, value, len(names), names)
            for field, value in values.items()})

    def _states(self, **values: npt.ArrayLike) -> dict[str, FloatArray]:
        """Return arrays of one shape, (n,) or (samples, n), checked; raise InvalidInputError."""
        names = self.arm.joint_names
        return _of_one_shape({
            field: check_states(field, value, len(names), names)
            for field, value in values.items()})


class RigidBody(ManipulatorEquation):
    """The rigid bodies of one arm, without friction."""

    def __init__(self, arm: ArmModel) -> None:
        super().__init__(arm, UncheckedRigidBody(arm))

    def inverse_dynamics(
        self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike,
        wrenches: Sequence[ExternalWrench] = (),
    ) -> FloatArray:
        """
        Return τ = M(q) a + C(q, v) v + g(q) − Jᵀ f, (n,) [N·m] or [N].

        Recursive Newton–Euler algorithm (Featherstone 2008, section 5.3).
        """
        return self._body.inverse_dynamics(**self._vectors(q=q, v=v, a=a), wrenches=wrenches)

    def inverse_dynamics_batch(
        self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike, threads: int = 1,
    ) -> FloatArray:
        """
        Return the efforts of many states; all arrays are (samples, n).

        `threads` >= 1 share the work if Pinocchio was built with OpenMP.
        """
        return self._body.inverse_dynamics_batch(
            **self._samples(q=q, v=v, a=a), threads=check_threads(threads))

    def forward_dynamics(
        self, q: npt.ArrayLike, v: npt.ArrayLike, tau: npt.ArrayLike,
        wrenches: Sequence[ExternalWrench] = (),
    ) -> FloatArray:
        """
        Return the acceleration a, (n,), that solves M(q) a + C(q, v) v + g(q) − Jᵀ f = τ.

        Articulated body algorithm (Featherstone 2008, section 7.3). Raises InvalidInputError also
        if M(q) is singular: a joint that moves no mass.
        """
        return self._body.forward_dynamics(**self._vectors(q=q, v=v, tau=tau), wrenches=wrenches)

    def terms(
        self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike,
        wrenches: Sequence[ExternalWrench] = (),
    ) -> RigidBodyTerms:
        """Return the terms of `inverse_dynamics`, each (n,) [N·m] or [N], and energies [J]."""
        return self._body.terms(**self._vectors(q=q, v=v, a=a), wrenches=wrenches)


def check_threads(threads: int) -> int:
    """Return a number of threads; raise InvalidInputError unless it is at least 1."""
    return int(check_scalar('threads', threads, minimum=1))


def _of_one_shape(values: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Return the arrays; raise InvalidInputError unless their shapes are equal."""
    (first, expected), *others = values.items()
    for field, array in others:
        if array.shape != expected.shape:
            raise InvalidInputError(
                f'{field} has the shape {array.shape}, expected {expected.shape} as {first} has')
    return values
