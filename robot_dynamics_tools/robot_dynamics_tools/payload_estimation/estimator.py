# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Estimation of what is attached to a link, from measured minus modelled effort.

Recursive weighted least squares in information form: each sample is added once, memory and the
time of an estimate do not depend on the duration. Errors of the regressor are neglected, because
the noise of encoders is far below that of efforts; D. Kubus, T. Kröger, F. M. Wahl, "On-line
estimation of inertial parameters using a recursive total least-squares approach", IEEE/RSJ IROS
2008, include them for a force sensor and accelerometers.
"""

from dataclasses import replace

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.effort_deviation import EffortDeviation
from robot_dynamics.model.regressor import COUNT, LoadRegressor
from robot_dynamics.validation import LARGEST_VALUE
from robot_dynamics_tools.estimation import priors
from robot_dynamics_tools.payload_estimation.information import solve
from robot_dynamics_tools.payload_estimation.result import make_result, PayloadEstimate
from robot_dynamics_tools.payload_estimation.rows import (
    Column,
    COLUMNS,
    RowBuilder,
    SLIDING_VELOCITY,
)
from robot_dynamics_tools.payload_estimation.variance_groups import pair_rests

SHORTEST_BLOCK = 0.1
"""[s]"""
MOST_SAMPLES = 500
"""Samples that are processed together."""
_FRICTION_SMOOTHING = SLIDING_VELOCITY / 5.0


class PayloadEstimator:
    """
    Estimates the body on one link of an arm; for one thread.

    `arm` is the model without this body; its friction is subtracted from the measured effort.
    """

    def __init__(
        self, arm: ArmModel, link: str, cutoff_hz: float,
        scale_deviation: float | None = None,
    ) -> None:
        """
        Take samples that passed a low-pass filter with the cut-off `cutoff_hz` [Hz].

        `scale_deviation` is that of the effort scales, relative to them, unless the report of the
        arm has a covariance; 0 for exact scales and offsets. None is GIVEN_DEVIATION for an arm
        with a report, and SCALE_DEVIATION for drives that were not calibrated.

        Raises InvalidInputError for an unknown link.
        """
        if not cutoff_hz > 0.0:
            raise InvalidInputError(f'cutoff_hz is {cutoff_hz:g}, expected a number > 0')
        self.arm, self.link = arm, link
        self._scale_deviation = scale_deviation if scale_deviation is not None else (
            priors.SCALE_DEVIATION if arm.report is None else priors.GIVEN_DEVIATION)
        self._regressor = LoadRegressor(arm, link)
        dynamics = ArmDynamics(arm)
        self._dynamics = dynamics.unchecked
        self._model_errors: EffortDeviation | None = None
        columns = COLUMNS
        if arm.uncertainty is not None and arm.uncertainty.has_covariance:
            self._model_errors = EffortDeviation(dynamics, arm.uncertainty)
            columns += arm.uncertainty.root.shape[1]
        self._block = max(SHORTEST_BLOCK, 1.0 / cutoff_hz)
        self._independent_interval = 0.5 / cutoff_hz  # of band-limited white noise
        self._rows = RowBuilder(arm.joint_count, self._block, columns)
        self._position: FloatArray | None = None
        self._largest_effort = np.zeros(arm.joint_count)

    def restart(self) -> None:
        """Continue after a gap: the next sample has no relation to the previous one."""
        self._rows.restart()

    def add(
        self, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, effort: FloatArray,
    ) -> None:
        """
        Take filtered samples: times t (m,) [s], all others (m, n), in the order of time.

        `effort` [N·m] or [N] is measured, on the joint side of the gearbox, with gravity. Raises
        InvalidInputError if the model has no finite effort for a sample, and takes none of the
        MOST_SAMPLES around it and after them.
        """
        for begin in range(0, len(t), MOST_SAMPLES):
            part = slice(begin, begin + MOST_SAMPLES)
            rows = self._observations(q[part], v[part], a[part], effort[part])
            if not (np.abs(rows) < LARGEST_VALUE).all():
                raise InvalidInputError(
                    'the motion has an effort, velocity or acceleration beyond all bounds, '
                    f'expected numbers below {LARGEST_VALUE:g}')
            for sample in zip(t[part].tolist(), q[part], v[part], *rows):
                self._rows.add(*sample)
            self._position = q[part][-1]
            self._largest_effort = np.maximum(
                self._largest_effort, np.abs(effort[part]).max(axis=0))

    @np.errstate(over='ignore', invalid='ignore')
    def _observations(
        self, q: FloatArray, v: FloatArray, a: FloatArray, effort: FloatArray,
    ) -> FloatArray:
        """Return the rows (2, m, n, c) of joints that slide and that rest."""
        dynamics = self._dynamics
        rigid = dynamics.rigid_body.inverse_dynamics_batch(q, v, a)
        rows = np.zeros((2, *q.shape, self._rows.columns))
        rows[:, :, :, :COUNT] = self._regressor(q, v, a)
        rows[..., Column.VELOCITY], rows[..., Column.EFFORT] = v, effort
        rows[..., Column.SIGN], rows[..., Column.ONE] = np.tanh(v / _FRICTION_SMOOTHING), 1.0
        rows[..., Column.RIGID] = rigid
        friction = dynamics.friction
        rows[0, ..., Column.RESIDUAL] = friction.load_behind(v, effort, np.sign(v)) - rigid
        # at rest, dry friction is unknown
        rows[1, ..., Column.RESIDUAL] = friction.load_behind(
            np.zeros_like(v), effort, np.zeros_like(v)) - rigid
        if self._model_errors is not None:
            for row, velocity in zip(rows, (v, np.zeros_like(v))):
                row[..., COLUMNS:] = self._model_errors.errors(q, velocity, a)
        return rows

    def estimate(self, with_advice: bool = True) -> PayloadEstimate:
        """Return the estimate from all samples; `with_advice` costs about 0.1 s."""
        rows = self._rows.rows()
        rests = pair_rests(rows.rests, self._independent_interval)
        limit = self.arm.limits.effort
        scale = np.where(np.isfinite(limit) & (limit > 0.0), limit, np.maximum(
            self._largest_effort, 1.0))
        friction = self.arm.friction
        band = friction.at_rest.static + friction.load_coefficient * self._largest_effort
        report, prior = self.arm.given_report, 0.0
        if report.covariance is None:
            prior = self._scale_deviation
            report = replace(report, covariance=priors.unknown_drives(report.scale, scale, prior))
        solution = solve(rows, rests, band, scale, report.torque_error_covariance())
        return make_result(
            self.arm, self.link, solution, rows, rests, band, self._block, self._position,
            with_advice, prior)
