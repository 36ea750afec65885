# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The entry point of the executable `mujoco_arm`."""

from robot_dynamics.ros.entry_points import run_module


def mujoco_arm() -> int:
    """Run the node `mujoco_arm`."""
    return run_module('robot_dynamics_tools.mujoco.mujoco_arm')
