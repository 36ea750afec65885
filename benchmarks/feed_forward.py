# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Drives with their own position loop, with and without the feed-forward of `dynamics`.

Drives with the gains of small arms hold an arm, and move it by 0.4 rad in 2 s, with a correct
model. Compared: the drives alone, with `~/feed_forward`, with `~/position_offset`, and computed
torque. The plant is `SimulatedRobot`, with drives at 1 kHz and efforts that act 2 ms late.
"""

import argparse
from collections import deque
from collections.abc import Sequence
from pathlib import Path
import sys
from typing import NamedTuple

from benchmarks.safe_motion_cases import arm_named
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.feed_forward import FeedForward
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics.simulation.drive_loop import DriveLoop
from robot_dynamics.simulation.plant import InnerController, SimulatedRobot
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from robot_dynamics_tools.reporting.figures import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    save_figure,
    styled_figure,
    VERMILION,
)

ARMS, RATES = ('z1', 'panda', 'ur10'), (500, 250, 100)
"""Arms, and rates of the joint states [Hz]."""
PROXIMAL, DISTAL = 240.0, (31.0, 16.0)
"""k_p [N·m/rad] of the first four joints, and of the next ones."""
DAMPING_RATIO, LARGEST_DAMPING = 0.7, 5.0
"""Of k_d, with the inertia at the start; k_d [N·m·s/rad] of a DM4310 at most."""
FASTEST, ROTOR = 500.0, 0.01
"""[rad/s²]: effort limit / inertia of a rotor; inertia [kg·m²] without an effort limit."""
DELAY = 2
"""[ms] until a command acts."""
HOLD, MOVE, REST = 2.0, 2.0, 1.0
"""[s]"""
SIZE = 0.4
"""[rad]"""
PEAK = 1.5
"""Velocity in the middle of the motion, by the mean velocity."""
MODES = ('drives alone', 'feed-forward', 'position offset', 'computed torque')
COLOURS = dict(zip(MODES, (VERMILION, BLUE, GREEN, BLACK)))
FIRST_STAMP, MS = 1_000_000_000, 1_000_000


class Result(NamedTuple):
    """Errors (m, n) [rad], one row per ms; the sag at the end of the hold, and RMS in motion."""

    errors: FloatArray

    @property
    def sag(self) -> float:
        """The largest error [rad] of a joint after the hold."""
        return float(np.abs(self.errors[round(1e3 * HOLD) - 1]).max())

    @property
    def rms(self) -> float:
        """The root mean square [rad] over motion and joints."""
        moving = self.errors[round(1e3 * HOLD):round(1e3 * (HOLD + MOVE))]
        return float(np.sqrt((moving**2).mean()))


def with_rotors(arm: ArmModel) -> ArmModel:
    """Return the arm with the rotors of its drives, which most descriptions lack."""
    limit = arm.limits.effort
    return arm.with_reflected_inertia(np.where(
        np.isfinite(limit), limit / FASTEST, ROTOR) + arm.reflected_inertia)


def drives_of(
    arm: ArmModel, q: FloatArray, largest_damping: float = LARGEST_DAMPING,
) -> DriveLoop:
    """Return drives with the stiffness of small arms, and a damping for the inertia at q (n,)."""
    n = arm.joint_count
    stiffness = np.array([PROXIMAL] * 4 + [DISTAL[0]] + [DISTAL[1]] * n)[:n]
    M = np.diagonal(ArmDynamics(arm).rigid_body.mass_matrix(q))
    damping = np.minimum(2.0 * DAMPING_RATIO * np.sqrt(stiffness * M), largest_damping)
    return DriveLoop(stiffness, damping, arm.limits.effort)


def middle_of(arm: ArmModel) -> FloatArray:
    """Return the middle of the position limits (n,), 0 without limits."""
    return np.array([
        0.5 * (low + high) if np.isfinite([low, high]).all() else 0.0
        for low, high in zip(arm.limits.lower, arm.limits.upper)])


def run(arm: ArmModel, mode: str, rate: int) -> Result:
    """Hold the arm in the middle of its limits, and move all joints."""
    start = middle_of(arm)
    loop, drives = ControlLoop.of_arm(arm, following_error=0.0), drives_of(arm, start)
    feed_forward = FeedForward(loop)
    plant = SimulatedRobot(
        ArmSimulation(arm, start), InnerController(arm, EffortConvention()), True,
        np.random.default_rng(0))
    plant.drive_loop = None if mode == 'computed torque' else drives
    goal = start + SIZE * np.where(np.arange(len(start)) % 2, -1.0, 1.0)
    trajectory = make_trajectory(
        arm.joint_names, [0.5 * MOVE, MOVE], [0.5 * (start + goal), goal],
        [(goal - start) / MOVE * PEAK, np.zeros_like(goal)])
    pending, errors, period = deque[tuple[int, FloatArray]](), [], round(1000 / rate)
    for k in range(round(1e3 * (HOLD + MOVE + REST))):
        stamp = FIRST_STAMP + k * MS
        if k == round(1e3 * HOLD):
            loop.follow(trajectory)
        if k % period == 0:
            q, v = plant.simulation.state
            answer = loop.answer(stamp, q, v)
            command = feed_forward.command(answer)
            assert command is not None
            assert answer.effort is not None
            position, velocity, effort = command
            if mode == 'drives alone':
                effort = np.zeros_like(effort)
            elif mode == 'position offset':
                position = command.position_offset(
                    drives.stiffness, arm.limits.lower, arm.limits.upper)
                effort = np.zeros_like(effort)
            pending.append((k + DELAY, answer.effort if mode == 'computed torque' else (
                np.array([position, velocity, effort]))))
        while pending and pending[0][0] <= k:
            plant.take_effort(pending.popleft()[1])
        plant.step(1e-3)
        active = loop.controller.trajectory
        assert active is not None, loop.supervisor.fault
        errors.append(active.sample(stamp + MS).position - plant.simulation.state.position)
    return Result(np.array(errors))


def main(argv: Sequence[str] = ()) -> None:
    """Print the table; with `--figure` plot the errors of the first arm."""
    parser = argparse.ArgumentParser(
        prog='python -m benchmarks.feed_forward', description=__doc__)
    parser.add_argument('--figure', type=Path, metavar='FILE', help='plot of the errors (PNG)')
    parser.add_argument('--arms', nargs='+', default=list(ARMS), metavar='ARM')
    arguments = parser.parse_args(argv)
    print('| arm, joint states | ' + ' | '.join(
        f'{mode}: sag, RMS in motion [mrad]' for mode in MODES) + ' |')
    print('| --- |' + ' ---: |' * len(MODES))
    for name in arguments.arms:
        for rate in RATES:
            found = {mode: run(with_rotors(arm_named(name)), mode, rate) for mode in MODES}
            print(f'| {name}, {rate} Hz | ' + ' | '.join(
                f'{1e3 * one.sag:.2f}, {1e3 * one.rms:.2f}' for one in found.values()) + ' |')
            if arguments.figure is not None and (name, rate) == (arguments.arms[0], RATES[0]):
                draw(name, found, arguments.figure)


def draw(name: str, found: dict[str, Result], path: Path) -> None:
    """Plot the largest error of all joints over time, logarithmically."""
    with styled_figure(10.0, 4.5) as figure:
        axes = figure.subplots()
        axes.axvspan(HOLD, HOLD + MOVE, color=GREY, alpha=0.15)
        axes.text(HOLD + 0.05, 2e-3, 'motion', color=GREY)
        for mode, result in found.items():
            largest = 1e3 * np.abs(result.errors).max(axis=1)
            t = 1e-3 * np.arange(1, len(largest) + 1)
            axes.semilogy(t, np.maximum(largest, 1e-3), color=COLOURS[mode], label=mode,
                          linestyle='--' if mode == 'position offset' else '-')
        axes.set(xlabel='time [s]', ylabel='largest error of a joint [mrad]')
        axes.set_title(f'{name}, joint states at {RATES[0]} Hz')
        figure.legend(loc='outside lower center', ncols=len(MODES), frameon=False)
        save_figure(figure, path)


if __name__ == '__main__':
    main(sys.argv[1:])
