# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Map of the workspace of an arm, with gravity torques as fractions of its effort limits.

Positions are sampled over all joints; each position is assigned to the cell that contains a given
link. The cells of a planar arm are in its plane; those of any other arm are in the plane of the
height and the distance from the vertical through the base.
"""

from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import InvalidInputError, ModelError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.worst_gravity import sample_positions, worst_gravity
from robot_dynamics_tools.pictures.planar_view import PlanarView
from robot_dynamics_tools.pictures.stick_figure import side_view, StickFigure
from robot_dynamics_tools.reporting import figures

POSITIONS = 300000
CELLS = 80
"""Number of cells along the longer side of the workspace."""
FINE = 4
"""Points of the drawn map per cell, along each axis."""
SMOOTHING = 1.3
"""Standard deviation of the Gaussian filter of the drawn map, in cells."""


class WorkspaceGravity(NamedTuple):
    """
    Gravity torques as fractions of the effort limits, per cell of the link; NaN if unreachable.

    `across` (k + 1,) and `up` (l + 1,) [m] are the edges of the cells; `most` and `least` (l, k)
    are the largest fraction of any joint, in the worst and in the best pose that reaches the cell.
    `is_plane` is true if `across` is x in the plane of the arm, and false if it is the distance
    from the vertical. `held` is the fraction of all sampled positions that the arm can hold.
    """

    across: FloatArray
    up: FloatArray
    most: FloatArray
    least: FloatArray
    is_plane: bool
    held: float


def limit_ratios(arm: ArmModel, efforts: FloatArray) -> FloatArray:
    """Return the largest |effort| / limit of any joint, (m,) of efforts (m, n); 0 without any."""
    return np.asarray((np.abs(efforts) / arm.limits.effort).max(axis=-1))


def map_gravity(
    arm: ArmModel, link: str, positions: int = POSITIONS, cells: int = CELLS,
) -> WorkspaceGravity:
    """
    Return the map for a link of the arm.

    Raises InvalidInputError for an unknown link, or an arm without any effort limit.
    """
    figure = StickFigure(arm, link)
    if not np.isfinite(arm.limits.effort).any():
        raise InvalidInputError(
            f'robot {arm.name!r} has no effort limit at any of the joints '
            f'{list(arm.joint_names)}, expected at least one in its <limit effort="…">')
    q = sample_positions(arm, positions)
    ratios = limit_ratios(arm, RigidBody(arm).gravity_batch(q))
    places, is_plane = _places(arm, figure.tip(q))
    low, high = places.min(axis=0), places.max(axis=0)
    size = max(float((high - low).max()) / cells, 1e-9)
    counts = np.maximum(np.ceil((high - low) / size - 1e-9).astype(np.intp), 1)
    columns, rows = np.clip(((places - low) / size).astype(np.intp), 0, counts - 1).T
    most = np.full((counts[1], counts[0]), -np.inf)
    least = np.full_like(most, np.inf)
    np.maximum.at(most, (rows, columns), ratios)
    np.minimum.at(least, (rows, columns), ratios)
    empty = np.isneginf(most)
    most[empty] = least[empty] = np.nan
    return WorkspaceGravity(
        low[0] + size * np.arange(counts[0] + 1), low[1] + size * np.arange(counts[1] + 1),
        most, least, is_plane, float((ratios <= 1.0).mean()))


def _places(arm: ArmModel, points: FloatArray) -> tuple[FloatArray, bool]:
    """Return the points (m, 3) in the map, (m, 2) [m], and whether it is the plane of the arm."""
    side, up = side_view(arm, points)
    try:
        plane = PlanarView(arm).plane
        is_plane = bool(abs(plane.normal @ up) < 1e-6)
    except ModelError:
        is_plane = False
    height = points @ up
    if is_plane:
        return np.column_stack([points @ plane.side, height]), True
    away = points - np.outer(height, up)
    return np.column_stack([np.linalg.norm(away, axis=1), height]), False


WIDTH, MAP_HEIGHT, BAR_HEIGHT, BAR_ROOM = 10.4, 5.8, 0.3, 0.9
"""[inch]; BAR_ROOM is the height of the bars' title and axis."""
CHARACTER = 0.01
"""Width of a character of a label, as a fraction of the width of the bars, rounded up."""
_PERCENT = 100.0


