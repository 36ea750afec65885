# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Exact extrema of many polynomials on [0, 1], such as the motions on the segments of a trajectory.

A function is monotone between two neighbouring extrema and has at most one root there, and the
roots of a derivative are the extrema of the next lower derivative. The search begins with the
linear derivative, and bisects the derivatives one after the other between the roots of the
derivative above. Polynomials of lower degree are no special cases, because the leading coefficient
of none of them has to be nonzero.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray

_BISECTIONS = 26
"""An error of the phase of 2⁻²⁶ changes an extremum by less than 2⁻⁵² of the curvature there."""


class Extrema(NamedTuple):
    """Phases in [0, 1] and values of the minima and maxima, (2, ...) each, minima first."""

    phases: FloatArray
    values: FloatArray


def extrema(coefficients: FloatArray) -> Extrema:
    """
    Return the minimum and the maximum on [0, 1] of each polynomial, including both ends.

    `coefficients` (..., m, n) are finite: those of 1, s, ..., s^(m - 1), for n polynomials each.
    The arrays of the result have shape (2, ..., n).
    """
    while coefficients.shape[-2] > 1 and not coefficients[..., -1, :].any():
        coefficients = coefficients[..., :-1, :]
    largest = np.max(np.abs(coefficients), axis=-2, initial=0.0)
    scale = np.where(largest > 0.0, largest, 1.0)
    unit = coefficients / scale[..., np.newaxis, :]
    derivatives = [derivative(unit)]
    while derivatives[-1].shape[-2] > 2:
        derivatives.append(derivative(derivatives[-1]))
    phases = _with_ends(largest[np.newaxis][:0])
    for one in reversed(derivatives):
        phases = _with_ends(_roots(one, phases))
    values = _evaluate(unit, phases)
    rows = np.stack((np.argmin(values, axis=0), np.argmax(values, axis=0)))
    with np.errstate(over='ignore'):
        return Extrema(
            np.take_along_axis(phases, rows, axis=0),
            np.take_along_axis(values, rows, axis=0) * scale)


def derivative(coefficients: FloatArray) -> FloatArray:
    """Return the coefficients (..., m - 1, n) of the derivatives by s of polynomials."""
    orders = np.arange(1.0, coefficients.shape[-2])
    return orders[:, np.newaxis] * coefficients[..., 1:, :]


def _with_ends(phases: FloatArray) -> FloatArray:
    ends = np.zeros_like(phases, shape=(1, *phases.shape[1:]))
    return np.concatenate((ends, phases, ends + 1.0))


def _roots(c: FloatArray, nodes: FloatArray) -> FloatArray:
    """
    Return a phase between each two of the nodes (k, ..., n): the root there, if there is one.

    The polynomials c (..., m, n) are monotone between neighbouring nodes. Without a root the phase
    is one of the two nodes.
    """
    low, high = nodes[:-1], nodes[1:]
    is_positive = _evaluate(c, low) > 0.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        is_before = (_evaluate(c, middle) > 0.0) == is_positive
        low = np.where(is_before, middle, low)
        high = np.where(is_before, high, middle)
    return high


def _evaluate(c: FloatArray, phases: FloatArray) -> FloatArray:
    """Return the values (k, ...) of the polynomials c (..., m, n) at phases (k, ..., n)."""
    values = np.zeros_like(phases)
    for row in np.moveaxis(c, -2, 0)[::-1]:
        values = values * phases + row
    return values
