# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Draw docs/images/friction.png: the curve of friction, and a joint that sticks and slips.

The joint is that of the running simulated arm, in the run of
robot_dynamics_tools/test/support/stick_slip.py.
"""

import os
from pathlib import Path
import sys
import tempfile
from typing import Any

import numpy as np
from robot_dynamics.joints.friction import make_friction
from robot_dynamics_tools.demo.processes import choose_domain
from robot_dynamics_tools.reporting.figures import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    legend_below,
    ORANGE,
    PURPLE,
    styled_figure,
    VERMILION,
)

for place in ('test', 'robot_dynamics_tools/test'):
    sys.path.insert(0, str(Path(__file__).parents[2] / place / 'support'))
import stick_slip as run  # noqa: E402


def stick_slip() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time, position and spring torque of a joint pulled by a spring, as simulated."""
    os.environ.update(choose_domain(os.environ))
    with tempfile.TemporaryDirectory() as directory:
        series = run.read_stick_slip(run.record_stick_slip(Path(directory)))
    return series.stamps_ns / 1e9, series.position[:, 0], series.effort[:, 0]


def draw_curve(axes: Any) -> None:
    sliding = {'coulomb': [1.0], 'viscous': [0.4]}
    stribeck = {**sliding, 'static': [1.6], 'stribeck_velocity': [0.1]}
    curves = {
        'Coulomb': ({'coulomb': [1.0]}, GREY, (0, (1, 1))),
        'Coulomb, viscous': (sliding, BLUE, (0, (4, 2))),
        'and Stribeck': (stribeck, VERMILION, '-'),
        'and offset': ({**stribeck, 'offset': [0.3]}, GREEN, (0, (6, 1, 1, 1))),
        'sigmoid, viscous': (
            {'viscous': [0.4], 'sigmoid': [0.5], 'sigmoid_velocity': [0.1]}, PURPLE,
            (0, (6, 2))),
    }
    for name, (parameters, colour, dash) in curves.items():
        friction = make_friction(('joint',), **parameters)
        for side in (-1.0, 1.0):
            v = side * np.linspace(1e-6, 1.0, 400)
            axes.plot(v, friction.effort(v[:, None])[:, 0], color=colour, linestyle=dash,
                      linewidth=1.8, label=name if side > 0.0 else None)
    smooth = make_friction(('joint',), **stribeck)
    v = np.linspace(-0.05, 0.05, 201)
    axes.plot(v, smooth.smooth_effort(v[:, None])[:, 0], color=BLACK, linewidth=1.0,
              label='as compensated')
    axes.set(xlabel='velocity [rad/s]', ylabel='friction [N·m]', title='Friction models',
             xticks=[-1.0, -0.5, 0.0, 0.5, 1.0])
    legend_below(axes, 2)


def draw_motion(axes: Any, t: np.ndarray, q: np.ndarray) -> None:
    axes.plot(t, [run.pulled_to(time) for time in t], color=ORANGE, linestyle=(0, (5, 2)),
              linewidth=2.0, label='end of the spring')
    axes.plot(t, q, color=BLUE, linewidth=1.8, label='joint')
    axes.set(xlabel='time [s]', ylabel='position [rad]',
             title='Simulated: a spring pulls a joint')
    legend_below(axes, 2)


def draw_torque(axes: Any, t: np.ndarray, q: np.ndarray, torque: np.ndarray) -> None:
    axes.plot(t, torque, color=BLACK, linewidth=1.2, label='torque of the spring')
    moves = np.diff(q) != 0.0
    leaves = np.flatnonzero(moves[1:] & ~moves[:-1]) + 2
    axes.plot(t[leaves], torque[leaves], 'o', color=VERMILION, label='joint breaks away')
    for name, size, colour, dash in (
            ('± static friction', run.STATIC, VERMILION, '--'),
            ('± Coulomb friction', run.COULOMB, GREY, ':')):
        axes.axhline(size, color=colour, linestyle=dash, linewidth=1.6, label=name)
        axes.axhline(-size, color=colour, linestyle=dash, linewidth=1.6)
    axes.set(xlabel='time [s]', ylabel='torque [N·m]',
             title='Simulated: break-away at static friction')
    legend_below(axes, 2)


def main(directory: Path) -> None:
    """Write the picture into a directory."""
    t, q, torque = stick_slip()
    with styled_figure(12.0, 4.4) as figure:
        curve, motion, effort = figure.subplots(1, 3)
        draw_curve(curve)
        draw_motion(motion, t, q)
        draw_torque(effort, t, q, torque)
        figure.savefig(directory / 'friction.png')


if __name__ == '__main__':
    main(Path(sys.argv[1]))
