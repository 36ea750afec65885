# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/images/actuator.png: torque–speed envelope, efficiency, a current loop at work."""

from pathlib import Path
import sys

import numpy as np
from robot_dynamics.joints.actuator import Actuators, make_actuators
from robot_dynamics.model.arm import load_arm
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics.simulation.current_loop import CurrentLoop
from robot_dynamics_tools.reporting.figures import (
    BLUE,
    GREEN,
    legend_below,
    ORANGE,
    styled_figure,
    VERMILION,
)


def motor(efficiency: float) -> Actuators:
    return make_actuators(
        ('joint1',), [0.05], [100.0], resistance=[0.8], inductance=[1e-2], rotor_inertia=[2e-5],
        efficiency=[efficiency], current_limit=[16.0], voltage_limit=[24.0],
        current_time_constant=[1e-3])


def main(directory: Path) -> None:
    """Write the picture into a directory."""
    with styled_figure(12.0, 4.2) as figure:
        envelope, needed, step = figure.subplots(1, 3)

        v = np.linspace(-7.0, 7.0, 561)[:, None]
        for efficiency, colour, dash in ((1.0, BLUE, '-'), (0.7, VERMILION, (0, (5, 2)))):
            low, high = motor(efficiency).effort_range(v)
            envelope.plot(v, low, color=colour, linestyle=dash, linewidth=1.8)
            envelope.plot(v, high, color=colour, linestyle=dash, linewidth=1.8,
                          label=f'efficiency {efficiency}')
        envelope.set(xlabel='joint velocity [rad/s]', ylabel='joint effort [N·m]',
                     title='Steady torque–speed envelope')
        legend_below(envelope, 2)

        effort = np.linspace(-40.0, 40.0, 401)[:, None]
        for speed, colour, dash in ((1.0, GREEN, '-'), (-1.0, ORANGE, (0, (5, 2)))):
            current = motor(0.7).load(effort, np.array([speed]), np.zeros(1)).current
            needed.plot(effort, current, color=colour, linestyle=dash, linewidth=1.8,
                        label=f'{speed:+.0f} rad/s'.replace('-', '−'))
        needed.set(xlabel='joint effort [N·m]', ylabel='current [A]',
                   title='Current at efficiency 0.7')
        legend_below(needed, 2)

        arm = load_arm(planar_arm_urdf([2.0], [1.0], [0.5], [0.1]))
        for wanted, colour, dash in ((10.0, GREEN, '-'), (50.0, VERMILION, (0, (5, 2)))):
            drive, rest, rows = CurrentLoop(motor(1.0)), np.zeros(arm.joint_count), []
            for k in range(200):
                rows.append((0.1 * k, drive.current[0]))
                drive.effort_over_step(np.array([wanted]), rest, 1e-4)
            t, i = np.array(rows).T
            step.plot(t, i, color=colour, linestyle=dash, linewidth=1.8,
                      label=f'step to {wanted:g} N·m')
        step.set(xlabel='time [ms]', ylabel='current [A]',
                 title='Current loop: step responses')
        legend_below(step, 2)
        figure.savefig(directory / 'actuator.png')


if __name__ == '__main__':
    main(Path(sys.argv[1]))
