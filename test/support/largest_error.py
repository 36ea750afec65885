# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The errors of a test, of which the fixture `largest_error` prints the largest."""

ERRORS: list[tuple[float, str]] = []
"""Errors of the test by the largest expected value, and of what."""


def assert_small(error: float, tolerance: float, what: str) -> None:
    """Record an error, and compare it with its tolerance."""
    ERRORS.append((error, what))
    assert error <= tolerance, f'{what}: {error:.1e}'
