# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What is known of an arm and its drives before any effort is measured."""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.regressor import COUNT
from robot_dynamics_tools import pseudo_inertia

SCALE_DEVIATION = 0.3
"""Relative standard deviation of the effort scale of a drive."""
GIVEN_DEVIATION = 0.1
"""That of a scale that was given without a covariance, such as a data sheet's torque constant."""
OFFSET_DEVIATION = 0.05
"""Standard deviation of the effort offset of a drive, relative to the effort limit."""


def unknown_drives(
    scale: FloatArray, limit: FloatArray, deviation: float = SCALE_DEVIATION,
) -> FloatArray:
    """
    Return the covariance (2n, 2n) of scales, then offsets, about assumed scales (n,).

    `limit` (n,) are the effort limits [N·m] or [N]. `deviation` is that of the scales, relative
    to them; that of the offsets changes in proportion.
    """
    offset = OFFSET_DEVIATION * deviation / SCALE_DEVIATION * limit
    return np.diag(np.concatenate([deviation * scale, offset])**2)


class BodyPrior(NamedTuple):
    """
    The bodies of a URDF: φ⁰ (p,), one Cholesky factor of P₀ per body (b, 4, 4), and W (p, p).

    ½ |W (φ − φ⁰)|² is the entropic divergence to second order, that of all bodies
    (`pseudo_inertia`): 1 for a URDF that is wrong by about 100 %.
    """

    parameters: FloatArray
    roots: FloatArray
    rows: FloatArray


def body_prior(parameters: FloatArray) -> BodyPrior:
    """Return the prior of the bodies' parameters (p,) of a URDF."""
    roots = pseudo_inertia.regularizing_roots(parameters)
    rows = np.zeros((len(parameters), len(parameters)))
    for i, root in enumerate(roots):
        part = slice(COUNT * i, COUNT * (i + 1))
        rows[part, part] = pseudo_inertia.relative_rows(root)
    return BodyPrior(np.concatenate([
        pseudo_inertia.parameters_of(root @ root.T) for root in roots]), roots, rows)
