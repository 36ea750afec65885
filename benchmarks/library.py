# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Cost of the library in addition to Pinocchio, called from Python on the same arm and states."""

from collections.abc import Callable
import statistics
import time

import numpy as np
import pinocchio as pin
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import planar_arm_urdf

JOINTS = 7
ROUNDS = 15
CALLS = 2000


def seconds_per_call(call: Callable[[], object]) -> float:
    """Return the mean processor time [s] of a call."""
    start = time.thread_time()
    for _ in range(CALLS):
        call()
    return (time.thread_time() - start) / CALLS


def side_by_side(ours: Callable[[], object], raw: Callable[[], object]) -> tuple[float, float]:
    """Return the medians [s] of interleaved rounds, so that a slow moment affects both."""
    rounds = [(seconds_per_call(ours), seconds_per_call(raw)) for _ in range(ROUNDS)]
    mine, theirs = zip(*rounds)
    return statistics.median(mine), statistics.median(theirs)


def main() -> None:
    """Print µs per call and ratios for a generated arm of seven joints."""
    ones = [1.0] * JOINTS
    arm = load_arm(planar_arm_urdf(ones, ones, [0.5] * JOINTS, [0.1] * JOINTS))
    dynamics, model = ArmDynamics(arm).unchecked, arm.pinocchio_model
    data = model.createData()
    rng = np.random.default_rng(0)
    q, v, a = rng.uniform(-1.0, 1.0, (3, JOINTS))
    body = dynamics.rigid_body
    cases: dict[str, tuple[Callable[[], object], Callable[[], object]]] = {
        'inverse dynamics': (
            lambda: body.inverse_dynamics(q, v, a), lambda: pin.rnea(model, data, q, v, a)),
        'inverse dynamics, ArmDynamics': (
            lambda: dynamics.inverse_dynamics(q, v, a), lambda: pin.rnea(model, data, q, v, a)),
        'gravity': (
            lambda: body.gravity(q), lambda: pin.computeGeneralizedGravity(model, data, q)),
        'mass matrix': (lambda: body.mass_matrix(q), lambda: pin.crba(model, data, q)),
        'forward dynamics': (
            lambda: body.forward_dynamics(q, v, a), lambda: pin.aba(model, data, q, v, a)),
    }
    print(f'{"":32} {"ours":>9} {"Pinocchio":>10} {"ratio":>6}')
    for name, (ours, raw) in cases.items():
        mine, theirs = side_by_side(ours, raw)
        print(f'{name:32} {1e6 * mine:6.2f} µs {1e6 * theirs:7.2f} µs {mine / theirs:6.2f}')