def workspace_figure(title: str, arm: ArmModel, link: str, found: WorkspaceGravity) -> Any:
    """
    Return a matplotlib figure: the worst and the best pose by position, and bars by joint.

    The maps and their edges are smoothed. The worst pose of all, from the search of
    `worst_gravity`, is drawn at its position. Raises MissingDependencyError without matplotlib.
    """
    worst = worst_gravity(arm)
    bars = BAR_ROOM + BAR_HEIGHT * arm.joint_count
    with figures.styled_figure(
            WIDTH, MAP_HEIGHT + bars, style={'hatch.color': figures.VERMILION}) as figure:
        figure.suptitle(figures.wrapped_title(title, WIDTH))
        grid = figure.add_gridspec(2, 2, height_ratios=(MAP_HEIGHT, bars))
        most, least = (figure.add_subplot(grid[0, column]) for column in range(2))
        joints = figure.add_subplot(grid[1, :])
        top = max(float(np.nanmax(found.most)), 1e-9)
        _draw_places(
            most, found, found.most, top, 'Worst pose at each position',
            '; black: the worst pose of all' if found.is_plane else '')
        image = _draw_places(least, found, found.least, top, 'Best pose at each position')
        bar = figure.colorbar(image, ax=[most, least], shrink=0.9, aspect=26, pad=0.01)
        bar.set_label('largest share of an effort limit [%]')
        bar.outline.set_visible(False)
        if top > 1.0:
            bar.ax.axhline(_PERCENT, color=figures.VERMILION, linewidth=2.6)
        if found.is_plane:
            q = worst.position[int(np.argmax(worst.effort / arm.limits.effort))]
            points = StickFigure(arm, link).points(q)
            figures.draw_arm(most, points @ side_view(arm, points).T, 2.2)
        _draw_joints(joints, arm, worst.effort)
    return figure


def _draw_places(
    axes: Any, found: WorkspaceGravity, ratios: FloatArray, top: float, title: str, note: str = '',
) -> Any:
    size = float(found.up[1] - found.up[0]) / FINE
    smooth, reached = smoothed(ratios)
    across, up = (
        edges[0] + size * (np.arange(count) + 0.5 - FINE)
        for edges, count in zip((found.across, found.up), smooth.shape[::-1]))
    image = axes.pcolormesh(
        across, up, _PERCENT * smooth, vmin=0.0, vmax=_PERCENT * top, shading='gouraud',
        rasterized=True, cmap=figures.colour_map(figures.POSITIVE_COLOURS))
    beyond = bool(np.nanmax(ratios) > 1.0)
    if beyond:
        axes.contourf(across, up, smooth, levels=[1.0, 2.0 * top], colors='none', hatches=['///'])
        axes.contour(across, up, smooth, levels=[1.0], colors=figures.VERMILION, linewidths=2.4)
    axes.contourf(across, up, reached, levels=[-1.0, 0.5], colors='white', zorder=2.1)
    axes.contour(
        across, up, reached, levels=[0.5], colors=figures.GREY, linewidths=0.8, zorder=2.1)
    axes.set_aspect('equal')
    axes.set(xlabel='x [m]' if found.is_plane else 'distance from the vertical [m]',
             ylabel='height [m]')
    axes.grid(False)
    figures.title_axes(axes, title, ('hatched: above an effort limit' if beyond else (
        'within the effort limits everywhere')) + note)
    return image


def smoothed(cells: FloatArray) -> tuple[FloatArray, FloatArray]:
    """
    Return a map (l, k) through a Gaussian filter, and which fraction of each point is reachable.

    Both have FINE points per cell and a margin of one cell, (FINE (l + 2), FINE (k + 2)). A point
    that is not reachable has the value of its reachable neighbours.
    """
    gaussian_filter = optional('scipy.ndimage', 'a map of the workspace').gaussian_filter

    def blurred(values: FloatArray) -> FloatArray:
        fine = np.kron(np.pad(values, 1), np.ones((FINE, FINE)))
        return np.asarray(gaussian_filter(fine, FINE * SMOOTHING, mode='constant'))

    known = np.isfinite(cells)
    reached = blurred(known.astype(float))
    values = blurred(np.where(known, cells, 0.0))
    return values / np.maximum(reached, 1e-12), reached


def _draw_joints(axes: Any, arm: ArmModel, efforts: FloatArray) -> None:
    ratios = _PERCENT * efforts / arm.limits.effort
    names = arm.joint_names
    places = np.arange(len(names))[::-1]
    colours = [figures.VERMILION if ratio > _PERCENT else figures.BLUE for ratio in ratios]
    axes.barh(places, ratios, 0.62, color=colours)
    axes.axvline(_PERCENT, color=figures.BLACK, linewidth=1.4, linestyle=(0, (4, 2)))
    axes.set_yticks(places, names)
    axes.set_ylim(-0.6, len(names) - 0.4)
    axes.grid(axis='y', visible=False)
    right = 1.25 * max(float(ratios.max()), _PERCENT)
    axes.set(xlim=(0.0, right), xlabel='share of the effort limit [%]')
    for place, ratio, effort, limit, kind in zip(
            places, ratios, efforts, arm.limits.effort, arm.joint_kinds):
        unit = 'N' if kind == 'prismatic' else 'N·m'
        of = f' of {limit:g} {unit}' if np.isfinite(limit) else f' {unit}, no limit'
        label = f'{round(float(effort), 6) + 0.0:.3g}{of}'
        start = ratio + 0.02 * right
        if start < _PERCENT < start + CHARACTER * len(label) * right:  # it would cross the limit
            start = _PERCENT + 0.02 * right
        axes.text(
            start, place, label, va='center', fontsize=10,
            bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 1.0})
    figures.title_axes(axes, 'Largest gravity effort of each joint; dashed: its limit')
