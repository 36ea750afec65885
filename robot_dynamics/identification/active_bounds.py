# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0


"""The bounds of friction and rotors that act: parameters that the data place beyond a bound."""

from collections.abc import Sequence
from typing import NamedTuple

from robot_dynamics.identification.friction_regressor import COLUMN_NAMES, FRICTION_COLUMNS, OFFSET
from robot_dynamics.identification.regularized_fit import Fit

LEAST_DIFFERENCE = 1e-6
"""Smallest difference from the estimate without bounds, relative to the largest value."""
_UNITS = (
    'kg·m² or kg', *(' or '.join(column.parameter.units) for column in FRICTION_COLUMNS))


class ActiveBound(NamedTuple):
    """A parameter at its bound, and its estimate without any bounds."""

    joint: int
    parameter: str
    unit: str
    value: float
    unbounded: float


def active_bounds(bounded: Fit, unbounded: Fit) -> list[ActiveBound]:
    """Return the parameters of joints that a bound keeps at 0, or that it makes smaller."""
    found = []
    for j, structure in enumerate(bounded.structures):
        for column in structure.columns:
            value = float(bounded.joint_values[j, column])
            other = float(unbounded.joint_values[j, column])
            least = LEAST_DIFFERENCE * max(abs(value), abs(other))
            if column not in OFFSET and other < -least and abs(value) <= -1e-3 * other:
                found.append(ActiveBound(j, COLUMN_NAMES[column], _UNITS[column], value, other))
    return found


def bounds_text(bounds: Sequence[ActiveBound]) -> str:
    """Return the bounds of one joint as a list."""
    return ', '.join(
        f'{bound.parameter} {bound.value:.3g} instead of {bound.unbounded:.3g} {bound.unit}'
        for bound in bounds)
