# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The manipulator equation of the rigid bodies: τ = M(q) q̈ + C(q, q̇) q̇ + g(q) − Jᵀ f.

Source: R. Featherstone, *Rigid Body Dynamics Algorithms*, Springer 2008: the recursive
Newton–Euler algorithm (section 5.3), the composite rigid body algorithm (6.2), the articulated
body algorithm (7.3); Christoffel symbols: B. Siciliano et al., *Robotics*, Springer 2009,
eqs. (7.43) to (7.45). Friction is not part of it: see `arm_dynamics`.
"""

from collections.abc import Sequence

import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.unchecked_rigid_body import RigidBodyTerms, UncheckedRigidBody
from robot_dynamics.validation import check_samples, check_scalar, check_states, check_vector


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
