# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The uncertainty of a model, and the standard deviation of the efforts that follow from it.

The effort of a model is linear in its parameters θ, τ = X(q, q̇, q̈) θ, except for friction that is
proportional to the load, whose derivative is in X. With the covariance Σ of θ, the covariance of τ
is X Σ Xᵀ. θ are inertial parameters of bodies (`regressor`), reflected inertias, friction and
offsets of the effort. Near rest, and beyond the recorded speeds, friction differs from its model;
this deviation is added. Parameters that are not named in the uncertainty count as exact, and so do
payloads.
"""

from collections.abc import Sequence
import math

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.friction import FRICTION_FIELDS, SMOOTHING_VELOCITY
from robot_dynamics.joints.friction_terms import smooth_sign
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.regressor import parameter_names, TorqueRegressor
from robot_dynamics.model.uncertainty import ModelUncertainty
from robot_dynamics.validation import (
    check_per_joint,
    check_scalar,
    check_unique,
    covariance_root,
    is_empty,
)

FRICTION_PARAMETERS = tuple(field.name for field in FRICTION_FIELDS if field.is_estimated)
EFFORT_OFFSET = 'effort_offset'
"""The effort of a drive at zero torque, which an identification finds next to friction."""
JOINT_PARAMETERS = ('Ia', *FRICTION_PARAMETERS, EFFORT_OFFSET)
"""Reflected inertia, friction and drive of a joint; a name is such as 'viscous(joint1)'."""
_FIELD = 'uncertainty'


def uncertain_names(arm: ArmModel) -> tuple[str, ...]:
    """Return the names of all parameters θ, such as 'mz(link1)' or 'viscous(joint1)'."""
    return (*parameter_names(arm), *(
        f'{name}({joint})' for name in JOINT_PARAMETERS for joint in arm.joint_names))


def make_uncertainty(
    arm: ArmModel, parameters: Sequence[str] = (), covariance: Sequence[float] = (),
    noise_deviation: npt.ArrayLike = (), noise_bandwidth: float = 0.0,
    friction_deviation: npt.ArrayLike = (), friction_velocity: npt.ArrayLike = (),
    largest_velocity: npt.ArrayLike = (),
) -> ModelUncertainty | None:
    """
    Return the checked uncertainty of an arm, None if nothing is given.

    `covariance` is the lower triangle, row by row, of the covariance of the named parameters.
    `noise_deviation` [N·m] or [N] is one number for all joints or one value per joint; it needs a
    `noise_bandwidth` [Hz] > 0. So is `friction_deviation`, which needs a `friction_velocity`
    [rad/s] or [m/s], and `largest_velocity` [rad/s] or [m/s], ∞ if it is empty. Raises
    InvalidInputError for an unknown name, another number of values, a value that is not finite, or
    a matrix that is not positive semidefinite.
    """
    if all(map(is_empty, (
            parameters, covariance, noise_deviation, friction_deviation, largest_velocity))):
        return None
    noise = _deviations(arm, 'noise_deviation', noise_deviation)
    if noise.any():
        check_scalar(
            f'{_FIELD}.noise_bandwidth', noise_bandwidth, 0.0, exclusive_minimum=True)
    friction = _deviations(arm, 'friction_deviation', friction_deviation)
    velocity = np.zeros(arm.joint_count)
    if friction.any():
        velocity = _deviations(arm, 'friction_velocity', friction_velocity, is_needed=True)
    largest = np.full(arm.joint_count, math.inf) if is_empty(largest_velocity) else _deviations(
        arm, 'largest_velocity', largest_velocity)
    return ModelUncertainty(
        _columns(arm, parameters),
        covariance_root(f'{_FIELD}.covariance', covariance, parameters), noise,
        noise_bandwidth or math.inf, friction, velocity, largest)


def _deviations(
    arm: ArmModel, name: str, values: npt.ArrayLike, is_needed: bool = False,
) -> FloatArray:
    """Return the checked values of all joints (n,), 0 if none are given."""
    if is_empty(values) and not is_needed:
        return np.zeros(arm.joint_count)
    checked = check_per_joint(f'{_FIELD}.{name}', values, arm.joint_names)
    for joint, value in zip(arm.joint_names, checked.tolist()):
        check_scalar(f'{_FIELD}.{name} of {joint!r}', value, 0.0)
    return checked


def _columns(arm: ArmModel, parameters: Sequence[str]) -> IntArray:
    known = {name: i for i, name in enumerate(uncertain_names(arm))}
    check_unique(f'{_FIELD}.parameters', parameters)
    for name in parameters:
        if name not in known:
            raise InvalidInputError(
                f'{_FIELD}.parameters has {name!r}, expected names such as '
                f'{next(iter(known))!r} or {next(reversed(known))!r}, with the links and joints '
                'of the arm')
    return np.array([known[name] for name in parameters], dtype=np.int64)


class EffortDeviation:
    """Standard deviations of the efforts of a model; for one thread, like `ArmDynamics`."""

    def __init__(self, dynamics: ArmDynamics, uncertainty: ModelUncertainty) -> None:
        self._dynamics, self._uncertainty = dynamics.unchecked, uncertainty
        self._regressor = TorqueRegressor(dynamics.arm)
        self._units = [self._dynamics.friction.unit(name) for name in FRICTION_PARAMETERS]

    def __call__(
        self, q: FloatArray, v: FloatArray, a: FloatArray, load: FloatArray | None = None,
        smooth: bool = False,
    ) -> FloatArray:
        """
        Return the deviation (n,) [N·m] or [N] of the effort of the model at a state, each (n,).

        `load` (n,) is the effort of the rigid bodies with external wrenches, None without
        wrenches. With `smooth`, dry friction has a smooth sign around rest, for measured states.
        """
        errors = self.errors(
            q[None], v[None], a[None], None if load is None else load[None], smooth)[0]
        return np.asarray(np.hypot(
            np.linalg.norm(errors, axis=1),
            self._uncertainty.friction(v, self._dynamics.friction.viscous)))

    def prediction(
        self, q: FloatArray, v: FloatArray, a: FloatArray, load: FloatArray | None = None,
    ) -> FloatArray:
        """Return the deviation (n,) of a measured effort: that of the model and of the noise."""
        return np.hypot(self(q, v, a, load), self._uncertainty.noise_deviation)

    def errors(
        self, q: FloatArray, v: FloatArray, a: FloatArray, load: FloatArray | None = None,
        smooth: bool = False,
    ) -> FloatArray:
        """
        Return what independent errors of deviation 1 add to the efforts, (m, n, k).

        All arguments are (m, n), as in a call. The covariance of an effort is the sum of the
        squares.
        """
        return np.asarray(self.derivatives(q, v, a, load, smooth) @ self._uncertainty.root)

    def derivatives(
        self, q: FloatArray, v: FloatArray, a: FloatArray, load: FloatArray | None = None,
        smooth: bool = False,
    ) -> FloatArray:
        """
        Return the derivatives (m, n, k) of the efforts by the uncertain parameters.

        All arguments are (m, n).
        """
        if load is None:
            load = self._dynamics.rigid_body.inverse_dynamics_batch(q, v, a)
        sign = smooth_sign(v, SMOOTHING_VELOCITY) if smooth else np.sign(v)
        # friction by the load multiplies all of the bodies
        per_load = self._dynamics.friction.smooth(v)[1]
        by_load = np.ones_like(v) if per_load is None else 1.0 + per_load * np.sign(load)
        bodies = by_load[..., np.newaxis] * self._regressor(q, v, a)
        joints = [column[..., np.newaxis] * np.eye(v.shape[1]) for column in (
            by_load * a, *(unit.effort(v, load, sign) for unit in self._units),
            np.ones_like(v))]
        return np.asarray(np.concatenate(
            [bodies, *joints], axis=2)[..., self._uncertainty.columns])
