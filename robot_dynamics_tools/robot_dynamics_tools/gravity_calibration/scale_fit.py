# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Bilinear least squares of effort scales, offsets and gravity parameters.

The driver's effort at rest, without friction, is e_j = k_j (a_j + Y_j β) + o_j, with the known
gravity torque a, unknown gravity parameters β, offset o and k = 1 / s of the scale s. In s, s o
and β the equation s_j e_j − s_j o_j − Y_j β = a_j is linear, which gives the first values.
Gauss–Newton steps with the exact Jacobian then minimise the squares of the measured effort,
weighted by joint with the variance of its residual: G. A. F. Seber, C. J. Wild, *Nonlinear
Regression*, Wiley 1989, sections 2.1 and 2.8.8 (iteratively estimated weights).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics_tools.estimated_weights import estimated_weights
from robot_dynamics_tools.least_squares import decomposed, LOST
from robot_dynamics_tools.unknown_drives import SCALE_DEVIATION

_STEPS, _ROUNDS = 30, 6
_CONVERGED = 1e-13
_ROUNDING = 1e-12
"""Size of a column, relative to the largest one, below which it consists of rounding errors."""
_UNLIMITED = 1e9
"""Degrees of freedom of what is not estimated from residuals."""
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


class Spread(NamedTuple):
    """Standard deviations and half widths of the 95 % intervals; infinite if not determined."""

    deviation: FloatArray
    interval: FloatArray


@dataclass(frozen=True, eq=False)
class ScaleFit:
    """
    Inverse scale k (n,), offset o (n,) [N·m] or [N], and β (k,).

    `noise` (n,) is the standard deviation of the effort. `parts` (n + 1, 2n + k, 2n + k) are the
    parts of the covariance of k, o and β, in this order, due to the noise of each joint, and the
    assumed scales; `freedom` (n + 1,) are the degrees of freedom of their noise, `is_lost`
    (2n + k,) marks what is not determined. `condition` is the condition number of the weighted
    Jacobian with columns of length 1, of the combinations of parameters that it determines.
    """

    inverse: FloatArray
    offset: FloatArray
    beta: FloatArray
    noise: FloatArray
    parts: FloatArray
    freedom: FloatArray
    is_lost: BoolArray
    condition: float

    @property
    def covariance(self) -> FloatArray:
        """Return the covariance (2n + k, 2n + k), without what is not determined."""
        return np.asarray(self.parts.sum(axis=0))

    def spread(self, combinations: FloatArray) -> Spread:
        """Return the spread of combinations (c, 2n + k) of k, o and β."""
        C = combinations
        variances = np.einsum('ck,jkl,cl->jc', C, self.parts, C, optimize=True)
        total = variances.sum(axis=0)
        share = np.divide(variances, total, out=np.zeros_like(variances), where=total > 0.0)
        factor, quantile = estimated_weights(share, self.freedom)
        deviation = np.sqrt(total) * factor
        interval = deviation * quantile
        is_lost = (np.abs(C[:, self.is_lost]) > LOST).any(axis=1)
        return Spread(np.where(is_lost, np.inf, deviation), np.where(is_lost, np.inf, interval))


def model_effort(
    inverse: FloatArray, offset: FloatArray, beta: FloatArray, seen: Observations,
) -> FloatArray:
    """Return the modelled effort (P, n) [N·m] or [N]."""
    return np.asarray(inverse * (seen.known + seen.columns @ beta) + offset)


def effort_jacobian(inverse: FloatArray, beta: FloatArray, seen: Observations) -> FloatArray:
    """Return the derivative (P, n, 2n + k) of the modelled effort by k, o and β."""
    return joint_columns(seen.known + seen.columns @ beta, 1.0, inverse[:, None] * seen.columns)


def joint_columns(of_scale: FloatArray, of_offset: float, of_beta: FloatArray) -> FloatArray:
    """
    Return equations (P, n, 2n + k), in which each joint has separate columns.

    Their coefficients are `of_scale` (P, n) and `of_offset` for the scale and the offset of the
    joint, and `of_beta` (P, n, k) for the parameters of all joints.
    """
    P, n, count = of_beta.shape
    A = np.zeros((P, n, 2 * n + count))
    joints = np.arange(n)
    A[:, joints, joints] = of_scale
    A[:, joints, n + joints] = of_offset
    A[:, :, 2 * n:] = of_beta
    return A


