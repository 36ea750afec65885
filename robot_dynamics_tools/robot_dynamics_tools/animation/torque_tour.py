# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
How joint efforts vary over the positions of two joints in motion: the arm, and a map per joint.

Both joints run through their ranges, q = middle + reach (sin s, sin 2s). The same motion is shown
once per phase: what gravity takes, what the acceleration, what the velocity, and all together. A
map shows this effort at all positions, for the velocity and acceleration of the moment.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

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


class _Motion(NamedTuple):
    """Motion (FRAMES, n) of an arm, and its joints in the image (FRAMES, k, 2) [m]."""

    q: FloatArray
    v: FloatArray
    a: FloatArray
    points: FloatArray


def torque_frames(arm: ArmModel, grid: PositionGrid, joints: Sequence[int]) -> Iterator[Frame]:
    """Yield the frames of all phases; `joints` are those whose effort is drawn."""
    body, motion = RigidBody(arm), _motion(arm, grid)
    for number, (name, factors) in enumerate(PHASES.items(), 1):
        states = [(q, factors[0] * v, factors[1] * a, factors[2])
                  for q, v, a in zip(motion.q, motion.v, motion.a)]
        maps = np.array([rigid_body_efforts(body, grid, *state[1:]) for state in states])
        along = np.array([
            body.inverse_dynamics(q, v, a) - (1.0 - share) * body.gravity(q)
            for q, v, a, share in states])
        with figures.styled_figure(4.0 * (len(joints) + 1), 4.3) as figure:
            figure.set_dpi(DPI)
            figure.suptitle(f'{number} of {len(PHASES)}: {name}', fontweight='bold')
            stage, *axes = figure.subplots(1, len(joints) + 1)
            draw = [_arm(stage, motion), *(
                _map(figure, one, arm, grid, joint, maps, along, motion.q)
                for one, joint in zip(axes, joints))]
            for k in range(FRAMES):
                for one in draw:
                    one(k)
                yield Frame(pixels(figure), PERIOD / FRAMES)


def _motion(arm: ArmModel, grid: PositionGrid) -> _Motion:
    q = np.tile(grid.positions[0, 0], (FRAMES, 1))
    v, a = np.zeros_like(q), np.zeros_like(q)
    s = 2.0 * np.pi * np.arange(FRAMES) / FRAMES
    for joint, values, rate in zip(grid.joints, (grid.x, grid.y), (1.0, 2.0)):
        reach, w = REACH * float(np.ptp(values)), 2.0 * np.pi * rate / PERIOD
        q[:, joint] = values.mean() + reach * np.sin(rate * s)
        v[:, joint] = reach * w * np.cos(rate * s)
        a[:, joint] = -reach * w**2 * np.sin(rate * s)
    return _Motion(q, v, a, side_lines(arm, q))


def _arm(axes: Any, motion: _Motion) -> Callable[[int], None]:
    """Return a function that draws the arm in a frame."""
    half = 1.1 * float(np.abs(motion.points).max())
    axes.set(xlim=(-half, half), ylim=(-half, half), aspect='equal', xlabel='[m]')
    line, = axes.plot([], [], 'o-', color=figures.BLACK, linewidth=4.0)

    def draw(k: int) -> None:
        line.set_data(*motion.points[k].T)
        axes.set_title(f'v = {motion.v[k].round(1)},\na = {motion.a[k].round(1)}')

    return draw


def _map(
    figure: Any, axes: Any, arm: ArmModel, grid: PositionGrid, joint: int, maps: FloatArray,
    along: FloatArray, q: FloatArray,
) -> Callable[[int], None]:
    """Return a function that draws the effort of a joint in a frame."""
    largest = max(float(np.abs(maps[..., joint]).max()), 1e-9)
    unit, names = units_of(arm.joint_kinds[joint]).effort, arm.joint_names
    image = axes.pcolormesh(
        grid.x, grid.y, maps[0, ..., joint], vmin=-largest, vmax=largest, shading='nearest',
        cmap=figures.colour_map(figures.SIGNED_COLOURS), rasterized=True)
    figure.colorbar(image, ax=axes, shrink=0.8, label=f'effort at {names[joint]} [{unit}]')
    path = q[:, list(grid.joints)]
    axes.plot(*np.vstack([path, path[:1]]).T, color=figures.GREY, linewidth=0.8)
    dot, = axes.plot([], [], 'o', color=figures.BLACK)
    label_axes(axes, arm, grid)
    axes.grid(False)

    def draw(k: int) -> None:
        image.set_array(maps[k, ..., joint])
        dot.set_data(*path[k][:, None])
        axes.set_title(
            f'{names[joint]}: {along[k, joint]:+.1f} {unit}', fontweight='bold', parse_math=False)

    return draw
