# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Draw docs/images/growth.png: the time per call over the number of joints.

The numbers are those of the table in docs/evidence/benchmarks.md, so that the figure and the table
show one measurement. `scripts/bench growth` measures.
"""

from pathlib import Path
import re
import sys
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics_tools.reporting.figures import (
    BLACK,
    BLUE,
    GREEN,
    legend_below,
    ORANGE,
    PURPLE,
    SKY,
    styled_figure,
    VERMILION,
)

TABLE = re.compile(r'<!-- growth -->\n```text\n(.*?)```', re.DOTALL)
LOOKS = {
    'inverse dynamics': (BLUE, '-', 'o'), 'gravity': (GREEN, '--', 's'),
    'mass matrix': (ORANGE, '-', '^'), 'Coriolis matrix': (VERMILION, '--', 'D'),
    'all terms': (PURPLE, '-.', 'v'), 'forward dynamics': (SKY, '-', 'x')}


class Growth(NamedTuple):
    """Numbers of joints, time per call [µs] and exponent by quantity, and the linear fit."""

    joints: np.ndarray
    times: dict[str, np.ndarray]
    exponents: dict[str, float]
    long: int
    start: float
    slope: float
    r_squared: float


def read_growth(page: str) -> Growth:
    """Return what the table of the page contains; raise ValueError if it has no such table."""
    match = TABLE.search(page)
    if match is None:
        raise ValueError('docs/evidence/benchmarks.md has no table <!-- growth -->')
    rows = {line[:18].strip(): line[18:].split() for line in match[1].splitlines()}
    fit = re.search(r'dynamics: ([\d.]+) µs \+ ([\d.]+) µs per joint, R² = ([\d.]+)', match[1])
    long = re.search(r'exponents from (\d+)', match[1])
    if fit is None or long is None:
        raise ValueError('docs/evidence/benchmarks.md has no fits below the table <!-- growth -->')
    exponents = {
        name: float(re.findall(rf'{name} ([\d.]+)', match[1][long.end():])[0]) for name in LOOKS}
    return Growth(
        np.array(rows['µs per call'][:-1], dtype=float),
        {name: np.array(rows[name], dtype=float) for name in LOOKS}, exponents, int(long[1]),
        *map(float, fit.groups()))


def draw_all(axes: Any, growth: Growth) -> None:
    for name, (colour, dash, marker) in LOOKS.items():
        axes.loglog(
            growth.joints, growth.times[name], color=colour, linestyle=dash, marker=marker,
            markersize=4.5, linewidth=1.6, label=f'{name}, p = {growth.exponents[name]:.2f}')
    axes.set(xlabel='number of joints n', ylabel='time per call [µs]')
    axes.set_title(f'Time per call ~ n$^p$ from {growth.long} joints')
    axes.set_xticks([2, 3, 5, 7, 10, 20, 30, 60], ['2', '3', '5', '7', '10', '20', '30', '60'])
    axes.set_yticks([1, 3, 10, 30], ['1', '3', '10', '30'])
    axes.minorticks_off()
    legend_below(axes, 2)


def draw_inverse_dynamics(axes: Any, growth: Growth) -> None:
    n = growth.joints
    axes.plot(n, growth.start + growth.slope * n, color=BLACK, linewidth=1.2, label=(
        f'{growth.start:g} µs + {growth.slope:.3f} µs · n  (R² = {growth.r_squared:g})'))
    axes.plot(n, growth.times['inverse dynamics'], color=BLUE, linestyle='', marker='o',
              label='measured')
    axes.set(xlabel='number of joints n', ylabel='time per call [µs]', xlim=(0.0, None),
             ylim=(0.0, None), title='Inverse dynamics')
    legend_below(axes, 1)


def main(directory: Path) -> None:
    """Write the picture into a directory."""
    page = Path(__file__).parents[1] / 'evidence' / 'benchmarks.md'
    growth = read_growth(page.read_text(encoding='utf-8'))
    with styled_figure(10.0, 5.0) as figure:
        every, inverse = figure.subplots(1, 2)
        draw_all(every, growth)
        draw_inverse_dynamics(inverse, growth)
        figure.savefig(directory / 'growth.png')


if __name__ == '__main__':
    main(Path(sys.argv[1]))
