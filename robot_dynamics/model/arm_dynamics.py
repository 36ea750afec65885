# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The dynamics of an arm, which are those of its rigid bodies and of friction together.

τ = M(q) q̈ + C(q, q̇) q̇ + g(q) + τ_friction − Jᵀ f; τ is on the joint side of the gearbox.
Friction (`friction`) may depend on the load: the effort of the rigid bodies, M q̈ + C q̇ + g − Jᵀ
f.

Source: R. Featherstone, *Rigid Body Dynamics Algorithms*, Springer 2008: the recursive
Newton–Euler algorithm (section 5.3), the composite rigid body algorithm (6.2), the articulated
body algorithm (7.3); Christoffel symbols: B. Siciliano et al., *Robotics*, Springer 2009,
eqs. (7.43) to (7.45).
"""

from collections.abc import Callable, Sequence
from functools import cached_property, partialmethod
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.friction import make_friction, SMOOTHING_VELOCITY
from robot_dynamics.joints.friction_terms import smooth_sign
from robot_dynamics.joints.presliding import presliding_state
from robot_dynamics.joints.stiction import choose_modes, constrained_motion
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.external_wrench import Wrenches
from robot_dynamics.model.unchecked_rigid_body import singular_mass_matrix, UncheckedRigidBody
from robot_dynamics.validation import check_samples, check_vector


class EffortTerms(NamedTuple):
    """
    An effort by term, each (n,) [N·m] or [N], and the energies [J].

    effort = inertial + coriolis + gravity + friction + external. `inertial` is M(q) times an
    acceleration; that of a command contains the feedback.
    """

    inertial: FloatArray
    coriolis: FloatArray
    gravity: FloatArray
    friction: FloatArray
    external: FloatArray
    effort: FloatArray
    kinetic_energy: float
    potential_energy: float


class UncheckedArmDynamics:
    """`ArmDynamics` without checks, with inputs as in `UncheckedRigidBody`."""

    def __init__(self, arm: ArmModel) -> None:
        self.arm = arm
        self.rigid_body = UncheckedRigidBody(arm)
        self.friction = arm.friction
        self._dry = arm.friction.breakaway > 0.0
        self.is_frictionless = self.friction.is_zero

    def inverse_dynamics(
        self, q: FloatArray, v: FloatArray, a: FloatArray, wrenches: Wrenches = (),
    ) -> FloatArray:
        """
        Return the effort (n,) that produces the acceleration a at the state (q, v).

        At rest, any dry friction up to F_s is possible; it is assumed to be 0.
        """
        effort = self.rigid_body.inverse_dynamics(q, v, a, wrenches)
        return effort if self.is_frictionless else effort + self.friction.effort(v, effort)

    def inverse_dynamics_batch(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return the efforts of many states; all arrays are (samples, n)."""
        effort = self.rigid_body.inverse_dynamics_batch(q, v, a)
        return effort if self.is_frictionless else effort + self.friction.effort(v, effort)

    def friction_along(self, q: FloatArray, v: FloatArray, load: FloatArray) -> FloatArray:
        """
        Return the friction (m, n) along a motion: m samples in the order of time.

        For measured motions: around rest the sign is smooth. If gears have a presliding distance,
        dry friction follows the displacement since the last velocity reversal
        (`presliding_state`).
        """
        sign = presliding_state(q, v, self.friction.presliding_distance)
        return self.friction.effort(v, load, sign)

    def forward_dynamics(
        self, q: FloatArray, v: FloatArray, tau: FloatArray, wrenches: Wrenches = (),
    ) -> FloatArray:
        """
        Return the acceleration (n,) that the effort tau produces at the state (q, v).

        A joint with dry friction whose velocity is exactly 0 stays at rest while a friction of at
        most F_s holds it (`stiction`); otherwise it breaks away against F_s. Raises
        InvalidInputError if M(q) is singular, because a joint moves no mass.
        """
        if self.friction.is_dry and bool((self._dry & (v == 0.0)).any()):
            return self._acceleration_from_rest(q, v, tau, wrenches)
        if not self.is_frictionless:
            tau = self.friction.load_behind(v, tau)
        return self.rigid_body.forward_dynamics(q, v, tau, wrenches)

    def load_behind(self, v: FloatArray, effort: FloatArray) -> FloatArray:
        """
        Return the effort of the rigid bodies: a measured effort (..., n) minus all friction.

        For measured motions: around rest the sign is smooth.
        """
        return self.friction.load_behind(v, effort, smooth_sign(v, SMOOTHING_VELOCITY))

    def _acceleration_from_rest(
        self, q: FloatArray, v: FloatArray, tau: FloatArray, wrenches: Wrenches,
    ) -> FloatArray:
        body, friction = self.rigid_body, self.friction
        M, sliding = body.mass_matrix(q), friction.dry(v)
        effort = friction.without_dry(v, tau) - body.nonlinear(q, v)
        if wrenches:
            effort = effort - body.external(q, wrenches)
        try:
            modes = choose_modes(M, v, effort, sliding, friction.breakaway)
            a = constrained_motion(M, effort - modes.direction * sliding, modes.stuck).acceleration
        except np.linalg.LinAlgError:
            a = np.full_like(effort, np.nan)
        if not np.isfinite(a).all():
            raise singular_mass_matrix(q)
        return a

    def terms(
        self, q: FloatArray, v: FloatArray, a: FloatArray,
        wrenches: Wrenches = (), friction: FloatArray | None = None,
    ) -> EffortTerms:
        """
        Return the effort of `inverse_dynamics` split by term, and the energies.

        `friction` (n,), if given, replaces the friction at the velocity v.
        """
        inertial, coriolis, gravity, external, *energies = self.rigid_body.terms(
            q, v, a, wrenches)
        if friction is None:
            load = inertial + coriolis + gravity + external
            friction = self.friction.effort(v, load)
        return EffortTerms(
            inertial, coriolis, gravity, friction, external,
            inertial + coriolis + gravity + friction + external, *energies)


