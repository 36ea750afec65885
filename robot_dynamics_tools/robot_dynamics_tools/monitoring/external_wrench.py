# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The external wrench on a link, from the external effort on the joints.

An external wrench F on a frame with the Jacobian J causes the joint efforts r = Jᵀ F, and

    F = (J J^T + λ² I)^-1 J r

is the estimate of the damped pseudo-inverse (C. W. Wampler, IEEE Trans. Systems, Man, and
Cybernetics 16(1), 1986). The rows of J differ in their units, and so do efforts of revolute and
prismatic joints. Therefore F is measured by the largest wrench that is expected, D⁻¹ F with D =
diag(F_max, F_max, F_max, T_max, T_max, T_max), and r by its own deviation, L⁻¹ r with the
covariance L Lᵀ of r: J becomes D J L⁻ᵀ. Now λ = 1 makes F the mean, and

    D (J J^T + λ² I)^-1 D

the covariance, of a wrench with the deviations F_max and T_max before the measurement (linear
Gaussian estimation). The mean square of an error does not exceed this covariance for any wrench
up to F_max and T_max: noise and the shrinkage of the estimate together. In directions in which
the singular value of J is below 1, the measurement says less than this assumption: they are not
observable.
"""

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.effort_deviation import EffortDeviation
from robot_dynamics.monitoring.external_effort import ExternalEffort
from robot_dynamics.validation import check_scalar

LARGEST_FORCE, LARGEST_TORQUE = 100.0, 10.0
"""[N], [N·m]"""
AVERAGE = 0.2
"""Time constant [s] of the mean external effort that becomes the bias."""
_EXACT = 1e-3
"""Least deviation of a joint's effort, as a fraction of the largest one of all joints."""


class WrenchEstimate(NamedTuple):
    """
    A wrench on a frame, at its origin and in its axes: force [N], then torque [N·m].

    `wrench` is (6,). `covariance` (6, 6) needs an uncertainty of the arm, else None. The rows of
    `unobservable` (k, 6) are wrenches of the largest expected size in the directions that the
    joint efforts do not determine; the estimate has hardly a part there, and the covariance has
    the expected one.
    """

    wrench: FloatArray
    covariance: FloatArray | None
    unobservable: FloatArray


class _Error(NamedTuple):
    """An effort (n,), the errors by `EffortDeviation.errors` (n, k), other variance (n,)."""

    effort: FloatArray
    parameters: FloatArray
    variance: FloatArray


class ExternalWrenchEstimator:
    """
    Estimates the external wrench on a frame from the external effort of an observer.

    Without an uncertainty of the arm, each joint effort counts as uncertain by 1 N·m or 1 N.
    """

    def __init__(
        self, dynamics: ArmDynamics, observer: ExternalEffort, frame: str,
        largest_force: float = LARGEST_FORCE, largest_torque: float = LARGEST_TORQUE,
    ) -> None:
        """
        Estimate at the origin of the link `frame`, in its axes.

        `largest_force` [N] and `largest_torque` [N·m] > 0 are the largest expected ones; see the
        module. Raises InvalidInputError for an unknown link, and for other numbers.
        """
        dynamics.arm.link_frame(frame, 'external_wrench.frame')
        self.frame, self._observer = frame, observer
        self._scale = np.repeat([check_scalar(
            f'external_wrench.{name}', value, 0.0, exclusive_minimum=True) for name, value in (
                ('largest_force', largest_force), ('largest_torque', largest_torque))], 3)
        self._model, self._x = dynamics.arm.pinocchio_model, dynamics.arm.coordinates
        self._data = self._model.createData()
        self._id = self._model.getFrameId(frame, pin.FrameType.BODY)
        self._bias: _Error | None = None
        self.restart()
        self.set_dynamics(dynamics)

    def set_dynamics(self, dynamics: ArmDynamics) -> None:
        """Continue with another load of the same arm."""
        uncertainty = dynamics.arm.uncertainty
        self._viscous, self._uncertainty = dynamics.arm.friction.viscous, uncertainty
        self._deviation = None if uncertainty is None else EffortDeviation(dynamics, uncertainty)

    def restart(self) -> None:
        """Forget the mean effort, after a restart of the observer; the bias remains."""
        self._mean: _Error | None = None
        self._duration = 0.0

    def zero(self) -> None:
        """
        Subtract the present mean effort of the last 0.2 s as bias from now on.

        Raises InvalidInputError until the observer has settled and 1 s has passed.
        """
        needed = 1.0 + 5.0 / self._observer.gain
        mean = self._mean
        if mean is None or self._duration < needed:
            raise InvalidInputError(
                f'the external wrench has been estimated for {self._duration:.1f} s, expected at '
                f'least {needed:.1f} s in a row (it is estimated while it has a subscriber)')
        self._bias = mean

    def jacobian(self, q: FloatArray) -> FloatArray:
        """Return J (6, n) of the frame, in its axes: linear velocity first."""
        return self._x.jacobian(pin.computeFrameJacobian(
            self._model, self._data, self._x.position(q), self._id, pin.LOCAL))

    def update(self, dt: float) -> WrenchEstimate | None:
        """Return the estimate after an update of the observer by dt [s]; None before the first."""
        state = self._observer.state
        if state is None:
            return None
        parameters, variance = self._model_error(*state)
        now = _Error(
            self._observer.estimate, parameters,
            variance + self._noise(dt, self._observer.noise_bandwidth))
        mean = now.effort if self._mean is None else self._mean.effort - math.expm1(
            -dt / AVERAGE) * (now.effort - self._mean.effort)
        self._mean = _Error(mean, parameters, variance + self._noise(dt, 0.25 / AVERAGE))
        self._duration += dt
        if self._bias is not None:
            now = _Error(
                now.effort - self._bias.effort, now.parameters - self._bias.parameters,
                now.variance + self._bias.variance)
        return self._estimate(self.jacobian(state[0]), now)

    def _model_error(
        self, q: FloatArray, v: FloatArray, a: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the errors by the parameters (n, k), and the variance of friction (n,)."""
        if self._uncertainty is None or self._deviation is None:
            return np.zeros((len(q), 0)), np.zeros(len(q))
        return (self._deviation.errors(q[None], v[None], a[None], smooth=True)[0],
                self._uncertainty.friction(v, self._viscous)**2)

    def _noise(self, dt: float, bandwidth: float) -> FloatArray | float:
        """Return the variance (n,) of the effort noise behind a filter of this bandwidth [Hz]."""
        return 0.0 if self._uncertainty is None else self._uncertainty.noise(bandwidth, dt)**2

    def _estimate(self, J: FloatArray, error: _Error) -> WrenchEstimate:
        covariance = error.parameters @ error.parameters.T + np.diag(error.variance)
        largest = float(covariance.diagonal().max())
        is_known = largest > 0.0
        L = np.linalg.cholesky(
            covariance + _EXACT**2 * largest * np.eye(len(covariance)) if is_known else
            np.eye(len(covariance)))
        scaled = np.linalg.solve(L, (self._scale[:, None] * J).T)
        squares, U = np.linalg.eigh(scaled.T @ scaled)
        root = self._scale[:, None] * U  # D U
        gain = root / (squares + 1.0)
        wrench = gain @ (U.T @ (scaled.T @ np.linalg.solve(L, error.effort)))
        return WrenchEstimate(wrench, gain @ root.T if is_known else None, root.T[squares < 1.0])
