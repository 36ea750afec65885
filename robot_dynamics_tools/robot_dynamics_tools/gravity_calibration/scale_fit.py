# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The fit of effort scales, offsets and gravity parameters to efforts at rest (`effort_fit`).

Gravity torque at rest is linear in masses and first moments: g(q) = Y(q) φ, with
φ = (m, m c_x, m c_y, m c_z) of a body, [kg] and [kg·m], in the frame of its link.
The driver's effort at rest, without friction, is e_j = k_j (a_j + Y_j β) + o_j, with the gravity
torque a of the URDF and of a known weight, unknown changes β of gravity parameters, offset o and
k = 1 / s of the scale s. A tool on a link is a combination of gravity parameters.
"""

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.regressor import COUNT, TorqueRegressor
from robot_dynamics_tools.estimation import effort_fit
from robot_dynamics_tools.estimation.priors import SCALE_DEVIATION

NAMES = ('m', 'mx', 'my', 'mz')
"""Names of φ of a body."""
UNITS = ('kg', 'kg·m', 'kg·m', 'kg·m')
_LEAST_NOISE = 1e-10
"""Smallest standard deviation of the effort, relative to its largest value."""


def gravity_regressor(arm: ArmModel, q: FloatArray) -> FloatArray:
    """Return Y (m, n, 4 × bodies) at positions (m, n); bodies as in `regressor`."""
    zero = np.zeros_like(q)
    Y = TorqueRegressor(arm)(q, zero, zero)
    return np.asarray(Y[:, :, np.arange(Y.shape[2]) % COUNT < len(NAMES)])


def link_columns(arm: ArmModel, link: str) -> FloatArray:
    """
    Return T (4 × bodies, 4): Y T is the regressor of a load on a link, in the frame of the link.

    Raises InvalidInputError for an unknown link.
    """
    frame = arm.link_frame(link, 'link')
    T = np.zeros((len(NAMES) * (arm.pinocchio_model.njoints - 1), len(NAMES)))
    if frame.parentJoint == 0:
        return T  # fixed to the base: no joint bears it
    body = T[len(NAMES) * (frame.parentJoint - 1):][:len(NAMES)]
    body[0, 0] = 1.0
    body[1:, 0] = frame.placement.translation
    body[1:, 1:] = frame.placement.rotation
    return T


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

    def rows(self, j: int) -> effort_fit.Rows:
        """Return the equations of a joint, whose unknowns are k (n,), o (n,) and β (k,)."""
        used, (_, n, size) = self.is_used[:, j], self.columns.shape
        z = np.column_stack([self.columns[used, j], self.known[used, j], np.ones(used.sum()),
                             self.effort[used, j]])
        of_beta, known, one, effort = np.split(np.eye(size + 3), [size, size + 1, size + 2])
        return effort_fit.Rows(
            z, len(z), effort[0], np.outer(one, np.eye(2 * n + size)[n + j]), j, known[0],
            of_beta.T @ np.eye(size, 2 * n + size, 2 * n))

    def torque(self, fit: effort_fit.EffortFit) -> FloatArray:
        """Return the gravity torque (P, n) [N·m] or [N] of a fit."""
        return np.asarray(self.known + self.columns @ fit.values[2 * self.effort.shape[1]:])


def fit_scales(
    seen: Observations, assumed: FloatArray, is_free: BoolArray,
) -> effort_fit.EffortFit:
    """
    Return the fit of k (n,), o (n,) [N·m] or [N] and β (k,), in this order.

    k is pulled to `assumed` (n,) with SCALE_DEVIATION, unless it `is_free` (n,).
    """
    n, size = len(assumed), seen.columns.shape[2]
    start = np.concatenate([assumed, np.zeros(n + size)])
    W = np.diag(~is_free / SCALE_DEVIATION) @ np.eye(n, len(start))
    floor = (_LEAST_NOISE * max(float(np.abs(seen.effort).max(initial=0.0)), 1e-3))**2
    return effort_fit.fit_effort(
        [seen.rows(j) for j in range(n)], start, None, lambda _: W,
        partial(effort_fit.residual_variances, least=floor))


def linear_fit(A: FloatArray, covariance: FloatArray) -> tuple[FloatArray, BoolArray]:
    """
    Return G (p, m) of the least squares x = G b of A x = b, and which of x are not determined.

    b (m,) has this covariance (m, m).
    """
    rows = effort_fit.inverse_root(covariance, 1e-12)
    found = effort_fit.decomposed(rows @ A)
    return np.asarray(found.inverse @ rows), found.is_lost


class Tool(NamedTuple):
    """A tool on a link that the URDF does not contain; `mass` [kg] may be unknown: None."""

    link: str
    mass: float | None = None


@dataclass(frozen=True, eq=False)
class ToolEstimate:
    """
    The mass [kg] and first moments [kg·m] of a tool in the frame of its link, (4,).

    The standard deviations and half widths of the 95 % intervals (4,) are 0 for a mass that was
    given, infinite if not observable.
    """

    link: str
    values: FloatArray
    deviations: FloatArray
    intervals: FloatArray


def estimate_tool(
    arm: ArmModel, tool: Tool, has_weight: bool, basis: FloatArray, fit: effort_fit.EffortFit,
) -> ToolEstimate:
    """
    Return the tool; `basis` (4 × bodies, k) are the gravity parameters of β of the fit.

    With a known weight, β is any change of the arm, and the tool is its part on the link.
    Otherwise β are the first moments.
    """
    n, beta = arm.joint_count, slice(2 * arm.joint_count, None)
    given = np.array([] if tool.mass is None else [tool.mass])
    is_lost = fit.solution.is_lost[beta]
    G = np.eye(len(is_lost))
    if has_weight:
        T, known = basis.T @ link_columns(arm, tool.link)[:, len(given):], ~is_lost
        G = np.zeros((T.shape[1], len(T)))
        G[:, known], is_lost = linear_fit(
            T[known], fit.covariance[beta, beta][np.ix_(known, known)])
    spread = fit.spread(np.column_stack([np.zeros((len(G), 2 * n)), G]))
    no_spread = np.zeros(len(given))
    return ToolEstimate(tool.link, np.concatenate([given, G @ fit.values[beta]]), *(
        np.concatenate([no_spread, np.where(is_lost, np.inf, one)]) for one in spread))
