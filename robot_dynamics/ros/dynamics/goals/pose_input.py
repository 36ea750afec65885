# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The poses that `dynamics` receives as references of its frame."""

from geometry_msgs.msg import PoseStamped
from robot_dynamics.control.pose_reference import pose_set_point
from robot_dynamics.ros.dynamics.goals.trajectory_input import TrajectoryInput
from robot_dynamics.ros.middleware.guarded_callbacks import GuardedCallbacks


class PoseInput:
    """Passes ~/pose_reference to the loop of a control path, as a set-point of the joints."""

    def __init__(self, node: GuardedCallbacks, trajectories: TrajectoryInput) -> None:
        """Subscribe on a node; poses count as goals of `trajectories`."""
        self._trajectories = trajectories
        node.create_subscription(
            PoseStamped, '~/pose_reference', self._follow, 1, refuse=trajectories.refuse)

    def _follow(self, message: PoseStamped) -> None:
        """Follow a pose, or count and log why it is rejected."""
        p, turn = message.pose.position, message.pose.orientation
        self._trajectories.follow('pose', lambda controller: pose_set_point(
            controller, message.header.frame_id, [p.x, p.y, p.z],
            [turn.x, turn.y, turn.z, turn.w]))
