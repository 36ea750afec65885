# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The entry point of the executable `dynamics_monitor`."""

from robot_dynamics.ros.entry_points import run_module


def dynamics_monitor() -> int:
    """Run the node `dynamics_monitor`."""
    return run_module('robot_dynamics_tools.monitor.node')
