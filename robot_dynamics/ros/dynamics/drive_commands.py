# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Commands to drives with their own position loop: `~/feed_forward` and `~/position_offset`."""

from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.control.loop import LoopAnswer
from robot_dynamics.ros.dynamics.served import Served
from robot_dynamics.ros.middleware.joint_state_loop import LOG_PERIOD
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

    def has_listeners(self) -> bool:
        """Return whether drives receive the commands, with about the effort of the law."""
        return any(count() for count in self.counts)

    def publish(self, stamp: bytes, served: Served, answer: LoopAnswer) -> None:
        """Publish the commands for an answer of the loop that is served."""
        has_feed_forward, has_offset = (count() for count in self.counts)
        if not (has_feed_forward or has_offset):
            return
        command = served.feed_forward.command(answer)
        if command is None:
            return
        if has_feed_forward:
            self._send(served.messages.drive_command.filled(stamp, *command))
        stiffness = served.loop.controller.options.drive_stiffness
        if has_offset and stiffness is None:
            self._node.get_logger().warning(
                'Nothing is published on ~/position_offset: drive.stiffness is empty, expected '
                'the stiffness k_p of the drives.', throttle_duration_sec=LOG_PERIOD)
        elif has_offset and stiffness is not None:
            limits = served.arm.limits
            position = command.position_offset(stiffness, limits.lower, limits.upper)
            self._send_offset(served.messages.motion.filled(stamp, position, command.velocity))
