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
Bilinear least squares of effort scales, offsets and gravity parameters.

The driver's effort at rest, without friction, is e_j = k_j (a_j + Y_j β) + o_j, with the known
gravity torque a, unknown gravity parameters β, offset o and k = 1 / s of the scale s. In s, s o
and β the equation s_j e_j − s_j o_j − Y_j β = a_j is linear, which gives the first values.
Gauss–Newton steps with the exact Jacobian then minimise the squares of the measured effort,
weighted by joint with the variance of its residual: G. A. F. Seber, C. J. Wild, *Nonlinear
Regression*, Wiley 1989, sections 2.1 and 2.8.8 (iteratively estimated weights).
"""

from dataclasses import dataclass, replace

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray

TYPICAL_SCALE_ERROR = 0.3
"""Standard deviation of 1/s about 1 that is assumed for a joint without observable scale."""
_STEPS, _ROUNDS = 30, 6
_CONVERGED = 1e-13
_SINGULAR = 1e-9
"""Relative singular value below which a combination of parameters is not determined."""
_LEAST_NOISE = 1e-10
"""Smallest standard deviation of the effort, relative to its largest value."""


@dataclass(frozen=True, eq=False)
class Observations:
    """
    P poses of n joints: measured `effort`, `known` torque, both (P, n), `columns` (P, n, k) of β.

    `is_used` (P, n) marks the equations.
    """

    effort: FloatArray
    known: FloatArray
    columns: FloatArray
    is_used: BoolArray

    def only(self, joints: BoolArray) -> 'Observations':
        """Return the equations of these joints (n,)."""
        return replace(self, is_used=self.is_used & joints)


@dataclass(frozen=True, eq=False)
class ScaleFit:
    """
    Inverse scale k (n,), offset o (n,) [N·m] or [N], and β (k,), with their covariance.

    The covariance is in the order k, o, β, infinite for what is not determined. `noise` (n,) is
    the standard deviation of the effort, `freedom` (n,) the degrees of freedom of this value;
    `condition` is the condition number of the weighted Jacobian with columns of length 1, of the
    combinations of parameters that it determines.
    """

    inverse: FloatArray
    offset: FloatArray
    beta: FloatArray
    covariance: FloatArray
    noise: FloatArray
    freedom: FloatArray
    condition: float

    @property
    def deviations(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the standard deviations of k, o and β."""
        n = len(self.inverse)
        all_of_them = np.sqrt(np.diag(self.covariance))
        return all_of_them[:n], all_of_them[n:2 * n], all_of_them[2 * n:]


def model_effort(
    inverse: FloatArray, offset: FloatArray, beta: FloatArray, seen: Observations,
) -> FloatArray:
    """Return the modelled effort (P, n) [N·m] or [N]."""
    return np.asarray(inverse * (seen.known + seen.columns @ beta) + offset)


def effort_jacobian(inverse: FloatArray, beta: FloatArray, seen: Observations) -> FloatArray:
    """Return the derivative (P, n, 2n + k) of the modelled effort by k, o and β."""
    P, n, count = seen.columns.shape
    J = np.zeros((P, n, 2 * n + count))
    joints = np.arange(n)
    J[:, joints, joints] = seen.known + seen.columns @ beta
    J[:, joints, n + joints] = 1.0
    J[:, :, 2 * n:] = inverse[:, None] * seen.columns
    return J


def fit_scales(seen: Observations, is_assumed: BoolArray) -> ScaleFit:
    """
    Return the fit.

    k is pulled to 1 with TYPICAL_SCALE_ERROR at the joints that `is_assumed` (n,) marks.
    """
    n, count = seen.columns.shape[1:]
    values = _first_values(seen)
    noise = np.ones(n)
    floor = _LEAST_NOISE * max(float(np.abs(seen.effort).max(initial=0.0)), 1e-3)
    rows = seen.is_used.sum(axis=0)
    for _ in range(_ROUNDS):
        J, singular = _minimise(seen, is_assumed, noise, values)
        basis, _, _ = _decomposed(J)
        leverage = (basis**2).sum(axis=1)[:seen.is_used.size].reshape(-1, n).sum(axis=0)
        freedom = rows - leverage
        squares = (_residual(seen, values)**2).sum(axis=0)
        noise = np.sqrt(squares / np.maximum(freedom, 1.0))
        noise = np.maximum(noise, floor)
    J = _weighted_jacobian(seen, is_assumed, noise, values)
    return ScaleFit(
        values[:n], values[n:2 * n], values[2 * n:], _covariance(J), noise, freedom,
        _condition(singular))


