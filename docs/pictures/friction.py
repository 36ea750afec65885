# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Draw docs/images/friction.png: the curve of friction, and a joint that sticks and slips."""

from pathlib import Path
import sys
from typing import Any

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
import numpy as np
from robot_dynamics.arm_model import load_arm
from robot_dynamics.friction import make_friction
from robot_dynamics.planar_urdf import planar_arm_urdf
from robot_dynamics.plotting import BLACK, BLUE, GREEN, GREY, ORANGE, STYLE, VERMILION
from robot_dynamics.simulation import ArmSimulation

STIFFNESS, PULL, PERIOD, SAMPLES = 20.0, 0.2, 1e-3, 4000


def stick_slip() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time, position and spring torque of a joint pulled by a spring."""
    arm = load_arm(planar_arm_urdf([2.0], [1.0], [0.5], [0.1]), gravity=(0.0, 0.0, 0.0))
    arm = arm.with_friction(make_friction(
        arm.joint_names, coulomb=[0.8], static=[1.5], stribeck_velocity=[0.02]))
    simulation = ArmSimulation(arm)
    simulation.release()
    rows = []
    for k in range(SAMPLES):
        q = simulation.q[0]
        torque = STIFFNESS * (PULL * k * PERIOD - q)
        rows.append((k * PERIOD, q, torque))
        simulation.step(np.array([torque]), PERIOD)
    t, q, torque = np.array(rows).T
    return t, q, torque


def draw_curve(axes: Any) -> None:
    curves = {
        'Coulomb': ({'coulomb': [1.0]}, GREY, (0, (1, 1))),
        '+ viscous': ({'coulomb': [1.0], 'viscous': [0.4]}, BLUE, (0, (4, 2))),
        '+ Stribeck': (
            {'coulomb': [1.0], 'viscous': [0.4], 'static': [1.6], 'stribeck_velocity': [0.1]},
            VERMILION, '-'),
        '+ offset': (
            {'coulomb': [1.0], 'viscous': [0.4], 'static': [1.6], 'stribeck_velocity': [0.1],
             'offset': [0.3]}, GREEN, (0, (6, 1, 1, 1))),
    }
    for name, (parameters, colour, dash) in curves.items():
        friction = make_friction(('joint',), **parameters)
        for side in (-1.0, 1.0):
            v = side * np.linspace(1e-6, 1.0, 400)
            axes.plot(v, friction.effort(v[:, None])[:, 0], color=colour, linestyle=dash,
                      label=name if side > 0.0 else None)
    smooth = make_friction(('joint',), **curves['+ Stribeck'][0])
    v = np.linspace(-0.05, 0.05, 201)
    axes.plot(v, smooth.smooth_effort(v[:, None])[:, 0], color=BLACK, linewidth=0.9,
              label='as compensated')
    axes.set(xlabel='velocity [rad/s]', ylabel='friction [N·m]', title='What friction takes')
    axes.legend(frameon=False)


def main(directory: Path) -> None:
    """Write the picture into a directory."""
    t, q, torque = stick_slip()
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(13.0, 3.6), layout='constrained')
        FigureCanvasAgg(figure)
        curve, motion, effort = figure.subplots(1, 3)
        draw_curve(curve)
        motion.plot(t, PULL * t, color=ORANGE, linewidth=3.0, label='end of the spring')
        motion.plot(t, q, color=BLUE, label='joint')
        motion.set(xlabel='time [s]', ylabel='position [rad]',
                   title='A joint pulled by a slow spring sticks and slips')
        motion.legend(frameon=False)
        effort.plot(t, torque, color=BLACK)
        moves = np.diff(q, append=q[-1]) != 0.0
        leaves = np.flatnonzero(moves[1:] & ~moves[:-1]) + 1
        effort.plot(t[leaves], torque[leaves], 'o', color=VERMILION, label='the joint breaks away')
        effort.axhline(1.5, color=VERMILION, linestyle='--', label='static friction F_s')
        effort.axhline(0.8, color=GREY, linestyle=':', label='Coulomb friction F_c')
        effort.set(xlabel='time [s]', ylabel='torque of the spring [N·m]',
                   title='It breaks away at F_s')
        effort.set_ylim(top=2.9)
        effort.legend(frameon=False, loc='upper right')
        figure.savefig(directory / 'friction.png')


if __name__ == '__main__':
    main(Path(sys.argv[1]))
