# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Figures of motions and efforts, in one style: a row for each joint, a unit on every axis.

All figures take their colours from this module: those of Okabe and Ito (*Color Universal Design*,
2008), which are distinguishable with any kind of colour vision. Dashes and widths distinguish
lines in black and white. Matplotlib is imported with the first figure, and draws only to files.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
import textwrap
from typing import Any, NamedTuple, TYPE_CHECKING

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.dependencies import optional

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from robot_dynamics.model.arm import ArmModel

BLACK, ORANGE, SKY, GREEN = '#000000', '#E69F00', '#56B4E9', '#009E73'
BLUE, VERMILION, PURPLE, GREY = '#0072B2', '#D55E00', '#CC79A7', '#666666'
YELLOW = '#F0E442'
SIGNED_COLOURS = (SKY, '#FFFFFF', ORANGE)
"""From the negative to the positive extreme of a map; black text is readable on all of them."""
POSITIVE_COLOURS = ('#EEF6FB', SKY)
"""From zero to the largest value of a map; black text is readable on all of them."""


class LineStyle(NamedTuple):
    """The style of a line, in colour and in print."""

    colour: str
    dash: str | tuple[int, tuple[int, ...]] = '-'
    width: float = 1.4


LINES: Mapping[str, LineStyle] = {
    'reference': LineStyle(SKY, '-', 5.0),
    'measured': LineStyle(BLUE, '-', 1.4),
    'error': LineStyle(VERMILION, '-', 1.0),
    'measured − model': LineStyle(VERMILION, '-', 1.0),
    'model': LineStyle(VERMILION, (0, (6, 2)), 1.5),
    'residual': LineStyle(GREY, (0, (1, 1)), 1.4),
    'effort': LineStyle(BLACK, '-', 1.6),
    'gravity': LineStyle(GREEN, (0, (6, 2)), 1.5),
    'inertial': LineStyle(BLUE, (0, (3, 1)), 1.3),
    'coriolis': LineStyle(PURPLE, (0, (1, 1)), 1.6),
    'friction': LineStyle(ORANGE, (0, (4, 1, 1, 1)), 1.4),
    'external': LineStyle(SKY, '-', 1.2),
}
"""The style of every quantity that a figure may show."""
LABELS = {'coriolis': 'Coriolis', 'effort': 'sum'}
"""Labels of quantities in a legend that differ from their names."""

STYLE = {
    'font.size': 11.0, 'axes.titlesize': 11.0, 'axes.labelsize': 11.0, 'legend.fontsize': 10.0,
    'xtick.labelsize': 10.0, 'ytick.labelsize': 10.0, 'figure.titlesize': 12.0,
    'axes.grid': True, 'grid.color': '#DDDDDD', 'grid.linewidth': 0.6, 'axes.axisbelow': True,
    'axes.spines.top': False, 'axes.spines.right': False, 'figure.dpi': 110,
    'text.parse_math': False,  # names of joints may contain dollars
}
COLUMN_WIDTH, ROW_HEIGHT = 4.7, 2.3
"""[inch]"""
LEGEND_COLUMNS = 5
MAX_POINTS = 2000
"""Largest number of points per line in a figure."""
MAX_DOTS = 5000
"""Largest number of dots per field in a figure."""
SCATTER_COLUMNS = 3
"""Number of fields per row."""


class Panel(NamedTuple):
    """
    The plot of one quantity at each joint: lines by name, each (m, n), over `times` (m,) [s].

    `units` are those of the vertical axis, for revolute and for prismatic joints; `scale` converts
    the values to these units.
    """

    title: str
    quantity: str
    times: FloatArray
    lines: Mapping[str, FloatArray]
    units: tuple[str, str]
    scale: float = 1.0


class TimeBoundary(NamedTuple):
    """A time [s] that separates two parts of a recording, and the names of both parts."""

    time: float
    before: str
    after: str


def effort_panel(title: str, times: FloatArray, lines: Mapping[str, FloatArray]) -> Panel:
    """Return the panel of efforts, each (m, n) [N·m] or [N]; names as in LINES."""
    return Panel(title, 'effort', times, lines, ('N·m', 'N'))


def comparison_panels(times: FloatArray, measured: FloatArray, model: FloatArray) -> list[Panel]:
    """Return the panels of two efforts, (m, n) [N·m] or [N], and of their difference."""
    return [
        effort_panel('Measured and model', times, {'measured': measured, 'model': model}),
        Panel('Residual', 'residual', times, {'measured − model': measured - model},
              ('N·m', 'N'))]


def joint_figure(
    title: str, arm: 'ArmModel', panels: Sequence[Panel], boundary: TimeBoundary | None = None,
) -> Any:
    """
    Return a matplotlib figure with a row for each joint and a column for each panel.

    A dashed line marks the boundary in each field. Raises MissingDependencyError without
    matplotlib.
    """
    n = len(arm.joint_names)
    with styled_figure(COLUMN_WIDTH * len(panels), ROW_HEIGHT * n + 1.0) as figure:
        figure.suptitle(title)
        axes = figure.subplots(n, len(panels), sharex='col', squeeze=False)
        for row, name in enumerate(arm.joint_names):
            prismatic = arm.joint_kinds[row] == 'prismatic'
            for column, panel in enumerate(panels):
                _draw(axes[row, column], panel, row, prismatic)
                if boundary is not None:
                    _mark(axes[row, column], boundary)
            axes[row, 0].set_title(name, loc='left', fontweight='bold')
        for column, panel in enumerate(panels):
            axes[-1, column].set_xlabel('time [s]')
            axes[0, column].legend(
                title=panel.title, title_fontproperties={'weight': 'bold'}, alignment='left',
                ncols=LEGEND_COLUMNS, loc='lower left', bbox_to_anchor=(0.0, 1.16), frameon=False,
                borderaxespad=0.0, borderpad=0.0, handlelength=1.7, handletextpad=0.4,
                columnspacing=0.8)
    return figure


