# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Controllers of the default arm, without ROS."""

from collections.abc import Sequence

import numpy as np
from robot_dynamics.control import Controller, ControllerOptions, ControlOutput, make_gains
from robot_dynamics.model import ArmDynamics, ArmModel, load_arm, make_payload, Payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory

NAMES = ('joint1', 'joint2')
SECOND = 1_000_000_000
NOW = 1_790_000_000 * SECOND
Q, V, ZERO = np.array([0.8, 0.5]), np.array([0.5, 0.3]), np.zeros(2)
LOAD = make_payload('tool0', 2.0, (0.05, 0.0, 0.1), np.diag((0.01, 0.02, 0.02)))


def options(arm: ArmModel, **changes: object) -> ControllerOptions:
    return ControllerOptions(make_gains(arm.joint_names), **changes)  # type: ignore[arg-type]


def make_controller(urdf: str | None = None, **changes: object) -> Controller:
    arm = load_arm(urdf or default_arm_urdf())
    return Controller(arm, options(arm, **changes))


def set_point(
    q: Sequence[float], v: Sequence[float] | None = None, a: Sequence[float] | None = None,
) -> JointTrajectory:
    return make_trajectory(
        NAMES, [0.0], [q], [v] if v is not None else (), [a] if a is not None else (), NAMES)


def command(output: ControlOutput) -> np.ndarray:
    assert output.command is not None
    return output.command


def gravity_with(loads: list[Payload]) -> np.ndarray:
    """Return g(Q) of the default arm with these payloads."""
    arm = load_arm(default_arm_urdf())
    return ArmDynamics(arm.with_payloads(loads)).rigid_body.gravity(Q)
