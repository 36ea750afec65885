# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
How joint efforts vary over the positions of two joints in motion: the arm, and a map per joint.

Both joints run through their ranges, q = middle + reach (sin s, sin 2s). The same motion is shown
once per phase: what gravity takes, what the acceleration, what the velocity, and all together. A
map shows this effort at all positions, for the velocity and acceleration of the moment.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.units import units_of
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics_tools.animation.chain_animation import pixels
from robot_dynamics_tools.animation.video import Frame
from robot_dynamics_tools.pictures.stick_figure import side_lines
from robot_dynamics_tools.pictures.torque_grid import PositionGrid, rigid_body_efforts
from robot_dynamics_tools.pictures.torque_map import label_axes
from robot_dynamics_tools.reporting import figures

PHASES = {
    'gravity g(q)': (0, 0, 1), 'inertia M(q) a': (0, 1, 0), 'Coriolis C(q, v) v': (1, 0, 0),
    'all: M a + C v + g': (1, 1, 1)}
"""The phases, each with the factors of velocity, acceleration and gravity."""
FRAMES, PERIOD = 36, 8.0
"""Frames and duration [s] of a phase."""
REACH = 0.45
"""Amplitude as a fraction of the range of a joint."""
DPI = 80


def torque_frames(arm: ArmModel, grid: PositionGrid, joints: Sequence[int]) -> Iterator[Frame]:
    """Yield the frames of all phases; `joints` are those whose effort is drawn."""
    body, (q, v, a) = RigidBody(arm), _motion(grid)
    points, path = side_lines(arm, q), q[:, grid.joints]
    half = 1.1 * float(np.abs(points).max())
    units = [units_of(arm.joint_kinds[joint]).effort for joint in joints]
    for number, (name, (of_v, of_a, of_g)) in enumerate(PHASES.items(), 1):
        maps = np.array([rigid_body_efforts(body, grid, of_v * rate, of_a * change, of_g)
                         for rate, change in zip(v, a)])
        along = body.inverse_dynamics_batch(q, of_v * v, of_a * a) - (
            1.0 - of_g) * body.gravity_batch(q)
        with figures.styled_figure(4.0 * (len(joints) + 1), 4.3) as figure:
            figure.set_dpi(DPI)
            figure.suptitle(f'{number} of {len(PHASES)}: {name}', fontweight='bold')
            stage, *axes = figure.subplots(1, len(joints) + 1)
            stage.set(xlim=(-half, half), ylim=(-half, half), aspect='equal', xlabel='[m]')
            line, = stage.plot([], [], 'o-', color=figures.BLACK, linewidth=4.0)
            drawn = []
            for one, joint, unit in zip(axes, joints, units):
                image = _map(figure, one, grid, maps[..., joint],
                             f'effort at {arm.joint_names[joint]} [{unit}]')
                one.plot(*np.vstack([path, path[:1]]).T, color=figures.GREY, linewidth=0.8)
                drawn.append((image, *one.plot([], [], 'o', color=figures.BLACK)))
                label_axes(one, arm, grid)
                one.grid(False)
            for k in range(FRAMES):
                line.set_data(*points[k].T)
                stage.set_title(f'v = {v[k].round(1)},\na = {a[k].round(1)}')
                for one, joint, unit, (image, dot) in zip(axes, joints, units, drawn):
                    image.set_array(maps[k, ..., joint])
                    dot.set_data(*path[k][:, None])
                    one.set_title(f'{arm.joint_names[joint]}: {along[k, joint]:+.1f} {unit}',
                                  fontweight='bold', parse_math=False)
                yield Frame(pixels(figure), PERIOD / FRAMES)


def _motion(grid: PositionGrid) -> FloatArray:
    """Return position, velocity and acceleration, (3, FRAMES, n)."""
    q = np.tile(grid.positions[0, 0], (FRAMES, 1))
    v, a = np.zeros_like(q), np.zeros_like(q)
    s = 2.0 * np.pi * np.arange(FRAMES) / FRAMES
    for joint, values, rate in zip(grid.joints, (grid.x, grid.y), (1.0, 2.0)):
        reach, w = REACH * float(np.ptp(values)), 2.0 * np.pi * rate / PERIOD
        q[:, joint] = values.mean() + reach * np.sin(rate * s)
        v[:, joint] = reach * w * np.cos(rate * s)
        a[:, joint] = -reach * w**2 * np.sin(rate * s)
    return np.array([q, v, a])


def _map(figure: Any, axes: Any, grid: PositionGrid, maps: FloatArray, label: str) -> Any:
    """Draw the first of the maps (FRAMES, l, k), with the scale of all."""
    largest = max(float(np.abs(maps).max()), 1e-9)
    image = axes.pcolormesh(
        grid.x, grid.y, maps[0], vmin=-largest, vmax=largest, shading='nearest',
        cmap=figures.colour_map(figures.SIGNED_COLOURS), rasterized=True)
    figure.colorbar(image, ax=axes, shrink=0.8, label=label)
    return image
