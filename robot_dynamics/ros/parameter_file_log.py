# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
