# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Draw docs/images/backlash.png: hysteresis, dead zone, and the limit cycle that backlash causes.

The runs are those that test/simulation/test_backlash_theory.py checks.
"""

from pathlib import Path
import sys
from typing import Any

import numpy as np
from robot_dynamics_tools.reporting.figures import (
    BLACK,
    BLUE,
    GREY,
    legend_below,
    ORANGE,
    SKY,
    styled_figure,
    VERMILION,
)

sys.path.insert(0, str(Path(__file__).parents[2] / 'test' / 'support'))
import backlash_theory as theory  # noqa: E402

MILLI = 1e3


def draw_hysteresis(axes: Any, way: theory.Way) -> None:
    b, A = MILLI * theory.HALF_GAP, MILLI * theory.AMPLITUDE
    h = A - b
    corners = np.array([(A, h), (A - 2.0 * b, h), (-A, -h), (2.0 * b - A, -h), (A, h)])
    axes.plot(MILLI * way.theta, MILLI * way.q, color=SKY, linewidth=5.0, label='simulated')
    axes.plot(*corners.T, color=BLACK, linestyle=(0, (4, 2)), linewidth=1.2,
              label='play operator')
    axes.annotate('', (A, h + 1.5), (A - 2.0 * b, h + 1.5), arrowprops={
        'arrowstyle': '<->', 'color': VERMILION, 'shrinkA': 0.0, 'shrinkB': 0.0})
    axes.text(A - b, h + 2.5, 'gap 2b', color=VERMILION, ha='center', va='bottom')
    axes.set(xlabel='motor position / N [mrad]', ylabel='joint position [mrad]',
             ylim=(-25.0, 29.0), title='Hysteresis of the joint')
    legend_below(axes, 2)


def draw_dead_zone(axes: Any, way: theory.Way) -> None:
    still = np.abs(way.theta - way.q) < theory.HALF_GAP - 1e-9
    axes.plot(way.t, MILLI * way.theta, color=ORANGE, linestyle=(0, (5, 2)), linewidth=1.8,
              label='motor / N')
    axes.plot(way.t, MILLI * way.q, color=BLUE, linewidth=1.8, label='joint')
    axes.fill_between(way.t, 0.0, 1.0, where=still, transform=axes.get_xaxis_transform(),
                      color=GREY, alpha=0.2, linewidth=0.0, label='no contact')
    axes.set(xlabel='time [s]', ylabel='position [mrad]', title='Dead zone')
    legend_below(axes, 3)


def draw_cycle(axes: Any) -> None:
    way, predicted = theory.feed_back(20.0, start=0.04), theory.predicted_cycle()
    first, last = theory.Way(*(x[way.t < 5.0] for x in way)), theory.after(way, 15.0)

    def orbit(part: theory.Way) -> tuple[np.ndarray, np.ndarray]:
        return MILLI * part.theta, MILLI * np.gradient(part.theta, part.t)

    axes.plot(*orbit(first), color=GREY, linewidth=0.9, label='transient')
    axes.plot(*orbit(last), color=SKY, linewidth=5.0, label='after 15 s')
    phase = np.linspace(0.0, 2.0 * np.pi, 200)
    A = MILLI * predicted.amplitude
    axes.plot(A * np.cos(phase), A * predicted.frequency * np.sin(phase), color=BLACK,
              linestyle=(0, (4, 2)), linewidth=1.2, label='harmonic balance')
    axes.set(xlabel='motor position / N [mrad]', ylabel='motor velocity / N [mrad/s]',
             title='Limit cycle with joint feedback')
    legend_below(axes, 3)


def main(directory: Path) -> None:
    """Write the picture into a directory."""
    way = theory.after(theory.swing(6.0), 2.0)
    with styled_figure(12.0, 4.4) as figure:
        hysteresis, dead_zone, cycle = figure.subplots(1, 3)
        draw_hysteresis(hysteresis, way)
        draw_dead_zone(dead_zone, way)
        draw_cycle(cycle)
        figure.savefig(directory / 'backlash.png')


if __name__ == '__main__':
    main(Path(sys.argv[1]))
