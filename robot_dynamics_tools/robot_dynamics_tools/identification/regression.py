# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The rows of a regression from a filtered motion, and their reduction to `QrInformation`.

Each recording is reduced twice: first with the load of the URDF and equal weights of all samples;
then with the load of the first model, and with lower weights for samples that this model does not
explain (P. J. Huber, *Robust Statistics*, Wiley 1981), such as a contact.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.regressor import inertial_parameters, parameter_names, TorqueRegressor
from robot_dynamics_tools.analysis.motion_filter import (
    filter_like,
    FilteredMotion,
    samples_per_independent_sample,
)
from robot_dynamics_tools.identification import friction_regressor
from robot_dynamics_tools.identification.friction_regressor import excitation_of
from robot_dynamics_tools.identification.qr_information import QrInformation, reduce_rows
from robot_dynamics_tools.identification.regularized_fit import Fit, without_memory

HUBER = 4.0
"""Standard deviations, from the median, beyond which a residual has a lower weight."""
SAMPLES_A_PERIOD = 5.0
"""Smallest number of samples that are kept per period of the cut-off frequency."""
_PART = 2000
_NORMAL = 1.4826
_MOST_LAGS = 2000


def train_count(motion: FilteredMotion, train_fraction: float) -> int:
    """Return the number of the first samples that are for training; the rest is for the test."""
    return int(train_fraction * len(motion.stamps_ns))


def model_effort(arm: ArmModel, motion: FilteredMotion, fit: Fit) -> tuple[FloatArray, FloatArray]:
    """
    Return the efforts (m, n) of a fit along a motion, and for single states, with the payload.

    The efforts for single states use the sign of velocity instead of the state of presliding.
    """
    _, rigid = _payload_and_load(arm, motion, fit.parameters)
    own = _own_columns(arm, motion, rigid, fit)
    along, single = (rigid + np.einsum('mjk,jk->mj', own, each.joint_values)
                     for each in (fit, without_memory(fit)))
    return along, single


def _own_columns(
    arm: ArmModel, motion: FilteredMotion, rigid: FloatArray, reference: Fit | None,
) -> FloatArray:
    """Return the columns of the joints for a load of rigid bodies, and rotors of a reference."""
    load = rigid if reference is None else rigid + motion.acceleration * (
        reference.joint_values[:, friction_regressor.INERTIA])
    starts = [0, *(np.flatnonzero(np.diff(motion.segment)) + 1).tolist()]
    return friction_regressor.joint_columns(arm.joint_kinds, *motion.state(), load, starts)


def _payload_and_load(
    arm: ArmModel, motion: FilteredMotion, parameters: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the effort (m, n) of the payloads, and that of bodies φ (p,) with them."""
    extra = inertial_parameters(arm) - inertial_parameters(arm.with_payloads(()))
    payload = _of_bodies(arm, motion, extra) if extra.any() else np.zeros_like(motion.position)
    return payload, payload + _of_bodies(arm, motion, parameters)


def _of_bodies(arm: ArmModel, motion: FilteredMotion, parameters: FloatArray) -> FloatArray:
    """Return Y φ (m, n), computed in parts, because Y of a long motion exceeds the memory."""
    regressor = TorqueRegressor(arm)
    efforts = np.empty_like(motion.position)
    for first in range(0, len(efforts), _PART):
        part = slice(first, first + _PART)
        efforts[part] = regressor(*motion.state(part)) @ parameters
    return efforts


def decimation(motion: FilteredMotion) -> int:
    """
    Return the decimation step: every step-th sample contains the information of all samples.

    The filter removes all frequencies beyond a few times its cut-off (Gautier's parallel
    decimation).
    """
    return max(1, int(motion.sample_rate_hz / (SAMPLES_A_PERIOD * motion.cutoff_hz)))


def reduce_motion(
    arm: ArmModel, motion: FilteredMotion, train_fraction: float, reference: Fit | None = None,
    keeps_payload: bool = False,
) -> QrInformation:
    """
    Return the information in the training samples of one recording.

    With a `reference`, the model of a first pass, the load of the gears is that of this model, and
    samples with a large residual have lower weights. The effort of a payload of the arm is
    subtracted from the measured one, or with `keeps_payload` is the column PAYLOAD. Raises
    RecordingError without effort, InvalidInputError without samples.
    """
    step, count = decimation(motion), train_count(motion, train_fraction)
    of_payload, load = _payload_and_load(arm, motion, (
        inertial_parameters(arm.with_payloads(())) if reference is None else reference.parameters))
    own = _own_columns(arm, motion, load, reference)
    # sharp friction passes the filter of the measured effort, which avoids a bias
    sharp = own[:, :, friction_regressor.SHARP]
    own[:, :, friction_regressor.SHARP] = filter_like(
        motion, sharp.reshape(len(sharp), -1)).reshape(sharp.shape)
    if keeps_payload:
        own[:, :, friction_regressor.PAYLOAD] = of_payload
    rows = np.arange(0, count, step)
    rows = rows[motion.usable[rows]]
    y = motion.measured_effort[rows] - (0.0 if keeps_payload else of_payload[rows])
    X = np.concatenate([TorqueRegressor(arm)(*motion.state(rows)), own[rows]], axis=2)
    n = y.shape[1]
    rate = motion.sample_rate_hz / step
    independent = np.full(n, max(
        1.0, samples_per_independent_sample(motion.cutoff_hz, motion.sample_rate_hz) / step))
    if reference is not None:
        residual = y - np.einsum('mjk,jk->mj', X, reference.theta, optimize=True)
        independent = np.maximum(independent, [correlation_time(residual[:, j]) for j in range(n)])
        root = np.sqrt(huber_weights(residual))
        X, y = X * root[:, :, np.newaxis], y * root
    gap = int(np.ceil(rate / motion.cutoff_hz))
    return reduce_rows(
        arm.joint_names, (*parameter_names(arm), *friction_regressor.COLUMN_NAMES), X, y, gap,
        independent, excitation_of(motion, arm.joint_kinds, count), step)


def huber_weights(residual: FloatArray) -> FloatArray:
    """Return the weights (m, n) of residuals: 1, but lower beyond `HUBER` deviations."""
    sigma = _NORMAL * np.median(np.abs(residual), axis=0)
    size = np.abs(residual)
    return np.asarray(np.minimum(1.0, HUBER * sigma / np.maximum(size, 1e-300)))


def correlation_time(residual: FloatArray) -> float:
    """
    Return the number of samples of a residual (m,) that count as one: 1 + 2 Σ ρ_k.

    The sum of autocorrelations ends where two neighbours add up to less than 0 (C. J. Geyer,
    "Practical Markov chain Monte Carlo", Statistical Science 7(4), 1992).
    """
    x = residual - residual.mean()
    m = len(x)
    power = float(x @ x)
    if power == 0.0:
        return 1.0
    spectrum = np.fft.rfft(x, 2 * m)
    rho = np.fft.irfft(np.abs(spectrum)**2)[:min(m, _MOST_LAGS)] / power
    pairs = rho[:len(rho) // 2 * 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs < 0.0)
    last = int(ends[0]) if len(ends) else len(pairs)
    return float(max(2.0 * pairs[:last].sum() - 1.0, 1.0))
