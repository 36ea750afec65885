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
From a filtered motion to the rows of a regression, and their reduction to `Information`.

Each bag passes through here twice: first with the load of the URDF and all samples alike; then
with the load of the model that was found, and with less weight for samples that it cannot explain
(P. J. Huber, *Robust Statistics*, Wiley 1981), such as a contact.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from robot_dynamics.arm_model import ArmModel
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.friction_columns import COLUMN_NAMES, INERTIA, joint_columns, SHARP
from robot_dynamics.information import Information, reduce_rows
from robot_dynamics.motion_filter import filter_like, FilteredMotion, samples_a_sample
from robot_dynamics.pulled_least_squares import Fit
from robot_dynamics.regressor import inertial_parameters, parameter_names, TorqueRegressor
from robot_dynamics.validation import FloatArray

HUBER = 4.0
"""Standard deviations, by the median, beyond which a residual counts less."""
_NORMAL = 1.4826
_MOST_LAGS = 2000


class MotionParts(NamedTuple):
    """Samples of a motion to train with and to test with, by their numbers."""

    train: slice
    test: slice


@dataclass(frozen=True, eq=False)
class Rows:
    """
    A regression: `X` (m, n, p + own) and `y` (m, n), with τ = X θ.

    The first p columns are those of the bodies' parameters, the rest the joints' own.
    """

    X: FloatArray
    y: FloatArray
    body_columns: int

    def model(self, fit: Fit) -> FloatArray:
        """Return the efforts (m, n) of a fit."""
        n = self.X.shape[1]
        theta = np.concatenate([
            np.broadcast_to(fit.parameters, (n, self.body_columns)), fit.joint_values], axis=1)
        return np.asarray(np.einsum('mjk,jk->mj', self.X, theta, optimize=True))


def parts_of(motion: FilteredMotion, train_fraction: float) -> MotionParts:
    """Return the first share of the samples to train with, the rest to test with."""
    m = len(motion.stamps_ns)
    count = int(train_fraction * m)
    return MotionParts(slice(0, count), slice(count, m))


def regression_rows(
    arm: ArmModel, motion: FilteredMotion, reference: Fit | None = None, is_filtered: bool = False,
) -> Rows:
    """
    Return the regression of a motion of the arm's joints, in its order.

    `reference` is the model whose load presses on the gears, with its rotors, as inverse dynamics
    has it; None takes the arm. With `is_filtered`, sharp friction passes the filter of the motion,
    as the effort did: for estimates without a bias. What a payload of the arm takes is subtracted
    from y. Raises RecordingError where no effort was recorded.
    """
    if motion.effort is None:
        raise RecordingError('the recording has no effort, expected the measured effort')
    q, v, a = motion.position, motion.velocity, motion.acceleration
    Y = TorqueRegressor(arm)(q, v, a)
    bare = inertial_parameters(bare_arm(arm))
    of_payload = Y @ (inertial_parameters(arm) - bare)
    load = of_payload + (Y @ bare if reference is None else (
        Y @ reference.parameters + reference.joint_values[:, INERTIA] * a))
    starts = [0, *(np.flatnonzero(np.diff(motion.segment)) + 1).tolist()]
    own = joint_columns(arm.joint_kinds, q, v, a, load, starts)
    if is_filtered:
        own[:, :, SHARP] = filter_like(motion, own[:, :, SHARP].reshape(len(q), -1)).reshape(
            own[:, :, SHARP].shape)
    return Rows(
        np.concatenate([Y, own], axis=2), motion.effort - of_payload, Y.shape[2])


def bare_arm(arm: ArmModel) -> ArmModel:
    """Return the arm without its payloads."""
    return arm.with_payloads(())


def column_names(arm: ArmModel) -> tuple[str, ...]:
    """Return the names of the columns of X."""
    return (*parameter_names(arm), *COLUMN_NAMES)


def reduce_motion(
    arm: ArmModel, motion: FilteredMotion, train_fraction: float, reference: Fit | None = None,
) -> Information:
    """
    Return what the training samples of one recording say.

    With a `reference`, found in a first pass, its load presses on the gears, and samples far from
    it count less. Raises RecordingError without effort, or with too few samples.
    """
    rows = regression_rows(arm, motion, reference, is_filtered=True)
    train = parts_of(motion, train_fraction).train
    usable = np.flatnonzero(motion.usable[train])
    X, y = rows.X[usable], rows.y[usable]
    n = y.shape[1]
    independent = np.full(n, samples_a_sample(motion.cutoff_hz, motion.sample_rate_hz))
    if reference is not None:
        residual = (rows.y - rows.model(reference))[usable]
        independent = np.maximum(independent, [
            correlation_time(residual[:, j]) for j in range(n)])
        root = np.sqrt(huber_weights(residual))
        X, y = X * root[:, :, np.newaxis], y * root
    gap = int(np.ceil(motion.sample_rate_hz / motion.cutoff_hz))
    return reduce_rows(arm.joint_names, column_names(arm), X, y, gap, independent)


def huber_weights(residual: FloatArray) -> FloatArray:
    """Return the weights (m, n) of residuals: 1, and less beyond `HUBER` standard deviations."""
    sigma = _NORMAL * np.median(np.abs(residual), axis=0)
    size = np.abs(residual)
    return np.asarray(np.minimum(1.0, HUBER * sigma / np.maximum(size, 1e-300)))


def correlation_time(residual: FloatArray) -> float:
    """
    Return how many samples of a residual (m,) count as one: 1 + 2 Σ ρ_k.

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
