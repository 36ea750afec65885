# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Draw docs/images/mujoco_arm.png: a Panda in MuJoCo touches a table.

The arm is the one of test_mujoco_loop.py, with a table 4 cm above the goal.
"""

from pathlib import Path
import sys
from typing import Any

import numpy as np
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from robot_dynamics_tools.reporting.figures import BLUE, GREY, styled_figure, VERMILION

for place in ('test', 'robot_dynamics_tools/test'):
    sys.path.insert(0, str(Path(__file__).parents[2] / place / 'support'))
import mujoco_plant as plants  # noqa: E402

STEP = 0.002
GOAL = [0.0, 0.35, 0.0, -1.87, 0.0, 2.22, -0.785]
ABOVE_GOAL, RADIUS = 0.04, 0.02
"""[m]: of the table, and of the tool."""
BEGIN, END = 1.0, 5.0
"""[s]"""
SHOWN = {'panda_joint2': BLUE, 'panda_joint4': VERMILION}


def links(simulation: Any) -> Any:
    """Return x and z of the joints and the tool [m]."""
    points = simulation.data.xpos
    return np.array([[0.0, 0.0, 0.0], *points[1:]])[:, [0, 2]]


def main(directory: Path) -> Path:
    """Write the figure; return its path."""
    table = plants.tool_height('panda', np.array(GOAL)) - RADIUS + ABOVE_GOAL
    simulation = plants.foreign_simulation('panda', floor=table)
    arm = plants.given_arm('panda')
    loop = ControlLoop.of_arm(arm)
    simulation.release()
    rows, poses = [], [links(simulation)]
    for k in range(round(END / STEP)):
        if k == round(BEGIN / STEP):
            loop.follow(make_trajectory(arm.joint_names, [0.0], [GOAL]))
        effort = loop.answer(round(1e9 * (1.0 + k * STEP)), *simulation.state).effort
        assert effort is not None
        simulation.step(effort, STEP)
        rows.append((k * STEP, plants.contact_force(simulation), *effort))
    poses.append(links(simulation))
    t, force, *efforts = np.array(rows).T
    with styled_figure(10.0, 3.8) as figure:
        scene, forces, torques = figure.subplots(1, 3, width_ratios=(1.2, 1.0, 1.0))
        for pose, colour, name in zip(poses, (GREY, BLUE), ('start', 'at the end')):
            scene.plot(*pose.T, '-o', color=colour, linewidth=3.0, markersize=4.0, label=name)
        scene.axhline(table, color=VERMILION, linewidth=2.0, label='table')
        scene.set(xlabel='x [m]', ylabel='z [m]', title='Joints and tool')
        scene.set_aspect('equal', adjustable='datalim')
        forces.plot(t, force, color=VERMILION)
        forces.set(xlabel='time [s]', ylabel='contact force [N]', title='Force on the table')
        for name, colour in SHOWN.items():
            torques.plot(
                t, efforts[arm.joint_names.index(name)], color=colour,
                label=name.removeprefix('panda_'))
        torques.set(xlabel='time [s]', ylabel='command [N·m]', title='Commanded effort')
        scene.legend(loc='lower center', frameon=False)
        torques.legend(loc='lower right', frameon=False)
        path = directory / 'mujoco_arm.png'
        figure.savefig(path, dpi=100)
    print(f'{path}: force {force[-1]:.1f} N at the end, largest {force.max():.1f} N')
    return path


if __name__ == '__main__':
    main(Path(sys.argv[1]))
