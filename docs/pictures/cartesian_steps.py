# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Draw docs/images/cartesian_steps.png: steps and pushes with `cartesian_impedance` and D = 2√K.

The steps are those that test/control/test_modal_impedance.py checks, with rotors: without
rotors D = 2√K diverges for most arms. The largest values are printed.
"""

from pathlib import Path
import sys

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control import ControlLaw, LawInput
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.task_space.frame_kinematics import FrameKinematics, last_link, rotation_vector
from robot_dynamics_tools.reporting.figures import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    styled_figure,
    VERMILION,
)

sys.path.insert(0, str(Path(__file__).parents[2] / 'test' / 'support'))
from cartesian_arm import CartesianArm, ROBOTS, STIFFNESS  # noqa: E402
from lock_step_loop import smooth_arm  # noqa: E402

CONDITIONS = ((1000, 0), (250, 8))
"""Rate of the joint states [Hz], and delay of the efforts [ms]."""
COLORS = dict(zip(ROBOTS, (BLUE, ORANGE, GREEN, PURPLE, VERMILION)))
SECONDS = 1.2
FORCE, PULSE = 20.0, 0.3
"""Of a push [N], [s]."""
MOTIONS = ('step of 5 cm', 'step of 0.3 rad', 'push of 20 N for 0.3 s')
LIMITS = ((-0.1, 1.4), (-0.1, 1.4), (-0.05, 0.08))


class UnitMass(ControlLaw):
    """
    The same spring with the damping D = 2√K, which is critical for a mass of 1 kg.

    The posture has 5 N·m/rad in the null space, and its damping 2√5. Nothing scales the gains.
    """

    def __init__(self, arm: ArmModel) -> None:
        self._K, self._kinematics = STIFFNESS, FrameKinematics(arm, last_link(arm))

    def effort(self, state: LawInput) -> FloatArray:
        """Return C q̇ + g + Jᵀ (K e − D J q̇), and the effort of the posture."""
        e_q, body = state.position_error, state.dynamics.rigid_body
        p_ref, R_ref = self._kinematics.pose(state.q + e_q)
        p, R, J = self._kinematics.jacobian(state.q)
        e = np.concatenate([p_ref - p, rotation_vector(R_ref @ R.T)])
        posture = 5.0 * e_q - 2.0 * np.sqrt(5.0) * state.v
        N = np.eye(len(e_q)) - np.linalg.pinv(J) @ J
        return body.nonlinear(state.q, state.v) + N @ posture + J.T @ (
            self._K * e - 2.0 * np.sqrt(self._K) * (J @ state.v))


def run(arm: CartesianArm, motion: str) -> FloatArray:
    """Return the share of the way, or the displacement [m], for each ms."""
    if motion == MOTIONS[0]:
        return arm.step(2, 0.05, SECONDS)
    return arm.step(4, 0.3, SECONDS) if motion == MOTIONS[1] else (
        arm.pushed(1, FORCE, PULSE, SECONDS))


def main(directory: Path) -> None:
    """Write the picture into a directory."""
    with styled_figure(12.0, 6.4) as figure:
        grid = figure.subplots(len(CONDITIONS), len(MOTIONS), sharex=True)
        for row, (rate, delay) in zip(grid, CONDITIONS):
            for axes, motion, limits in zip(row, MOTIONS, LIMITS):
                for robot, color in COLORS.items():
                    for unit_mass, style in ((True, ':'), (False, '-')):
                        try:
                            law = UnitMass(smooth_arm(robot)) if unit_mass else None
                            way = run(CartesianArm(robot, rate, delay, True, law), motion)
                        except RobotDynamicsError:  # it has diverged
                            continue
                        axes.plot(
                            1e-3 * np.arange(len(way)), way, color=color, linestyle=style,
                            linewidth=1.0 if unit_mass else 2.0,
                            label=None if unit_mass else robot)
                        print(f'{robot} {rate} Hz {delay} ms {motion} '
                              f'{"D = 2√K" if unit_mass else "cartesian_impedance"}: largest '
                              f'{way.max():.3f}{", diverges" if len(way) < 1000 else ""}')
                axes.set(ylim=limits, title=f'{motion}, {rate} Hz, {delay} ms')
        for axes in grid[-1]:
            axes.set_xlabel('time [s]')
        for row in grid:
            row[0].set_ylabel('share of the way')
            row[2].set_ylabel('displacement [m]')
        grid[0][0].plot([], [], color=GREY, linestyle=':', label='D = 2√K')
        handles, labels = grid[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc='outside lower center', ncols=len(ROBOTS) + 1)
        figure.savefig(directory / 'cartesian_steps.png')


if __name__ == '__main__':
    main(Path(sys.argv[1]))
