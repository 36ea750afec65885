# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Base parameters: the combinations of parameters that are identifiable from efforts.

Columns of a regressor that depend linearly on previous columns are regrouped into those:
τ = Y φ = Y_b (φ_b + K φ_d). In the order from the base to the tip, parameters of outer links are
thus added to those of inner ones, as in M. Gautier, "Numerical calculation of the base inertial
parameters of robots", J. Robotic Systems 8(4), 1991 (QR decomposition of the regressor at random
states).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray

TOLERANCE = 1e-4
"""
Smallest part of a column, relative to its size, that is independent of the previous columns.

Angles in a URDF are rounded: with π/2 as 1.5708, more parameters than the arm has would be
identifiable, but only from a millionth of the efforts.
"""
_NOTHING = 1e-8
"""Fraction of the size of the largest column below which a column is empty."""
_SHOWN = 1e-7


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """
    The base parameters of p parameters: β = B φ, r of them, with Y φ = Y[:, columns] β.

    `columns` (r,) are the parameters after which the base parameters are named; `matrix` B (r, p).
    """

    names: tuple[str, ...]
    columns: tuple[int, ...]
    matrix: FloatArray

    @property
    def rank(self) -> int:
        return len(self.columns)

    @property
    def expressions(self) -> tuple[str, ...]:
        """Each base parameter as a sum, such as 'Izz(a) + Iyy(b) - 0.32·mx(b)'."""
        return tuple(
            _expression(row, self.names, column)
            for row, column in zip(self.matrix, self.columns))

    @property
    def labels(self) -> tuple[str, ...]:
        """The parameter after which each is named, with * if others are regrouped into it."""
        several = (np.abs(self.matrix) > _SHOWN).sum(axis=1) > 1
        return tuple(
            self.names[column] + ('*' if more else '')
            for column, more in zip(self.columns, several))


def find_base_parameters(regressor: FloatArray, names: Sequence[str]) -> BaseParameters:
    """
    Return the base parameters from a regressor (rows, p) at many random states.

    `names` (p,) are those of its columns.
    """
    # The R factor has the same dependencies between columns, and few rows.
    R = np.asarray(np.linalg.qr(regressor, mode='r'))
    size = np.linalg.norm(R, axis=0)
    largest = float(size.max()) if size.size else 0.0
    basis: list[FloatArray] = []
    columns: list[int] = []
    for i in range(R.shape[1]):
        if size[i] <= _NOTHING * largest:
            continue
        rest = R[:, i] / size[i]
        for _ in range(2):  # the second time because of rounding
            for unit in basis:
                rest = rest - unit * (unit @ rest)
        left = float(np.linalg.norm(rest))
        if left > TOLERANCE:
            basis.append(rest / left)
            columns.append(i)
    matrix = np.zeros((len(columns), R.shape[1]))
    if columns:
        scaled = R[:, columns] / size[columns]
        matrix = np.asarray(np.linalg.lstsq(scaled, R, rcond=None)[0]) / size[columns, np.newaxis]
        matrix[np.abs(matrix) < _SHOWN] = 0.0
        matrix[:, columns] = np.eye(len(columns))
    return BaseParameters(tuple(names), tuple(columns), matrix)


def _expression(row: FloatArray, names: Sequence[str], first: int) -> str:
    others = [i for i in np.flatnonzero(np.abs(row) > _SHOWN).tolist() if i != first]
    text = names[first]
    for i in others:
        size = abs(float(row[i]))
        factor = '' if abs(size - 1.0) < 1e-6 else f'{size:.4g}·'
        text += f' {"-" if row[i] < 0.0 else "+"} {factor}{names[i]}'
    return text