def _first_values(seen: Observations) -> FloatArray:
    """Return k, o and β of the linear equation, with a weak pull of s to 1."""
    P, n, count = seen.columns.shape
    A = np.zeros((P, n, 2 * n + count))
    joints = np.arange(n)
    A[:, joints, joints] = seen.effort
    A[:, joints, n + joints] = -1.0
    A[:, :, 2 * n:] = -seen.columns
    used = seen.is_used.ravel()
    weak = 1e-6 * max(float(np.abs(seen.effort).max(initial=0.0)), 1e-3)
    pull = np.zeros((n, 2 * n + count))
    pull[joints, joints] = weak
    x = np.linalg.lstsq(
        np.concatenate([A.reshape(-1, 2 * n + count)[used], pull]),
        np.concatenate([seen.known.ravel()[used], np.full(n, weak)]), rcond=1e-12)[0]
    scale = np.where(np.abs(x[:n]) > 0.1, x[:n], 1.0)
    return np.concatenate([1.0 / scale, x[n:2 * n] / scale, x[2 * n:]])


def _residual(seen: Observations, values: FloatArray) -> FloatArray:
    """Return measured − modelled effort (P, n), 0 where not used."""
    n = seen.effort.shape[1]
    model = model_effort(values[:n], values[n:2 * n], values[2 * n:], seen)
    return np.where(seen.is_used, seen.effort - model, 0.0)


def _weighted_jacobian(
    seen: Observations, is_assumed: BoolArray, noise: FloatArray, values: FloatArray,
) -> FloatArray:
    """Return the rows of all equations, (P n + n, 2n + k), and of the assumed scales."""
    n = len(noise)
    J = effort_jacobian(values[:n], values[2 * n:], seen) / noise[:, None]
    J *= seen.is_used[:, :, None]
    pull = np.zeros((n, J.shape[2]))
    pull[np.arange(n), np.arange(n)] = is_assumed / TYPICAL_SCALE_ERROR
    return np.concatenate([J.reshape(-1, J.shape[2]), pull])


def _minimise(
    seen: Observations, is_assumed: BoolArray, noise: FloatArray, values: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Change `values` to the least squares; return Jacobian and singular values there."""
    n = len(noise)
    for _ in range(_STEPS):
        J = _weighted_jacobian(seen, is_assumed, noise, values)
        r = np.concatenate([
            (_residual(seen, values) / noise).ravel(),
            is_assumed / TYPICAL_SCALE_ERROR * (1.0 - values[:n])])
        basis, singular, back = _decomposed(J)
        step = back @ (basis.T @ r)
        values += step
        if (np.abs(step) <= _CONVERGED * (1.0 + np.abs(values))).all():
            break
    return J, singular


def _decomposed(J: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return U, all singular values, and S V Σ⁻¹ of the determined part of J S = U Σ Vᵀ."""
    norm = np.linalg.norm(J, axis=0)
    scale = np.divide(1.0, norm, out=np.zeros_like(norm), where=norm > 0.0)
    U, singular, Vt = np.linalg.svd(J * scale, full_matrices=False)
    kept = singular > _SINGULAR * singular[0]
    return U[:, kept], singular, scale[:, None] * Vt[kept].T / singular[kept]


def _covariance(J: FloatArray) -> FloatArray:
    """Return the covariance; infinite variances for parameters that J does not determine."""
    norm = np.linalg.norm(J, axis=0)
    _, singular, back = _decomposed(J)
    covariance = back @ back.T
    scale = np.divide(1.0, norm, out=np.zeros_like(norm), where=norm > 0.0)
    Vt = np.linalg.svd(J * scale, full_matrices=True)[2]
    lost = Vt[(singular > _SINGULAR * singular[0]).sum():]
    is_lost = (norm == 0.0) | (np.abs(lost) > 1e-5).any(axis=0)
    covariance[is_lost] = covariance[:, is_lost] = 0.0
    covariance[is_lost, is_lost] = np.inf
    return np.asarray(covariance)


def linear_fit(
    A: FloatArray, b: FloatArray, covariance: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """
    Return the least squares x of A x = b, and standard deviations, infinite if not determined.

    b (m,) has this covariance (m, m); entries with an infinite variance are left out.
    """
    known = np.isfinite(np.diag(covariance))
    variance, axes = np.linalg.eigh(covariance[np.ix_(known, known)])
    rows = axes.T / np.sqrt(np.maximum(variance, 1e-12 * variance[-1]))[:, None]
    whitened = rows @ A[known]
    basis, _, back = _decomposed(whitened)
    return np.asarray(back @ (basis.T @ (rows @ b[known]))), np.sqrt(
        np.diag(_covariance(whitened)))


def _condition(singular: FloatArray) -> float:
    kept = singular[singular > _SINGULAR * singular[0]]
    return float(kept[0] / kept[-1]) if kept.size else float('inf')
