# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Derivatives of inverse and forward dynamics, and the discrete linear model of an arm at a state.

The derivatives of the rigid bodies are analytical: J. Carpentier, N. Mansard, "Analytical
derivatives of rigid body dynamics algorithms", RSS 2018. For actuated joints, q_tree = G q + q0,
they are Gᵀ D G. Dry friction has no derivative at rest: here its sign is tanh(v / ε), with the
smoothing velocity ε.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.dependencies import optional
from robot_dynamics.joints.friction import JointFriction, SMOOTHING_VELOCITY
from robot_dynamics.joints.friction_terms import smooth_sign
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.external_wrench import Wrenches
from robot_dynamics.model.unchecked_rigid_body import singular_mass_matrix, UncheckedRigidBody
from robot_dynamics.validation import check_scalar, check_vector

_STEP = 1e-6
"""Step of the differences of friction curves, relative to the width of the steepest curve."""
_TOLERANCE = 1e-10
"""Relative tolerance of the integration over a period."""


class EffortDerivatives(NamedTuple):
    """The effort τ (n,) of a state and acceleration, and its derivatives, (n, n) each."""

    effort: FloatArray
    position: FloatArray
    """∂τ/∂q [N·m/rad] and so on; column j is the derivative by joint j."""
    velocity: FloatArray
    """∂τ/∂q̇ [N·m·s/rad] and so on."""
    acceleration: FloatArray
    """∂τ/∂q̈: the mass matrix M(q), if no friction depends on the load."""


class AccelerationDerivatives(NamedTuple):
    """The acceleration q̈ (n,) of a state and effort, and its derivatives, (n, n) each."""

    acceleration: FloatArray
    position: FloatArray
    """∂q̈/∂q [1/s²] and so on."""
    velocity: FloatArray
    """∂q̈/∂q̇ [1/s] and so on."""
    effort: FloatArray
    """∂q̈/∂τ: M(q)⁻¹, if no friction depends on the load."""


class DiscreteModel(NamedTuple):
    """
    The state x = (q, q̇) (2n,) after one period under a constant effort, and its derivatives.

    Near the state and effort x⁺ = `state` + A Δx + B Δτ. At an equilibrium A and B are those of
    zero-order hold.
    """

    state: FloatArray
    A: FloatArray
    """∂x⁺/∂x (2n, 2n)."""
    B: FloatArray
    """∂x⁺/∂τ (2n, n)."""