def fit_scales(seen: Observations, assumed: FloatArray) -> ScaleFit:
    """
    Return the fit.

    k is pulled to `assumed` (n,) with SCALE_DEVIATION, and is free where that is NaN.
    """
    n = seen.effort.shape[1]
    values = _first_values(seen)
    noise = np.ones(n)
    floor = _LEAST_NOISE * max(float(np.abs(seen.effort).max(initial=0.0)), 1e-3)
    rows = seen.is_used.sum(axis=0)
    for _ in range(_ROUNDS):
        _minimise(seen, assumed, noise, values)
        basis = decomposed(_weighted_jacobian(seen, assumed, noise, values)).basis
        leverage = (basis**2).sum(axis=1)[:seen.is_used.size].reshape(-1, n).sum(axis=0)
        freedom = np.maximum(rows - leverage, 1.0)
        squares = (_residual(seen, values)**2).sum(axis=0)
        noise = np.maximum(np.sqrt(squares / freedom), floor)
    basis, back, is_lost, condition = decomposed(_weighted_jacobian(seen, assumed, noise, values))
    joint = np.append(np.tile(np.arange(n), len(seen.effort)), np.full(n, n))
    parts = np.array([
        back @ (basis[joint == j].T @ basis[joint == j]) @ back.T for j in range(n + 1)])
    return ScaleFit(
        values[:n], values[n:2 * n], values[2 * n:], noise, parts,
        np.append(freedom, _UNLIMITED), is_lost, condition)


def _first_values(seen: Observations) -> FloatArray:
    """Return k, o and β of the linear equation, with a weak pull of s to 1."""
    A = joint_columns(seen.effort, -1.0, -seen.columns)
    _, n, size = A.shape
    used = seen.is_used.ravel()
    weak = 1e-6 * max(float(np.abs(seen.effort).max(initial=0.0)), 1e-3)
    x = np.linalg.lstsq(
        np.concatenate([A.reshape(-1, size)[used], weak * np.eye(n, size)]),
        np.concatenate([seen.known.ravel()[used], np.full(n, weak)]), rcond=1e-12)[0]
    scale = np.where(np.abs(x[:n]) > 0.1, x[:n], 1.0)
    return np.concatenate([1.0 / scale, x[n:2 * n] / scale, x[2 * n:]])


def _residual(seen: Observations, values: FloatArray) -> FloatArray:
    """Return measured − modelled effort (P, n), 0 where not used."""
    n = seen.effort.shape[1]
    model = model_effort(values[:n], values[n:2 * n], values[2 * n:], seen)
    return np.where(seen.is_used, seen.effort - model, 0.0)


def _weighted_jacobian(
    seen: Observations, assumed: FloatArray, noise: FloatArray, values: FloatArray,
) -> FloatArray:
    """Return the rows of all equations, (P n + n, 2n + k), and of the assumed scales."""
    n = len(noise)
    J = effort_jacobian(values[:n], values[2 * n:], seen) / noise[:, None]
    J *= seen.is_used[:, :, None]
    pull = np.eye(n, J.shape[2]) * np.isfinite(assumed)[:, None] / SCALE_DEVIATION
    return _without_rounding(np.concatenate([J.reshape(-1, J.shape[2]), pull]))


def _minimise(
    seen: Observations, assumed: FloatArray, noise: FloatArray, values: FloatArray,
) -> None:
    """Change `values` to the least squares."""
    n = len(noise)
    for _ in range(_STEPS):
        r = np.concatenate([
            (_residual(seen, values) / noise).ravel(),
            np.nan_to_num(assumed - values[:n]) / SCALE_DEVIATION])
        step = decomposed(_weighted_jacobian(seen, assumed, noise, values)).inverse @ r
        values += step
        if (np.abs(step) <= _CONVERGED * (1.0 + np.abs(values))).all():
            break


def _without_rounding(A: FloatArray) -> FloatArray:
    """Return A with zeros in the columns that are rounding errors of zeros."""
    norm = np.linalg.norm(A, axis=0)
    return np.where(norm > _ROUNDING * norm.max(initial=0.0), A, 0.0)


def linear_fit(A: FloatArray, covariance: FloatArray) -> tuple[FloatArray, BoolArray]:
    """
    Return G (p, m) of the least squares x = G b of A x = b, and which of x are not determined.

    b (m,) has this covariance (m, m).
    """
    A = _without_rounding(A)
    variance, axes = np.linalg.eigh(covariance)
    rows = axes.T / np.sqrt(np.maximum(variance, 1e-12 * variance[-1]))[:, None]
    found = decomposed(rows @ A)
    return np.asarray(found.inverse @ rows), found.is_lost
