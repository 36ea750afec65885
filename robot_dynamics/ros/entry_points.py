# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The entry points of the executables.

The imports of numpy, Pinocchio and rclpy take most of a second. An interrupt during the imports
ends the process with status 0 and without a traceback, as an interrupt later does.
"""

import importlib
import os
import sys

from robot_dynamics.ros.middleware.shutdown import handle_end_signals, leave


def dynamics_node() -> int:
    """Run the node `dynamics`."""
    return run_module('robot_dynamics.ros.dynamics.node')


def simulated_arm() -> int:
    """Run the node `simulated_arm`."""
    return run_module('robot_dynamics.ros.simulated_arm.node')


def run_module(module: str) -> int:
    """Run the `main` of a module of a node, which is imported here."""
    handle_end_signals(lambda *_: leave(0))  # at once, because nothing is running yet
    dependencies = importlib.import_module('robot_dynamics.dependencies')
    try:
        dependencies.require_ros(os.path.basename(sys.argv[0]))
    except dependencies.MissingDependencyError as error:
        sys.exit(f'robot_dynamics: {error}')  # status 1
    leave(int(importlib.import_module(module).main()))

