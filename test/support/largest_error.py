# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The errors of a test, of which the fixture `largest_error` prints the largest."""

import numpy as np
import numpy.typing as npt

ERRORS: list[tuple[float, str]] = []
"""Errors of the test by the largest expected value, and of what."""


def assert_small(error: float, tolerance: float, what: str) -> None:
    """Record an error, and compare it with its tolerance."""
    ERRORS.append((error, what))
    assert error <= tolerance, f'{what}: {error:.1e}'


def assert_near(
    tolerance: float, actual: npt.ArrayLike, expected: npt.ArrayLike, what: str,
) -> None:
    """Compare max |actual − expected| relative to max |expected|."""
    assert np.shape(actual) == np.shape(expected)
    scale = np.max(np.abs(expected), initial=0.0)
    error = np.max(np.abs(np.subtract(actual, expected)), initial=0.0)
    # If a vector is zero by symmetry, both results are only rounding errors.
    assert_small(float(error / scale if scale > 1e-9 else error), tolerance, what)
