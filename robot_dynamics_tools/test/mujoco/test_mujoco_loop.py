# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The default control loop on arms in MuJoCo whose figures are not those of the URDF.

The controller has the sample URDF, the plant the published figures of MuJoCo Menagerie
(`mujoco_plant`). Each run is in lock-step and deterministic.
"""

from collections import deque
from typing import Any, NamedTuple

from lock_step_loop import FIRST_STAMP, MS
from mujoco_plant import (
    ARMS,
    contact_force,
    foreign_simulation,
    given_arm,
    push_on_tool,
    tool_height,
)
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

STEP = 1e-3
BEGIN = 200
"""[ms] after which the motion begins."""
PUSH, PUSH_TIME = 40.0, 200
"""[N], [ms]"""
PUSHES = (1000, 2500, 4000)
"""[ms]: along x, y and z of the base frame."""
ABOVE_GOAL = 0.04
"""[m]"""
AFTER_PUSH = 300
"""[ms] after a push in which the velocity does not count, as during the push."""
AT_REST = {'floor': 1e-2}
"""
[rad/s] in the last second: 1e-3, but the tool creeps on the floor, as MuJoCo's friction is soft.

A Panda and an xArm7 creep at 0.003 to 0.005 rad/s; the xArm7 at 3e-6 rad/s after 30 s.
"""
DURATION = {'hold': 3.0, 'motion': 5.5, 'pushes': 9.0, 'floor': 7.0, 'kilogram': 6.5}
"""[s]"""


class Case(NamedTuple):
    """An arm and what happens to it; `rate` of the joint states [Hz], `delay` [ms]."""

    arm: str
    event: str
    rate: int
    delay: int


class Outcome(NamedTuple):
    """
    What is judged in a run.

    `speed` [rad/s] is the largest of the last second, `v_ratio` the largest |v|/v_max, `excess`
    [rad] the largest distance beyond a position limit, `error` [rad] that at the end; the forces
    [N] are the last one, the largest one, and the peak-to-peak value of the last second.
    """

    speed: float
    v_ratio: float
    excess: float
    error: float
    faults: list[str]
    force: float
    largest_force: float
    force_change: float


def run(case: Case) -> Outcome:
    """Simulate a case."""
    arm, published = given_arm(case.arm), ARMS[case.arm]
    start = np.array(published.start)
    moves = case.event in ('motion', 'floor', 'kilogram')
    goal = start + (np.array(published.way) if moves else 0.0)
    floor = tool_height(case.arm, goal) + ABOVE_GOAL - 0.02 if case.event == 'floor' else None
    plant = foreign_simulation(
        case.arm, floor=floor, load=1.0 if case.event == 'kilogram' else 0.0)
    plant.release()
    loop, limits = ControlLoop.of_arm(arm), arm.limits
    pending: deque[tuple[int, FloatArray]] = deque()
    effort, faults = None, list[str]()
    q, v, forces = list[FloatArray](), list[FloatArray](), list[float]()
    for k in range(round(DURATION[case.event] / STEP)):
        if k == BEGIN and moves:
            loop.follow(make_trajectory(arm.joint_names, [0.0], [goal]))
        if k % (1000 // case.rate) == 0:
            answer = loop.answer(FIRST_STAMP + k * MS, *plant.state).effort
            fault = loop.supervisor.fault
            if fault is not None and fault.name not in faults:
                faults.append(fault.name)
            if answer is not None:
                pending.append((k + case.delay, np.clip(answer, -limits.effort, limits.effort)))
        elif (again := loop.tick(1e-9 * (FIRST_STAMP + k * MS))) is not None:
            pending.append((k, again))
        while pending and pending[0][0] <= k:
            effort = pending.popleft()[1]
        if effort is not None:
            state = plant.step(effort, STEP, wrenches(plant, case, k))
            q.append(state.position)
            v.append(state.velocity)
            forces.append(contact_force(plant))
    positions, speeds, normal = np.array(q), np.abs(v), np.array(forces)
    ratios = (speeds / limits.velocity).max(axis=1)
    if case.event == 'pushes':
        for begin in PUSHES:
            ratios[begin:begin + PUSH_TIME + AFTER_PUSH] = 0.0
    return Outcome(
        float(speeds[-1000:].max()), float(ratios.max()),
        float(np.maximum(positions - limits.upper, limits.lower - positions).max()),
        float(np.abs(positions[-1] - goal).max()), faults,
        float(normal[-1]), float(normal.max()), float(np.ptp(normal[-1000:])))


def wrenches(plant: Any, case: Case, k: int) -> list[Any]:
    if case.event == 'pushes':
        for axis, begin in enumerate(PUSHES):
            if begin <= k < begin + PUSH_TIME:
                return push_on_tool(plant, PUSH * np.eye(3)[axis])
    return []


def judge(case: Case) -> tuple[Outcome, list[str]]:
    """Return the outcome of a case, and what is wrong with it."""
    end = run(case)
    bad = {
        'not at rest': end.speed >= AT_REST.get(case.event, 1e-3),
        'too fast': end.v_ratio > 1.2,
        'beyond a position limit': end.excess > 0.0,
        'fault': bool(end.faults) and case.event in ('hold', 'motion', 'kilogram'),
        'no contact': case.event == 'floor' and end.force < 1.0,
        'restless contact': end.force_change > 0.05 * end.force,
        'hard contact': end.largest_force > 4.0 * max(end.force, 1.0),
    }
    return end, [words for words, is_bad in bad.items() if is_bad]


CASES = [
    Case('panda', 'motion', 500, 2), Case('panda', 'floor', 100, 8),
    Case('xarm7', 'pushes', 100, 8), Case('xarm7', 'kilogram', 500, 2),
    Case('z1', 'hold', 100, 8), Case('z1', 'floor', 500, 2)]


@pytest.mark.parametrize('case', CASES, ids=lambda case: '-'.join(map(str, case)))
def test_the_loop_is_calm_on_an_arm_in_mujoco(case, seen):
    end, bad = judge(case)
    seen(str(end))
    assert not bad, end

