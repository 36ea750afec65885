# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A warning about parameter files whose sections a node ignores, such as in another namespace."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from rclpy.node import Node
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.ros.parameter_file import ParameterFile


def log_ignored_sections(node: Node, arguments: Sequence[str]) -> None:
    """
    Warn of each parameter file on the command line that names the node in another namespace.

    ROS ignores such sections without a message: a node that is started in a namespace loses the
    parameters of a section `/dynamics`. Files that cannot be read here are skipped: rcl has
    accepted them.
    """
    name = node.get_fully_qualified_name()
    for option, file in zip(arguments, arguments[1:]):
        if option != '--params-file':
            continue
        with suppress(RobotDynamicsError):
            ignored = ParameterFile(Path(file), '--params-file').ignored_sections([name])
            if ignored:
                node.get_logger().warning(f'Parameter file {file!r}: {ignored}.')
