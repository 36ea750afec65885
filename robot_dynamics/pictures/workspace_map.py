# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Map of the workspace of an arm, with gravity torques as fractions of its effort limits."""

from typing import Any

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.worst_gravity import worst_gravity
from robot_dynamics.pictures.stick_figure import side_view, StickFigure
from robot_dynamics.pictures.workspace_gravity import WorkspaceGravity
from robot_dynamics.reporting.figures import (
    BLACK,
    BLUE,
    colour_map,
    POSITIVE_COLOURS,
    styled_figure,
    title_axes,
    VERMILION,
    wrapped_title,
)

WIDTH, MAP_HEIGHT, BAR_HEIGHT, BAR_ROOM = 10.4, 5.2, 0.3, 0.9
"""[inch]; BAR_ROOM is the height of the bars' title and axis."""
_PERCENT = 100.0


def workspace_figure(title: str, arm: ArmModel, link: str, found: WorkspaceGravity) -> Any:
    """
    Return a matplotlib figure: the worst and the best pose by position, and bars by joint.

    The worst pose of all, from the search of `worst_gravity`, is drawn at its position. Raises
    MissingDependencyError without matplotlib.
    """
    worst = worst_gravity(arm)
    bars = BAR_ROOM + BAR_HEIGHT * arm.joint_count
    with styled_figure(WIDTH, MAP_HEIGHT + bars, style={'hatch.color': VERMILION}) as figure:
        figure.suptitle(wrapped_title(title, WIDTH))
        grid = figure.add_gridspec(2, 2, height_ratios=(MAP_HEIGHT, bars))
        most, least = (figure.add_subplot(grid[0, column]) for column in range(2))
        joints = figure.add_subplot(grid[1, :])
        top = max(float(np.nanmax(found.most)), 1e-9)
        _draw_places(most, found, found.most, top, f'Worst pose at each position of {link}')
        image = _draw_places(
            least, found, found.least, top, f'Best pose at each position of {link}')
        bar = figure.colorbar(image, ax=[most, least], shrink=0.9, aspect=26, pad=0.01)
        bar.set_label('largest share of an effort limit [%]')
        bar.outline.set_visible(False)
        if top > 1.0:
            bar.ax.axhline(_PERCENT, color=VERMILION, linewidth=2.6)
        if found.is_plane:
            q = worst.position[int(np.argmax(worst.effort / arm.limits.effort))]
            _draw_pose(most, arm, link, q)
            most.annotate('black: the worst pose of all', (1.0, 0.0), (0.0, 4.0), 'axes fraction',
                          'offset points', ha='right', fontsize=10,
                          bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 1.0})
        _draw_joints(joints, arm, worst.effort)
    return figure


def _draw_places(
    axes: Any, found: WorkspaceGravity, ratios: FloatArray, top: float, title: str,
) -> Any:
    image = axes.pcolormesh(
        found.across, found.up, _PERCENT * ratios, vmin=0.0, vmax=_PERCENT * top, rasterized=True,
        cmap=colour_map(POSITIVE_COLOURS))
    beyond = bool(np.nanmax(ratios) > 1.0)
    if beyond:
        centres = [0.5 * (edges[1:] + edges[:-1]) for edges in (found.across, found.up)]
        axes.contourf(*centres, ratios, levels=[1.0, 2.0 * top], colors='none', hatches=['///'])
        axes.contour(*centres, ratios, levels=[1.0], colors=VERMILION, linewidths=2.4)
    axes.set_aspect('equal')
    axes.set(xlabel='x [m]' if found.is_plane else 'distance from the vertical [m]',
             ylabel='height [m]')
    title_axes(axes, title, 'hatched: gravity exceeds an effort limit' if beyond else (
        'gravity is within the effort limits everywhere'))
    return image


def _draw_pose(axes: Any, arm: ArmModel, link: str, q: FloatArray) -> None:
    points = StickFigure(arm, link).points(q)
    flat = points @ side_view(arm, points).T
    for colour, width in (('white', 4.2), (BLACK, 1.8)):
        axes.plot(flat[:, 0], flat[:, 1], color=colour, linewidth=width, marker='o',
                  markersize=1.4 * width)


def _draw_joints(axes: Any, arm: ArmModel, efforts: FloatArray) -> None:
    ratios = _PERCENT * efforts / arm.limits.effort
    names = arm.joint_names
    places = np.arange(len(names))[::-1]
    colours = [VERMILION if ratio > _PERCENT else BLUE for ratio in ratios]
    axes.barh(places, ratios, 0.62, color=colours)
    axes.axvline(_PERCENT, color=BLACK, linewidth=1.4, linestyle=(0, (4, 2)))
    axes.set_yticks(places, names)
    axes.set_ylim(-0.6, len(names) - 0.4)
    axes.grid(axis='y', visible=False)
    right = 1.25 * max(float(ratios.max()), _PERCENT)
    axes.set(xlim=(0.0, right), xlabel='share of the effort limit [%]')
    for place, ratio, effort, limit, kind in zip(
            places, ratios, efforts, arm.limits.effort, arm.joint_kinds):
        unit = 'N' if kind == 'prismatic' else 'N·m'
        of = f' of {limit:g} {unit}' if np.isfinite(limit) else f' {unit}, no limit'
        effort = round(float(effort), 6) + 0.0
        axes.text(
            ratio + 0.02 * right, place, f'{effort:.3g}{of}', va='center', fontsize=10,
            bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 1.0})
    title_axes(axes, 'Largest gravity effort of each joint; dashed: its limit')