class ArmDynamics:
    """
    Dynamics of an arm with friction: τ = M(q) q̈ + C(q, q̇) q̇ + g(q) + τ_friction − Jᵀ f.

    All vectors are (n,) in the order of `arm.joint_names`: q [rad] or [m], v and a its
    derivatives, tau [N·m] or [N]. Each method accepts lists, tuples and arrays of numbers, and
    raises InvalidInputError, naming field, index, joint and value, if a length is wrong or a
    value is not a finite number. Not for two threads at a time. `unchecked` has methods without
    checks, for control loops, and shares the scratch memory.
    """

    def __init__(self, arm: ArmModel) -> None:
        self.arm = arm
        self.unchecked = UncheckedArmDynamics(arm)
        self._body = self.unchecked.rigid_body

    def __repr__(self) -> str:
        return f'<{type(self).__name__} of {self.arm!r}>'

    @cached_property
    def rigid_body(self) -> 'RigidBody':
        """The same arm without friction."""
        return RigidBody(self.arm)

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

    def gravity_batch(self, q: npt.ArrayLike) -> FloatArray:
        """Return g(q), (samples, n) [N·m] or [N], at many positions (samples, n)."""
        return self._body.gravity_batch(**self._samples(q=q))

    def nonlinear(self, q: npt.ArrayLike, v: npt.ArrayLike) -> FloatArray:
        """Return N(q, v) = C(q, v) v + g(q), (n,) [N·m] or [N]."""
        return self._body.nonlinear(**self._vectors(q=q, v=v))

    def external(self, q: npt.ArrayLike, wrenches: Wrenches) -> FloatArray:
        """Return −J(q)ᵀ f, (n,) [N·m] or [N]: the effort that balances the external wrenches."""
        return self._body.external(**self._vectors(q=q), wrenches=wrenches)

    def kinetic_energy(self, q: npt.ArrayLike, v: npt.ArrayLike) -> float:
        """Return ½ vᵀ M(q) v [J], of links and rotors."""
        return self._body.kinetic_energy(**self._vectors(q=q, v=v))

    def potential_energy(self, q: npt.ArrayLike) -> float:
        """Return U(q) = −Σ m gᵀ c [J] of all mass, measured from the origin of the base frame."""
        return self._body.potential_energy(**self._vectors(q=q))

    def inverse_dynamics(
        self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike, wrenches: Wrenches = (),
    ) -> FloatArray:
        """
        Return τ = M(q) a + C(q, v) v + g(q) + τ_friction − Jᵀ f, (n,) [N·m] or [N].

        At rest, any dry friction up to F_s is possible; it is assumed to be 0. Recursive
        Newton–Euler algorithm (Featherstone 2008, section 5.3).
        """
        return self.unchecked.inverse_dynamics(**self._vectors(q=q, v=v, a=a), wrenches=wrenches)

    def inverse_dynamics_batch(
        self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike,
    ) -> FloatArray:
        """Return the efforts of many states; all arrays are (samples, n)."""
        return self.unchecked.inverse_dynamics_batch(**self._samples(q=q, v=v, a=a))

    def forward_dynamics(
        self, q: npt.ArrayLike, v: npt.ArrayLike, tau: npt.ArrayLike, wrenches: Wrenches = (),
    ) -> FloatArray:
        """
        Return the acceleration a, (n,), of M(q) a + C(q, v) v + g(q) + τ_friction − Jᵀ f = τ.

        A joint with dry friction whose velocity is exactly 0 stays at rest while a friction of at
        most F_s holds it (`stiction`); otherwise it breaks away against F_s. Articulated body
        algorithm (Featherstone 2008, section 7.3). Raises InvalidInputError also if M(q) is
        singular: a joint that moves no mass.
        """
        return self.unchecked.forward_dynamics(
            **self._vectors(q=q, v=v, tau=tau), wrenches=wrenches)

    def terms(
        self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike, wrenches: Wrenches = (),
    ) -> EffortTerms:
        """Return the terms of `inverse_dynamics`, each (n,) [N·m] or [N], and the energies [J]."""
        return self.unchecked.terms(**self._vectors(q=q, v=v, a=a), wrenches=wrenches)

    def friction_along(
        self, q: npt.ArrayLike, v: npt.ArrayLike, load: npt.ArrayLike,
    ) -> FloatArray:
        """
        Return the friction (samples, n) [N·m] or [N] along a motion, samples in order of time.

        Smooth around rest. If gears have a presliding distance, dry friction follows the
        displacement since the last velocity reversal (`presliding`).
        """
        return self.unchecked.friction_along(**self._samples(q=q, v=v, load=load))

    def _checked(
        self, check: Callable[[str, npt.ArrayLike, int, Sequence[str]], FloatArray],
        **values: npt.ArrayLike,
    ) -> dict[str, FloatArray]:
        """Return arrays of one shape that pass the check; raise InvalidInputError."""
        names = self.arm.joint_names
        arrays = {field: check(field, value, len(names), names) for field, value in values.items()}
        (first, expected), *others = arrays.items()
        for field, array in others:
            if array.shape != expected.shape:
                raise InvalidInputError(
                    f'{field} has the shape {array.shape}, expected {expected.shape} as {first} '
                    'has')
        return arrays

    _vectors = partialmethod(_checked, check_vector)
    _samples = partialmethod(_checked, check_samples)


class RigidBody(ArmDynamics):
    """The dynamics of the rigid bodies of one arm: those of the arm without friction."""

    def __init__(self, arm: ArmModel) -> None:
        super().__init__(arm.with_friction(make_friction(arm.joint_names)))
