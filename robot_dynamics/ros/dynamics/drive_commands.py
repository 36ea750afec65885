# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Commands to drives with their own position loop: `~/feed_forward` and `~/position_offset`."""

from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.control.feed_forward import FeedForward
from robot_dynamics.control.loop import ControlLoop, LoopAnswer
from robot_dynamics.ros.middleware.cdr_templates import state_template
from robot_dynamics.ros.middleware.message_loop import LOG_PERIOD
from robot_dynamics.ros.middleware.rclpy_internals import raw_publish, subscription_count
from sensor_msgs.msg import JointState


class DriveCommands:
    """Publishes a command for each valid joint state, if there are subscribers."""

    def __init__(self, node: Node, qos: QoSProfile) -> None:
        self._node = node
        publishers = [
            node.create_publisher(JointState, topic, qos)
            for topic in ('~/feed_forward', '~/position_offset')]
        self._send, self._send_offset = map(raw_publish, publishers)
        self.counts = [subscription_count(one) for one in publishers]
        """Functions that return the number of subscribers of each topic."""

    def set_loop(self, loop: ControlLoop) -> None:
        """Publish the commands of this loop."""
        names = loop.controller.arm.joint_names
        self._loop, self._feed_forward = loop, FeedForward(loop)
        self._template = state_template(names)
        self._offset_template = state_template(names, has_effort=False)

    def has_listeners(self) -> bool:
        """Return whether drives receive the commands, with about the effort of the law."""
        return any(count() for count in self.counts)

    def publish(self, stamp: bytes, answer: LoopAnswer) -> None:
        """Publish the commands for an answer of the loop."""
        has_feed_forward, has_offset = (count() for count in self.counts)
        if not (has_feed_forward or has_offset):
            return
        command = self._feed_forward.command(answer)
        if command is None:
            return
        if has_feed_forward:
            self._send(self._template.filled(stamp, *command))
        stiffness = self._loop.controller.options.drive_stiffness
        if has_offset and stiffness is None:
            self._node.get_logger().warning(
                'Nothing is published on ~/position_offset: drive.stiffness is empty, expected '
                'the stiffness k_p of the drives.', throttle_duration_sec=LOG_PERIOD)
        elif has_offset and stiffness is not None:
            limits = self._loop.controller.arm.limits
            position = command.position_offset(stiffness, limits.lower, limits.upper)
            self._send_offset(self._offset_template.filled(stamp, position, command.velocity))