def scatter_figure(title: str, arm: 'ArmModel', velocity: FloatArray, residual: FloatArray) -> Any:
    """
    Return a matplotlib figure of residual efforts over velocity, both (m, n), one field per joint.

    Raises MissingDependencyError without matplotlib.
    """
    n = len(arm.joint_names)
    columns = min(n, SCATTER_COLUMNS)
    rows = -(-n // columns)
    step = max(1, len(velocity) // MAX_DOTS)
    with styled_figure(2.0 * COLUMN_WIDTH, 2.6 * rows + 0.6) as figure:
        figure.suptitle(title)
        axes = figure.subplots(rows, columns, squeeze=False).ravel()
        for field in axes[n:]:
            field.set_visible(False)
        for j, (field, name) in enumerate(zip(axes, arm.joint_names)):
            prismatic = arm.joint_kinds[j] == 'prismatic'
            field.axhline(0.0, color=GREY, linewidth=0.8)
            field.axvline(0.0, color=GREY, linewidth=0.8)
            field.plot(
                velocity[::step, j], residual[::step, j], '.', color=BLUE, markersize=2.0,
                alpha=0.4, rasterized=True)
            field.set_title(name, loc='left', fontweight='bold')
            field.set_xlabel(f'velocity [{"m/s" if prismatic else "rad/s"}]')
            field.set_ylabel(f'residual [{"N" if prismatic else "N·m"}]')
    return figure


def save_figure(figure: 'Figure', path: Path) -> None:
    """Write a figure to a file, whose suffix determines the format; raise OSError."""
    figure.savefig(path)


@contextmanager
def styled_figure(
    width: float, height: float, layout: str | None = 'constrained',
    style: Mapping[str, object] | None = None,
) -> Iterator[Any]:
    """
    Yield a matplotlib figure of this size [inch]; the common style is active within the block.

    `style` are additional settings. Raises MissingDependencyError without matplotlib.
    """
    matplotlib = optional('matplotlib', 'a figure')
    figure_type = optional('matplotlib.figure', 'a figure').Figure
    with matplotlib.rc_context({**STYLE, **(style or {})}):
        figure = figure_type(figsize=(width, height), layout=layout)
        optional('matplotlib.backends.backend_agg', 'a figure').FigureCanvasAgg(figure)
        yield figure


def title_axes(axes: 'Axes', title: str, note: str = '') -> None:
    """Put a title above axes, to the left, and a note in small letters between both."""
    axes.set_title(title, loc='left', fontweight='bold', pad=20.0 if note else None,
                   parse_math=False)
    axes.annotate(note, (0.0, 1.0), (0.0, 4.0), 'axes fraction', 'offset points', fontsize=10)


def legend_below(axes: 'Axes', columns: int) -> None:
    """Put the legend of axes below their horizontal label, in this number of columns."""
    axes.legend(
        loc='upper center', bbox_to_anchor=(0.45, -0.2), frameon=False, ncols=columns,
        handlelength=2.4, columnspacing=1.2)


def wrapped_title(title: str, width: float) -> str:
    """Return a title in lines that fit a figure of this width [inch]."""
    return '\n'.join(textwrap.wrap(title, int(11.5 * width)))


def draw_arm(axes: 'Axes', line: FloatArray, layer: float = 2.0) -> None:
    """Draw a line from joint to joint (k, 2), which stands out on any colour."""
    for colour, width in (('white', 4.2), (BLACK, 1.8)):
        axes.plot(line[:, 0], line[:, 1], color=colour, linewidth=width, marker='o',
                  markersize=width, solid_capstyle='round', zorder=layer)


def colour_map(colours: Sequence[str]) -> Any:
    """Return a matplotlib colour map through these colours, at equal distances."""
    return optional('matplotlib.colors', 'a figure').LinearSegmentedColormap.from_list(
        'robot_dynamics', list(colours))


def _draw(axes: 'Axes', panel: Panel, row: int, prismatic: bool) -> None:
    step = max(1, len(panel.times) // MAX_POINTS)
    times = panel.times[::step]
    for name, values in panel.lines.items():
        style = LINES[name]
        axes.plot(
            times, panel.scale * values[::step, row], label=LABELS.get(name, name),
            color=style.colour, linestyle=style.dash, linewidth=style.width)
    axes.set_ylabel(f'{panel.quantity} [{panel.units[prismatic]}]')
    axes.margins(x=0.01)
    largest = max(float(np.nanmax(np.abs(values[:, row]))) for values in panel.lines.values())
    if panel.scale * largest < 1e-9:
        axes.set_ylim(-1.0, 1.0)  # only zeros and rounding errors


def _mark(axes: 'Axes', boundary: TimeBoundary) -> None:
    """Draw the boundary, with the names of both sides below the upper edge."""
    axes.axvline(boundary.time, color=GREY, linestyle='--', linewidth=1.2)
    for text, align in ((f'{boundary.before} ', 'right'), (f' {boundary.after}', 'left')):
        axes.text(
            boundary.time, 0.98, text, horizontalalignment=align, verticalalignment='top',
            transform=axes.get_xaxis_transform(), fontsize=8, color=GREY)
