# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What two arms of a teleoperation send each other: set-points, and the force of the follower."""

from collections.abc import Mapping, Sequence

import numpy as np
from rclpy.qos import QoSProfile, ReliabilityPolicy
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.ros.dynamics.control_path import ControlPath
from robot_dynamics.ros.dynamics.goals.trajectory_input import TrajectoryInput
from robot_dynamics.ros.middleware.guarded_callbacks import describe_error, GuardedCallbacks
from robot_dynamics.ros.middleware.message_loop import LOG_PERIOD
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics.validation import check_vector, LARGEST_VALUE
from sensor_msgs.msg import JointState

NEWEST_ONLY = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Matches publishers of joint states, reliable or not; older messages are of no use."""
DEVIATIONS = 2.0
"""Standard deviations by which the force of a follower is reduced: they may be none."""


class Teleoperation:
    """Passes ~/set_point and ~/force_feedback to the loop of a control path."""

    def __init__(
        self, node: GuardedCallbacks, path: ControlPath, trajectories: TrajectoryInput,
    ) -> None:
        """Subscribe on a node; set-points count as goals of `trajectories`."""
        self._node, self._path, self._trajectories = node, path, trajectories
        self._deviation: FloatArray | None = None
        for topic, callback, refuse in (
                ('~/set_point', self._follow, trajectories.refuse),
                ('~/force_feedback', self._feel, self._refuse),
                ('~/force_feedback_deviation', self._take_deviation, self._refuse)):
            node.create_subscription(JointState, topic, callback, NEWEST_ONLY, refuse=refuse)

    def _follow(self, message: JointState, info: Mapping[str, int]) -> None:
        def read(controller: Controller) -> JointTrajectory:
            names = controller.arm.joint_names
            return make_trajectory(
                names, [0.0], [_values(names, message, 'position')],
                [_values(names, message, 'velocity')] if len(message.velocity) else [], [], names)

        self._trajectories.follow('set-point', read, info)

    def _feel(self, message: JointState) -> None:
        loop, effort = self._efforts(message)
        deviation = self._deviation
        if deviation is not None and len(deviation) == len(effort):
            effort = np.sign(effort) * np.maximum(np.abs(effort) - DEVIATIONS * deviation, 0.0)
        loop.set_force_feedback(effort)

    def _take_deviation(self, message: JointState) -> None:
        self._deviation = np.abs(self._efforts(message)[1])

    def _efforts(self, message: JointState) -> tuple[ControlLoop, FloatArray]:
        """Return the loop that is served, and the efforts (n,) of its joints."""
        loop = self._path.loop
        if loop is None:
            raise InvalidInputError('no model yet: no force can be felt')
        return loop, _values(loop.controller.arm.joint_names, message, 'effort')

    def _refuse(self, error: Exception) -> None:
        self._node.get_logger().error(
            f'Rejected a force: {describe_error(error)}', throttle_duration_sec=LOG_PERIOD)


def _values(joint_names: Sequence[str], message: JointState, field: str) -> FloatArray:
    """Return the values (n,) of these joints; raise InvalidInputError. Others are ignored."""
    values, names = getattr(message, field), message.name
    if len(values) != len(names):
        raise InvalidInputError(
            f'{field} has {len(values)} values, expected {len(names)} as name has')
    missing = [name for name in joint_names if name not in names]
    if missing:
        raise InvalidInputError(
            f'name leaves out {missing}, expected every joint of {list(joint_names)}')
    return check_vector(
        field, [values[names.index(name)] for name in joint_names], len(joint_names), joint_names,
        LARGEST_VALUE)
