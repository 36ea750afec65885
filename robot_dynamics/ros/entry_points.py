# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The entry points of the executables.

The imports of numpy, Pinocchio and rclpy take most of a second. An interrupt during the imports
ends the process with status 0 and without a traceback, as an interrupt later does.
"""

from collections.abc import Callable
import importlib
import os
import signal
import sys
from typing import NoReturn


def dynamics_node() -> int:
    """Run the node `dynamics`."""
    return _run('robot_dynamics.ros.dynamics.node')


def simulated_arm() -> int:
    """Run the node `simulated_arm`."""
    return _run('robot_dynamics.ros.simulated_arm.node')


def mujoco_arm() -> int:
    """Run the node `mujoco_arm`."""
    return _run('robot_dynamics.ros.simulated_arm.mujoco_arm')


def _run(module: str) -> int:
    for end_signal in (signal.SIGINT, signal.SIGTERM):
        signal.signal(end_signal, _leave)
    dependencies = importlib.import_module('robot_dynamics.dependencies')
    try:
        dependencies.require_ros(os.path.basename(sys.argv[0]))
    except dependencies.MissingDependencyError as error:
        sys.exit(f'robot_dynamics: {error}')  # status 1
    status = int(importlib.import_module(module).main())
    leave: Callable[[int], NoReturn] = importlib.import_module(
        'robot_dynamics.ros.middleware.shutdown').leave
    leave(status)


def _leave(*_: object) -> None:
    """Exit at once, because nothing is running yet."""
    sys.stdout.flush()
    os._exit(0)
