# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Heat maps over the positions of two joints, with the pose of the arm at selected points."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import ModelError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.validation import is_empty
from robot_dynamics_tools.pictures.planar_view import PlanarView
from robot_dynamics_tools.pictures.stick_figure import side_lines
from robot_dynamics_tools.pictures.torque_grid import PositionGrid
from robot_dynamics_tools.reporting import figures

PANEL_WIDTH, PANEL_HEIGHT = 5.2, 4.7
"""[inch]"""
POSES = 4
"""Number of poses along each axis."""
UPRIGHT = ' (q\xa0=\xa00:\xa0upright)'
"""Part of the title, which is not wrapped within."""
LIMIT_WIDTH = 2.4
"""Width of the contour of the limit [points]."""
_POSE_SIZE = 0.95
"""Of the room that a pose has, when the arm is stretched."""


class MapPanel(NamedTuple):
    """
    A map over a grid: `values` (l, k) in `unit`; signed values are white at zero.

    The joint cannot produce values whose magnitude exceeds `limit`.
    """

    title: str
    values: FloatArray
    unit: str
    signed: bool
    limit: float = np.inf


def map_figure(
    title: str, arm: ArmModel, grid: PositionGrid, panels: Sequence[MapPanel],
    poses: npt.ArrayLike = (),
) -> Any:
    """
    Return a matplotlib figure with the panels next to one another.

    `poses` (m, 2) are positions of the grid's joints at which the arm is drawn, if empty an even
    choice. If some panels vary, the constant ones become a line of text. Raises
    MissingDependencyError without matplotlib.
    """
    drawn = even_poses(grid) if is_empty(poses) else np.asarray(poses, dtype=np.float64)
    notes = [f'{panel.title}: {panel.values.flat[0]:.4g} {panel.unit} at all positions'
             for panel in panels if not _varies(panel)]
    if len(notes) < len(panels):
        panels = [panel for panel in panels if _varies(panel)]
    else:
        notes = []
    columns = min(len(panels), 3)
    rows = -(-len(panels) // columns)
    with figures.styled_figure(
            PANEL_WIDTH * columns, PANEL_HEIGHT * rows + 0.45,
            style={'hatch.color': figures.BLACK, 'hatch.linewidth': 0.5}) as figure:
        figure.suptitle(figures.wrapped_title(
            title + (UPRIGHT if _stands_upright(arm) else ''), PANEL_WIDTH * columns))
        axes = figure.subplots(rows, columns, squeeze=False).ravel()
        for one in axes[len(panels):]:
            one.set_visible(False)
        for one, panel in zip(axes, panels):
            _draw_map(figure, one, grid, panel)
            label_axes(one, arm, grid)
            _draw_poses(one, arm, grid, drawn)
        if notes:
            figure.supxlabel('\n'.join(notes), fontsize=10)
    return figure


def _varies(panel: MapPanel) -> bool:
    return bool(np.ptp(panel.values) > 1e-6 * max(float(np.abs(panel.values).max()), 1e-9))


def even_poses(grid: PositionGrid) -> FloatArray:
    """Return POSES × POSES points in the middle of as many equal fields of the grid, (m, 2)."""
    fraction = (np.arange(POSES) + 0.5) / POSES
    x = grid.x[0] + fraction * (grid.x[-1] - grid.x[0])
    y = grid.y[0] + fraction * (grid.y[-1] - grid.y[0])
    return np.array([(one, other) for other in y for one in x]).reshape(-1, 2)


def _draw_map(figure: Any, axes: Any, grid: PositionGrid, panel: MapPanel) -> None:
    """Draw the values and the limit."""
    values, largest = panel.values, max(float(np.abs(panel.values).max()), 1e-9)
    low = -largest if panel.signed else 0.0
    image = axes.pcolormesh(
        grid.x, grid.y, values, vmin=low, vmax=largest, shading='gouraud', rasterized=True,
        cmap=figures.colour_map(
            figures.SIGNED_COLOURS if panel.signed else figures.POSITIVE_COLOURS))
    bar = figure.colorbar(image, ax=axes, shrink=0.82, aspect=24, pad=0.02)
    bar.set_label(f'[{panel.unit}]')
    bar.outline.set_visible(False)
    axes.grid(False)
    if _varies(panel):
        bar.add_lines(axes.contour(
            grid.x, grid.y, values, levels=7, colors=figures.BLACK, linewidths=0.7, alpha=0.6))
    reached = largest > panel.limit
    if reached:
        size = np.abs(values)
        axes.contourf(
            grid.x, grid.y, size, levels=[panel.limit, 2.0 * largest], colors='none',
            hatches=['//'])
        for colour, width in (('white', LIMIT_WIDTH + 2.2), (figures.BLACK, LIMIT_WIDTH)):
            axes.contour(
                grid.x, grid.y, size, levels=[panel.limit], colors=colour, linewidths=width)
            for end in (-panel.limit, panel.limit)[not panel.signed:]:
                bar.ax.axhline(end, color=colour, linewidth=width)
    note = '' if not np.isfinite(panel.limit) else (
        f'hatched: beyond the limit, {panel.limit:g} {panel.unit}' if reached else
        f'within the limit of {panel.limit:g} {panel.unit} everywhere')
    figures.title_axes(axes, panel.title, note)


def label_axes(axes: Any, arm: ArmModel, grid: PositionGrid) -> None:
    """Label the axes of a map with the joints of its grid."""
    for joint, axis, values, set_label in (
            (grid.joints[0], axes.xaxis, grid.x, axes.set_xlabel),
            (grid.joints[1], axes.yaxis, grid.y, axes.set_ylabel)):
        turns = arm.joint_kinds[joint] != 'prismatic'
        set_label(f'position of {arm.joint_names[joint]} [{"rad" if turns else "m"}]')
        if turns and np.ptp(values) > np.pi:
            axis.set_major_locator(optional('matplotlib.ticker', 'a figure').MultipleLocator(
                0.5 * np.pi))
            axis.set_major_formatter(lambda value, _: f'{value / np.pi:.3g} π'.replace('-', '−'))
    axes.set_box_aspect(1.0)


def _draw_poses(axes: Any, arm: ArmModel, grid: PositionGrid, poses: FloatArray) -> None:
    """Draw the arm at points of the grid: its base is at the point, up is up."""
    q = np.tile(grid.positions[0, 0], (len(poses), 1))
    q[:, grid.joints] = poses
    lines = side_lines(arm, q)
    reach = float(np.linalg.norm(lines, axis=2).max())
    if reach == 0.0:
        return
    each = 0.5 * _POSE_SIZE / max(round(len(poses) ** 0.5), POSES - 1)
    scale = each / reach * np.array([np.ptp(grid.x), np.ptp(grid.y)])
    for pose, points in zip(poses, lines):
        figures.draw_arm(axes, pose + scale * points)
        axes.plot(*pose, 's', color=figures.BLACK, markerfacecolor='white', markersize=5.0)


def _stands_upright(arm: ArmModel) -> bool:
    try:
        return PlanarView(arm).upright_at_zero
    except ModelError:
        return False
