# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The arm in the viewer: from a file, from `dynamics`, or from the topic robot_description."""

from pathlib import Path
import time
from typing import Any, NamedTuple

from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.urdf.description_file import description_path, read_description
from robot_dynamics_tools.viewer.node import DESCRIBING, ViewerNode

ASK_PERIOD = 1.0
"""[s] between two requests for the arm."""


class Description(NamedTuple):
    """A URDF, the directory of its file (None: from a topic), and the actuated joints."""

    xml: str
    directory: Path | None
    joints: tuple[str, ...]


class ArmSource:
    """Finds the arm, and detects a new one."""

    def __init__(self, node: ViewerNode, robot: str | None) -> None:
        """`robot` is the file of a URDF, or None; raise ModelError if it is unreadable."""
        self._node, self._robot = node, robot
        self._described: dict[str, Any] | None = None
        self._topic_xml = ''
        self._asked_time = -ASK_PERIOD
        self._last: Description | None = None
        self._found = None if robot is None else _of_file(robot, '--robot')
        self.problem = ''
        """Reason why the arm of `dynamics` cannot be shown."""

    def take_topic(self, xml: str) -> None:
        """Store a URDF from the topic robot_description."""
        self._topic_xml = xml
        if self._described is not None:
            self._take(self._described)

    def news(self) -> Description | None:
        """Return the arm if it is a new one, else None; request it from `dynamics`."""
        if not self._node.has_dynamics:
            self._described, self.problem = None, ''  # the node may restart with another arm
            if self._topic_xml and self._robot is None:
                self._found = Description(self._topic_xml, None, ())
        elif self._described is None and time.monotonic() - self._asked_time >= ASK_PERIOD:
            self._asked_time = time.monotonic()
            self._node.ask_description(self._take)
        if self._found == self._last:
            return None
        self._last = self._found
        return self._found

    def _take(self, described: dict[str, Any]) -> None:
        """Store the arm from the parameters of `dynamics`."""
        self._described, self.problem = described, ''
        xml, file, joints = (described.get(name) for name in DESCRIBING)
        joints = tuple(joints or ())
        if self._found is not None and self._robot is not None:
            self._found = self._found._replace(joints=joints)
            return
        if file:
            try:
                self._found = _of_file(file, 'robot_description_file', joints)
                return
            except RobotDynamicsError as error:  # a file on another computer
                if not self._topic_xml:
                    self.problem = (
                        f'{error}; expected the file also here, or on the topic robot_description')
                    return
        self._found = Description(xml or self._topic_xml or default_arm_urdf(), None, joints)


def _of_file(file: str, field: str, joints: tuple[str, ...] = ()) -> Description:
    path = description_path(file, field)
    return Description(read_description(path, field), path.parent, joints)
