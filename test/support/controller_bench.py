# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Controllers of the default arm, without ROS."""

from collections.abc import Sequence

import numpy as np
from robot_dynamics.control import Controller, ControllerOptions, ControlOutput, make_gains
from robot_dynamics.model import ArmDynamics, load_arm, make_payload, Payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory

ARM = load_arm(default_arm_urdf())
NAMES, LIMIT = ARM.joint_names, ARM.limits.effort
SECOND = 1_000_000_000
NOW = 1_790_000_000 * SECOND
Q, V, ZERO = np.array([0.8, 0.5]), np.array([0.5, 0.3]), np.zeros(2)
LOAD = make_payload('tool0', 2.0, (0.05, 0.0, 0.1), np.diag((0.01, 0.02, 0.02)))


def options(**changes: object) -> ControllerOptions:
    return ControllerOptions(make_gains(NAMES), **changes)  # type: ignore[arg-type]


def make_controller(**changes: object) -> Controller:
    return Controller(ARM, options(**changes))


def update(controller: Controller, stamp_ns: int, q: np.ndarray, v: np.ndarray) -> ControlOutput:
    """Pass a state as `ControlLoop` does."""
    with controller.lock, np.errstate(over='ignore', invalid='ignore'):
        output = controller.answer(stamp_ns, q, v)
        controller.evaluate()
        return output


def set_point(
    q: Sequence[float], v: Sequence[float] | None = None, a: Sequence[float] | None = None,
) -> JointTrajectory:
    return make_trajectory(
        NAMES, [0.0], [q], [v] if v is not None else (), [a] if a is not None else (), NAMES)


def gravity_with(loads: list[Payload]) -> np.ndarray:
    """Return g(Q) of the default arm with these payloads."""
    return ArmDynamics(ARM.with_payloads(loads)).rigid_body.gravity(Q)
