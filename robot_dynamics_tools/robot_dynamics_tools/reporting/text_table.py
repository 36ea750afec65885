# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Tables for a terminal: text in columns, numbers below their headings.

The library tabulate is not used because it only aligns cells: the notation of the numbers (four
decimals, an exponent outside of [1e-3, 1e6)), which is most of this module, would still be needed.
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import repeat
import textwrap

import numpy as np
from robot_dynamics.arrays import FloatArray

Cell = str | float
Rows = list[tuple[str, ...]]
"""Rows of cells that are text already, the first of which may be headings."""
_ROUNDING = 1e-12
"""A number with a smaller magnitude is displayed as 0."""


def text_table(
    headings: Sequence[str], rows: Sequence[Sequence[Cell]], left_columns: int | None = None,
) -> str:
    """
    Return rows of cells under headings, if any.

    The first `left_columns` are aligned to the left and the others to the right; without a count,
    columns of text to the left and columns of numbers to the right.
    """
    lines = [list(headings)] if headings else []
    lines += [[_text(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*lines)]
    is_left = [
        i < left_columns if left_columns is not None
        else all(isinstance(row[i], str) for row in rows) for i in range(len(widths))]
    return '\n'.join(
        '  '.join(
            cell.ljust(width) if left else cell.rjust(width)
            for cell, width, left in zip(row, widths, is_left)).rstrip()
        for row in lines)


def folded_table(
    names: Mapping[str, Sequence[str]], columns: Mapping[str, Sequence[str]], width: int,
) -> str:
    """
    Return a table of at most `width` characters: columns that do not fit are in a table below.

    Headings take several lines. Each table begins with the columns `names`, whose longest cells
    lose their beginning, so that a third of the width suffices for them.
    """
    longest = max(width // 3 - 2, 8)
    first = [_column(name, [cell if len(cell) <= longest else f'…{cell[1 - longest:]}'
                            for cell in cells]) for name, cells in names.items()]
    parts: list[list[list[str]]] = []
    left = 0
    for column in (_column(*item) for item in columns.items()):
        if not parts or _width(column) > left:
            parts.append([*first])
            left = width + 2 - sum(map(_width, first))
        parts[-1].append(column)
        left -= _width(column)
    return '\n'.join(_stacked(part, len(first)) for part in parts)


def _column(heading: str, cells: Sequence[str]) -> list[str]:
    """Return the lines of a heading as wide as the cells, then the cells."""
    return [*textwrap.wrap(
        heading, max(map(len, cells)), break_long_words=False, break_on_hyphens=False), *cells]


def _width(column: Sequence[str]) -> int:
    """Return the width of a column with the space before it."""
    return 2 + max(map(len, column))


def _stacked(columns: Sequence[Sequence[str]], left_columns: int) -> str:
    depth = max(map(len, columns))
    return text_table([], list(zip(*(
        [*[''] * (depth - len(column)), *column] for column in columns))), left_columns)


def quantity_table(rows: Sequence[Sequence[str]]) -> str:
    """Return rows below the first, their headings: names, then quantities with their units."""
    return text_table(rows[0], rows[1:], left_columns=1)


def column_rows(
    first: str, names: Sequence[str], *columns: tuple[str, Iterable[str]],
) -> Rows:
    """Return the headings, and a row per name; a column is a heading and a cell per name."""
    return [(first, *(heading for heading, _ in columns)),
            *zip(names, *(column for _, column in columns))]


def cells(values: Iterable[float], form: str, units: Iterable[str] = repeat('')) -> list[str]:
    """Return numbers in a format, each with its unit; a dash for what is not finite."""
    return [f'{value:{form}} {unit}'.rstrip() if np.isfinite(value) else '-'
            for value, unit in zip(values, units)]


def matrix_table(title: str, names: Sequence[str], matrix: FloatArray) -> str:
    """Return a matrix (n, n) over joints, with their names at its rows and columns."""
    return text_table([title, *names], [[name, *row] for name, row in zip(names, matrix.tolist())])


def _text(cell: Cell) -> str:
    if isinstance(cell, str):
        return cell
    if abs(cell) < _ROUNDING:
        return f'{0.0:.4f}'
    return f'{cell:.4f}' if 1e-3 <= abs(cell) < 1e6 else f'{cell:.3e}'


def json_numbers(values: Iterable[float]) -> list[float | None]:
    """Return numbers for JSON, which has no NaN and no ∞: None instead of these."""
    return [float(value) if np.isfinite(value) else None for value in values]


def percent(fraction: float) -> str:
    """Return a fraction in percent, a dash for NaN."""
    return '-' if np.isnan(fraction) else f'{100.0 * fraction:.1f} %'
