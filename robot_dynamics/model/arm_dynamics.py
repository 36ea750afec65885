# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The dynamics of an arm, which are those of its rigid bodies and of friction together.

τ = M(q) q̈ + C(q, q̇) q̇ + g(q) + τ_friction − Jᵀ f; τ is on the joint side of the gearbox.
Friction (`friction`) may depend on the load: the effort of the rigid bodies, M q̈ + C q̇ + g − Jᵀ
f.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.friction import SMOOTHING_VELOCITY
from robot_dynamics.joints.friction_terms import smooth_sign
from robot_dynamics.joints.presliding import presliding_state
from robot_dynamics.joints.stiction import choose_modes, hold
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.rigid_body import check_threads, ManipulatorEquation, RigidBody
from robot_dynamics.model.unchecked_rigid_body import singular_mass_matrix, UncheckedRigidBody


class EffortTerms(NamedTuple):
    """
    An effort by term, each (n,) [N·m] or [N], and the energies [J].

    effort = inertial + coriolis + gravity + friction + external. `inertial` is M(q) times an
    acceleration; that of a command contains the feedback (`control.laws.equation_terms`).
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
        self, q: FloatArray, v: FloatArray, a: FloatArray,
        wrenches: Sequence[ExternalWrench] = (),
    ) -> FloatArray:
        """
        Return the effort (n,) that produces the acceleration a at the state (q, v).

        At rest, any dry friction up to F_s is possible; it is assumed to be 0.
        """
        effort = self.rigid_body.inverse_dynamics(q, v, a, wrenches)
        return effort if self.is_frictionless else effort + self.friction_effort(v, effort)

    def inverse_dynamics_batch(
        self, q: FloatArray, v: FloatArray, a: FloatArray, threads: int = 1,
    ) -> FloatArray:
        """Return the efforts of many states; all arrays are (samples, n)."""
        effort = self.rigid_body.inverse_dynamics_batch(q, v, a, threads)
        return effort if self.is_frictionless else effort + self.friction_effort(v, effort)

    def friction_effort(
        self, v: FloatArray, load: FloatArray, smooth: bool = False,
    ) -> FloatArray:
        """
        Return the friction (..., n) at the velocity v.

        `load` (..., n) is the effort of the rigid bodies. `smooth` replaces the sign of v in dry
        friction by a sigmoid (`JointFriction.smooth_effort`).
        """
        return self.friction.smooth_effort(v, load) if smooth else self.friction.effort(v, load)

    def friction_along(
        self, q: FloatArray, v: FloatArray, load: FloatArray, state: FloatArray | None = None,
    ) -> FloatArray:
        """
        Return the friction (m, n) along a motion: m samples in the order of time.

        For measured motions: around rest the sign is smooth. If gears have a presliding distance,
        dry friction follows the displacement since the last velocity reversal
        (`presliding_state`), with `state` (n,) at the first sample.
        """
        sign = presliding_state(q, v, self.friction.presliding_distance, state)
        return self.friction.effort(v, load, sign)

    def forward_dynamics(
        self, q: FloatArray, v: FloatArray, tau: FloatArray,
        wrenches: Sequence[ExternalWrench] = (),
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
        self, q: FloatArray, v: FloatArray, tau: FloatArray, wrenches: Sequence[ExternalWrench],
    ) -> FloatArray:
        body, friction = self.rigid_body, self.friction
        M, sliding = body.mass_matrix(q), friction.dry(v)
        effort = friction.without_dry(v, tau) - body.nonlinear(q, v)
        if wrenches:
            effort = effort - body.external(q, wrenches)
        try:
            modes = choose_modes(M, v, effort, sliding, friction.breakaway)
            a = hold(M, effort - modes.direction * sliding, modes.stuck).acceleration
        except np.linalg.LinAlgError:
            a = np.full_like(effort, np.nan)
        if not np.isfinite(a).all():
            raise singular_mass_matrix(q)
        return a

    def terms(
        self, q: FloatArray, v: FloatArray, a: FloatArray,
        wrenches: Sequence[ExternalWrench] = (), friction: FloatArray | None = None,
    ) -> EffortTerms:
        """
        Return the effort of `inverse_dynamics` split by term, and the energies.

        `friction` (n,), if given, replaces the friction at the velocity v.
        """
        inertial, coriolis, gravity, external, *energies = self.rigid_body.terms(
            q, v, a, wrenches)
        if friction is None:
            load = inertial + coriolis + gravity + external
            friction = self.friction_effort(v, load)
        return EffortTerms(
            inertial, coriolis, gravity, friction, external,
            inertial + coriolis + gravity + friction + external, *energies)


class ArmDynamics(ManipulatorEquation):
    """
    Dynamics of an arm with friction: τ = M(q) q̈ + C(q, q̇) q̇ + g(q) + τ_friction − Jᵀ f.

    M, C, the Christoffel symbols and g are methods of `ManipulatorEquation`; its docstring states
    the accepted inputs and the units. `unchecked` has methods without checks, for control loops,
    and shares the scratch memory.
    """

    def __init__(self, arm: ArmModel) -> None:
        self.unchecked = UncheckedArmDynamics(arm)
        super().__init__(arm, self.unchecked.rigid_body)

    @cached_property
    def rigid_body(self) -> RigidBody:
        """The same arm without friction."""
        return RigidBody(self.arm)

    def inverse_dynamics(
        self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike,
        wrenches: Sequence[ExternalWrench] = (),
    ) -> FloatArray:
        """
        Return τ = M(q) a + C(q, v) v + g(q) + τ_friction − Jᵀ f, (n,) [N·m] or [N].

        At rest, any dry friction up to F_s is possible; it is assumed to be 0. Recursive
        Newton–Euler algorithm (Featherstone 2008, section 5.3).
        """
        return self.unchecked.inverse_dynamics(**self._vectors(q=q, v=v, a=a), wrenches=wrenches)

    def inverse_dynamics_batch(
        self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike, threads: int = 1,
    ) -> FloatArray:
        """
        Return the efforts of many states; all arrays are (samples, n).

        `threads` >= 1 share the work if Pinocchio was built with OpenMP.
        """
        return self.unchecked.inverse_dynamics_batch(
            **self._samples(q=q, v=v, a=a), threads=check_threads(threads))

    def forward_dynamics(
        self, q: npt.ArrayLike, v: npt.ArrayLike, tau: npt.ArrayLike,
        wrenches: Sequence[ExternalWrench] = (),
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
        self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike,
        wrenches: Sequence[ExternalWrench] = (), friction: npt.ArrayLike | None = None,
    ) -> EffortTerms:
        """
        Return the terms of `inverse_dynamics`, each (n,) [N·m] or [N], and the energies [J].

        `friction` (n,) replaces the friction at the velocity v.
        """
        return self.unchecked.terms(
            **self._vectors(q=q, v=v, a=a), wrenches=wrenches,
            friction=None if friction is None else self._vectors(friction=friction)['friction'])

    def friction_effort(
        self, v: npt.ArrayLike, load: npt.ArrayLike, smooth: bool = False,
    ) -> FloatArray:
        """
        Return the friction at the velocity v, [N·m] or [N].

        v and `load`, the effort of the rigid bodies M a + C v + g − Jᵀ f, are both (n,) or both
        (samples, n). With `smooth`, dry friction is a sigmoid of the velocity around rest.
        """
        return self.unchecked.friction_effort(**self._states(v=v, load=load), smooth=smooth)

    def friction_along(
        self, q: npt.ArrayLike, v: npt.ArrayLike, load: npt.ArrayLike,
        state: npt.ArrayLike | None = None,
    ) -> FloatArray:
        """
        Return the friction (samples, n) [N·m] or [N] along a motion, samples in order of time.

        Smooth around rest. If gears have a presliding distance, dry friction follows the
        displacement since the last velocity reversal (`presliding`), with the presliding state
        `state` (n,) at the first sample.
        """
        return self.unchecked.friction_along(
            **self._samples(q=q, v=v, load=load),
            state=None if state is None else self._vectors(state=state)['state'])


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
    gravity = body.inverse_dynamics_batch(q, zero, zero)
    nonlinear = body.inverse_dynamics_batch(q, v, zero)
    whole = body.inverse_dynamics_batch(q, v, a)
    momentum = body.inverse_dynamics_batch(q, zero, v) - gravity
    return TermSeries(
        inertial=whole - nonlinear,
        coriolis=nonlinear - gravity,
        gravity=gravity,
        friction=dynamics.unchecked.friction_along(q, v, whole),
        kinetic_energy=np.asarray(0.5 * np.einsum('ij,ij->i', v, momentum)),
        potential_energy=body.potential_energy_batch(q))