class ArmDerivatives:
    """
    The derivatives of the dynamics of an arm with payloads, rotors and smooth friction.

    Vectors are (n,) in the order of `arm.joint_names`: q [rad] or [m], v and a its derivatives,
    tau [N·m] or [N]. External wrenches are constant in the frames of their links. Methods raise
    InvalidInputError for a wrong length, a value that is not finite, and a singular M(q).
    For one thread, because of Pinocchio's scratch memory.
    """

    def __init__(self, arm: ArmModel, smoothing_velocity: float = SMOOTHING_VELOCITY) -> None:
        """
        Dry friction is F tanh(v / ε), with ε = `smoothing_velocity` [rad/s] or [m/s] > 0.

        The default is that of the control laws (`JointFriction.smooth_effort`).
        """
        self.arm = arm
        self.smoothing_velocity = check_scalar(
            'smoothing_velocity', smoothing_velocity, 0.0, exclusive_minimum=True)
        self._body = UncheckedRigidBody(arm)
        self._model, self._data = arm.pinocchio_model, arm.pinocchio_model.createData()

    def __repr__(self) -> str:
        return f'<ArmDerivatives of {self.arm!r}, ε = {self.smoothing_velocity:g}>'

    def inverse_dynamics(
        self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike, wrenches: Wrenches = (),
    ) -> EffortDerivatives:
        """Return τ(q, v, a), with the smooth sign of dry friction, and its derivatives."""
        return self._inverse(
            self._vector('q', q), self._vector('v', v), self._vector('a', a), wrenches)

    def forward_dynamics(
        self, q: npt.ArrayLike, v: npt.ArrayLike, tau: npt.ArrayLike, wrenches: Wrenches = (),
    ) -> AccelerationDerivatives:
        """Return q̈(q, v, τ), with the smooth sign of dry friction, and its derivatives."""
        return self._forward(
            self._vector('q', q), self._vector('v', v), self._vector('tau', tau), wrenches)

    def discrete(
        self, q: npt.ArrayLike, v: npt.ArrayLike, tau: npt.ArrayLike, period: float,
        wrenches: Wrenches = (),
    ) -> DiscreteModel:
        """
        Return the state after `period` [s] under the constant effort, with A and B.

        A and B are the derivatives of the motion, not of a linear model that is constant over the
        period: the sensitivities Ṡ = f_x S + f_τ are integrated with the state (Dormand and
        Prince, order 8). Raises MissingDependencyError without scipy.
        """
        T = check_scalar('period', period, 0.0, exclusive_minimum=True)
        start = np.concatenate([self._vector('q', q), self._vector('v', v)])
        effort, n = self._vector('tau', tau), self.arm.joint_count
        columns = 3 * n + 1

        def rates(_: float, flat: FloatArray) -> FloatArray:
            y = flat.reshape(2 * n, columns)
            q, v, S = y[:n, 0], y[n:, 0], y[:, 1:]
            by = self._forward(q.copy(), v.copy(), effort, wrenches)
            rate = np.empty_like(y)
            rate[:n] = y[n:]
            rate[n:, 0] = by.acceleration
            rate[n:, 1:] = by.position @ S[:n] + by.velocity @ S[n:]
            rate[n:, 2 * n + 1:] += by.effort
            return rate.ravel()

        first = np.zeros((2 * n, columns))
        first[:, 0], first[:, 1:2 * n + 1] = start, np.eye(2 * n)
        solve = optional('scipy.integrate', 'a discrete model').solve_ivp
        end = solve(rates, (0.0, T), first.ravel(), method='DOP853', rtol=_TOLERANCE,
                    atol=_TOLERANCE * T).y[:, -1].reshape(2 * n, columns)
        return DiscreteModel(end[:, 0], end[:, 1:2 * n + 1], end[:, 2 * n + 1:])

    def _vector(self, field: str, value: npt.ArrayLike) -> FloatArray:
        names = self.arm.joint_names
        return check_vector(field, value, len(names), names)

    def _inverse(
        self, q: FloatArray, v: FloatArray, a: FloatArray, wrenches: Wrenches,
    ) -> EffortDerivatives:
        x = self.arm.coordinates
        state = x.position(q), x.rate(v), x.rate(a)
        forces = (self._body.joint_forces(wrenches),) if wrenches else ()
        tree = pin.computeRNEADerivatives(self._model, self._data, *state, *forces)
        load = x.effort(self._data.tau)
        by_q, by_v, by_a = (x.form(D) for D in tree)
        friction = self.arm.friction
        effort = friction.effort(v, load, smooth_sign(v, self.smoothing_velocity))
        slope, per_load = _slopes(friction, v, load, self.smoothing_velocity)
        # friction that is proportional to the load multiplies all of the bodies
        share = (1.0 + per_load * np.sign(load))[:, np.newaxis]
        return EffortDerivatives(
            load + effort, share * by_q, share * by_v + np.diag(slope), share * by_a)

    def _forward(
        self, q: FloatArray, v: FloatArray, tau: FloatArray, wrenches: Wrenches,
    ) -> AccelerationDerivatives:
        """Differentiate τ = ID(q, v, a(q, v, τ)): ∂a/∂τ = (∂τ/∂a)⁻¹, ∂a/∂q = −∂a/∂τ ∂τ/∂q."""
        load = self.arm.friction.load_behind(v, tau, smooth_sign(v, self.smoothing_velocity))
        a = self._body.forward_dynamics(q, v, load, wrenches)
        by = self._inverse(q, v, a, wrenches)
        try:
            inverse = np.asarray(np.linalg.inv(by.acceleration), dtype=np.float64)
        except np.linalg.LinAlgError:
            raise singular_mass_matrix(q) from None
        return AccelerationDerivatives(
            a, -inverse @ by.position, -inverse @ by.velocity, inverse)


def _slopes(
    friction: JointFriction, v: FloatArray, load: FloatArray, smoothing: float,
) -> tuple[FloatArray, FloatArray]:
    """
    Return the derivative of smooth friction by v at a constant load, and that by |load|; (n,).

    The curves of the terms, which are functions of v, are differentiated by central differences.
    """
    widths = friction.steep_below
    h = _STEP * np.min(np.where(widths > 0.0, widths, 1.0), axis=0)
    ahead, behind = v + h, v - h

    def curve(at: FloatArray) -> FloatArray:
        smooth, by_load = friction.smooth(at)
        if by_load is not None:
            smooth = smooth + by_load * np.abs(load)
        return smooth + friction.dry(at) * smooth_sign(v, smoothing)

    slope = (curve(ahead) - curve(behind)) / (ahead - behind)
    slope += friction.dry(v) * (1.0 - smooth_sign(v, smoothing)**2) / smoothing
    per_load = friction.smooth(v)[1]
    return slope, np.zeros_like(v) if per_load is None else per_load
