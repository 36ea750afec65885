# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Types of arrays, and functions of arrays and angles that every layer shares."""

import math

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]
"""Time stamps [ns], counts and indices."""

NANOSECONDS_PER_SECOND = 1_000_000_000


def all_finite(values: FloatArray) -> bool:
    """
    Return whether the numbers of a vector, shape (n,), are all finite.

    The control path checks every effort: their sum is finite without another array, and without
    a warning; if it overflows, the numbers are checked one by one.
    """
    return math.isfinite(sum(values.tolist())) or bool(np.isfinite(values).all())


def column_scale(A: FloatArray) -> FloatArray:
    """Return the factors (k,) with which the columns of A (m, k) have length 1; 0 for a zero."""
    norm = np.linalg.norm(A, axis=0)
    return np.asarray(np.divide(1.0, norm, out=np.zeros_like(norm), where=norm > 0.0))


def wrap_to_pi(angle: FloatArray) -> FloatArray:
    """Return the angles [rad] in (−π, π] that are whole turns away, of the same shape."""
    return np.asarray(np.pi - np.mod(np.pi - angle, 2.0 * np.pi))


def wrap_angle(angle: float) -> float:
    """Return the angle [rad] in (−π, π] that is whole turns away; NaN if it is not finite."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi) if math.isfinite(angle) else math.nan
