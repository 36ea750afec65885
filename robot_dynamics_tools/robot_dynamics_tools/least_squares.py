# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Linear least squares A x = b with columns of any size, some of which may not be determined."""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, column_scale, FloatArray

LOST = 1e-5
"""Smallest part of a parameter in an undetermined combination that makes it undetermined."""


class Decomposition(NamedTuple):
    """
    The determined part of A (m, p), of rank r, with columns scaled to the same size.

    x = `back` @ `basis`.T @ b is the smallest least-squares solution; `basis` is (m, r), `back` is
    (p, r). `is_lost` (p,) marks the parameters that A does not determine. `condition` is the
    condition number of the determined part, infinite without one.
    """

    basis: FloatArray
    back: FloatArray
    is_lost: BoolArray
    condition: float

    @property
    def inverse(self) -> FloatArray:
        """The matrix (p, m) from b to x."""
        return np.asarray(self.back @ self.basis.T)


def decomposed(A: FloatArray, rcond: float = 1e-9) -> Decomposition:
    """Return the decomposition; a relative singular value below `rcond` counts as 0."""
    scale = column_scale(A)
    U, singular, Vt = np.linalg.svd(A * scale, full_matrices=False)
    kept = singular > rcond * singular[0]
    V, s = Vt[kept].T, singular[kept]
    return Decomposition(
        U[:, kept], scale[:, np.newaxis] * V / s,
        np.asarray((scale == 0.0) | (1.0 - (V**2).sum(axis=1) > LOST**2)),
        float(s[0] / s[-1]) if len(s) else np.inf)
