# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Random plans with the fastest timing, executed within tolerances: `retime`, then `execute`.

A plan is a path through random positions, with rounded corners and the timing of `retime`. A run
executes it in lock-step with a simulated arm whose efforts act 2 ms late. A third of the runs have
no disturbance, a third have 42 ms without joint states, and in a third a set-point at the start
replaces the plan at a random time; a second plan follows from there.

A run is bad if the last plan has another result than SUCCESSFUL, or the arm is too fast.
"""

import argparse
from collections import deque
from collections.abc import Sequence
import sys
import time
from typing import NamedTuple

from benchmarks.feed_forward import middle_of, with_rotors
from benchmarks.safe_motion_cases import arm_named
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.options import default_effort_rates
from robot_dynamics.control.trajectory_goal import ResultCode, Tolerances, TrajectoryGoal
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics.trajectories.retiming import retime

ARMS = ('two_link', 'ur10', 'panda')
CASES = ('undisturbed', 'gap of 42 ms', 'preempted')
RUNS = 100
SHARE = 0.8
"""Usable share of the effort limits and their rates in a plan; the rest is for the feedback."""
CORNER, TOLERANCE, GOAL_TOLERANCE = 0.05, 0.05, 0.01
"""[rad] by which corners are smoothed; path and goal tolerance."""
RATE, DELAY = 500, 2
"""Joint states [Hz]; delay of the effort [ms]."""
FIRST_STAMP, MS = 1_000_000_000, 1_000_000
GAP = 42
"""[ms]"""
OVERSPEED = 1.2


class Run(NamedTuple):
    """The result of a run, the largest error [rad], and the largest speed by its limit."""

    result: str
    error: float
    speed: float

    @property
    def is_bad(self) -> bool:
        """Whether the last plan failed, or the arm was too fast."""
        return self.result != ResultCode.SUCCESSFUL.name or self.speed > OVERSPEED


class Arm:
    """An arm in lock-step with its control loop."""

    def __init__(self, arm: ArmModel, start: FloatArray) -> None:
        self.arm, self.loop = arm, ControlLoop.of_arm(arm)
        self.plant = ArmSimulation(arm, start)
        self.k, self.error, self.speed = 0, 0.0, 0.0
        self.has_states = True
        self._effort: FloatArray | None = None
        self._pending = deque[tuple[int, FloatArray]]()

    def run(self, steps: int, goal: TrajectoryGoal | None = None) -> None:
        """Continue by this number of ms, or until the goal has ended."""
        for _ in range(steps):
            stamp = FIRST_STAMP + self.k * MS
            q, v = self.plant.state
            if self.has_states and self.k % (1000 // RATE) == 0:
                effort = self.loop.answer(stamp, q, v).effort
                if effort is not None:
                    self._pending.append((self.k + DELAY, effort))
            while self._pending and self._pending[0][0] <= self.k:
                self.plant.release()
                self._effort = self._pending.popleft()[1]
            if self._effort is not None:
                self.plant.step(self._effort, 1e-3)
            active = self.loop.controller.trajectory
            if active is not None:
                error = self.loop.controller.position_error(active.sample(stamp).position, q)
                self.error = max(self.error, float(np.abs(error).max()))
            self.speed = max(self.speed, float((np.abs(v) / self.arm.limits.velocity).max()))
            self.k += 1
            if goal is not None and goal.result is not None:
                return


def plan_of(
    dynamics: ArmDynamics, start: FloatArray, rng: np.random.Generator, size: float,
) -> JointTrajectory:
    """Return a path from `start` (n,) through two random positions, with the fastest timing."""
    names, n = dynamics.arm.joint_names, len(start)
    middle, lower, upper = (
        middle_of(dynamics.arm), dynamics.arm.limits.lower, dynamics.arm.limits.upper)
    q = [start, *(np.clip(
        middle + rng.uniform(-size, size, n), lower + 0.05, upper - 0.05) for _ in range(2))]
    path = make_trajectory(names, [0.0, 1.0, 2.0], q, expected_joints=names)
    rates = SHARE * default_effort_rates(dynamics.arm)
    return retime(
        dynamics, path, 'fastest', CORNER, effort_limit_fraction=SHARE,
        effort_rate_limits=rates).trajectory


def run(arm: ArmModel, dynamics: ArmDynamics, case: str, seed: int) -> Run:
    """Execute one plan with a disturbance."""
    rng = np.random.default_rng(seed)
    start, n = middle_of(arm), arm.joint_count
    bench = Arm(arm, start)
    bench.run(300)
    plan = plan_of(dynamics, start, rng, 0.8)
    tolerances = Tolerances(
        np.full(n, TOLERANCE), np.full(n, np.inf), np.full(n, GOAL_TOLERANCE), np.full(n, np.nan))
    goal = bench.loop.execute(plan, 0, tolerances)
    at = round(1e3 * rng.uniform(0.1, 0.9) * plan.duration)
    if case != CASES[0]:
        bench.run(at, goal)
    if case == CASES[1]:
        bench.has_states = False
        bench.run(GAP)
        bench.has_states = True
    if case == CASES[2] and goal.result is None:
        bench.loop.execute(make_trajectory(
            arm.joint_names, [0.5], [start], expected_joints=arm.joint_names))
        bench.run(5_000)
        goal = bench.loop.execute(plan_of(dynamics, start, rng, 0.8), 0, tolerances)
    bench.run(20_000, goal)
    result = 'none' if goal.result is None else goal.result.code.name
    return Run(result, bench.error, bench.speed)


def main(argv: Sequence[str] = ()) -> None:
    """Print one row per arm and case; exit with status 1 if a run is bad."""
    parser = argparse.ArgumentParser(prog='python -m benchmarks.plans', description=__doc__)
    parser.add_argument('--arms', nargs='+', default=list(ARMS), metavar='ARM')
    parser.add_argument('--runs', type=int, default=RUNS, help='Runs per arm')
    arguments = parser.parse_args(argv)
    begin, is_bad = time.monotonic(), False
    print('| arm | case | runs | bad | largest error [mrad] | largest v/v_max |')
    print('| --- | --- | ---: | ---: | ---: | ---: |')
    for name in arguments.arms:
        arm = load_arm(default_arm_urdf()) if name == 'two_link' else with_rotors(arm_named(name))
        dynamics = ArmDynamics(arm)
        found: dict[str, list[Run]] = {case: [] for case in CASES}
        for seed in range(arguments.runs):
            case = CASES[seed % len(CASES)]
            one = run(arm, dynamics, case, seed)
            found[case].append(one)
            if one.is_bad:
                print(f'bad: {name}, {case}, seed {seed}: {one}', file=sys.stderr)
        for case, runs in found.items():
            if not runs:
                continue
            bad = sum(one.is_bad for one in runs)
            is_bad |= bad > 0
            print(f'| {name} | {case} | {len(runs)} | {bad} | '
                  f'{1e3 * max(one.error for one in runs):.2f} | '
                  f'{max(one.speed for one in runs):.2f} |', flush=True)
    print(f'{time.monotonic() - begin:.0f} s', file=sys.stderr)
    if is_bad:
        raise SystemExit(1)


if __name__ == '__main__':
    main(sys.argv[1:])
