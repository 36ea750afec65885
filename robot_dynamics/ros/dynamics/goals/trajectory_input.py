# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The trajectories and set-points that `dynamics` receives, and the status `reference`."""

from collections.abc import Callable, Mapping
import math
import re
import time

from rclpy.qos import QoSProfile, ReliabilityPolicy
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.loop import ControlLoop, STOPPED
from robot_dynamics.control.rest import rest_stiffness, shortfall
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.joints.units import units_of
from robot_dynamics.ros.dynamics.control_path import ControlPath
from robot_dynamics.ros.middleware.conversions import stamp_from_ros, trajectory_from_ros
from robot_dynamics.ros.middleware.diagnostics import (
    DRIVE_STIFFNESS,
    FRICTION_ERROR,
    joint_key,
    OK,
    Status,
    STIFFNESS,
    WARN,
)
from robot_dynamics.ros.middleware.guarded_callbacks import describe_error, GuardedCallbacks
from robot_dynamics.ros.middleware.joint_state_loop import LOG_PERIOD
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics.validation import check_named
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg

NEWEST_ONLY = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Matches all publishers, reliable or not; older messages are of no use."""
_NUMBER = re.compile(r'-?\d+(\.\d+)?(e[-+]\d+)?')


class TrajectoryInput:
    """Passes ~/joint_trajectory and ~/set_point to the loop of a path."""

    def __init__(self, node: GuardedCallbacks, path: ControlPath) -> None:
        """Subscribe on a node."""
        self._node, self._path = node, path
        self._refused, self.refusal = 0, ''
        """Number of rejected messages, and why the latest was rejected; '' if it was accepted."""
        self._accepted, self._goal = 0, list[float]()
        self._stopped = -math.inf
        """Time [s] of the steady clock of the last ~/stop."""
        self._reported = 0
        """Number of accepted goals that is published at once; a stream does not change it."""
        node.create_subscription(
            JointTrajectoryMsg, '~/joint_trajectory', self.take, 10, refuse=self.refuse)
        node.create_subscription(
            JointState, '~/set_point', self._take_set_point, NEWEST_ONLY, refuse=self.refuse)

    def stop(self) -> None:
        """Reject the messages that have been received until now and are not yet taken."""
        self._stopped = time.monotonic()

    def take(self, message: JointTrajectoryMsg, info: Mapping[str, int]) -> None:
        """Follow a trajectory; raise RobotDynamicsError."""
        self.follow('trajectory', lambda controller: trajectory_from_ros(
            message, controller.arm.joint_names), info, stamp_from_ros(message.header.stamp))

    def _take_set_point(self, message: JointState, info: Mapping[str, int]) -> None:
        def read(controller: Controller) -> JointTrajectory:
            joints, names, v = controller.arm.joint_names, message.name, message.velocity
            return make_trajectory(
                joints, [0.0], [check_named('position', message.position, names, joints)],
                [check_named('velocity', v, names, joints)] if len(v) else [], [], joints)

        self.follow('set-point', read, info)

    def follow(
        self, kind: str, read: Callable[[Controller], JointTrajectory], info: Mapping[str, int],
        stamp_ns: int = 0,
    ) -> None:
        """
        Follow what `read` returns from `stamp_ns` on; raise RobotDynamicsError.

        `info` is what rclpy knows of the message, of which the time of its reception is used.
        """
        received_ns = info.get('received_timestamp', 0)
        age = 1e-9 * (time.time_ns() - received_ns) if received_ns else 0.0
        if time.monotonic() - age < self._stopped:
            raise TrajectoryError(STOPPED)
        loop = self._path.loop
        if loop is None:
            raise InvalidInputError(f'no model yet: no {kind} can be followed')
        trajectory = read(loop.controller)
        loop.follow(trajectory, stamp_ns)
        self.accept(loop, trajectory)

    def accept(self, loop: ControlLoop, trajectory: JointTrajectory) -> None:
        """Count a goal that the loop follows."""
        self.refusal = ''
        self._accepted += 1
        self._goal = trajectory.points[-1].position.tolist()
        if loop.goals.stream.deadline == math.inf:
            self._reported = self._accepted
            self._path.when_changed()

    def refuse(self, error: Exception) -> None:
        """Count a goal that is rejected, and log the reason."""
        before, self.refusal = self.refusal, describe_error(error)
        self._refused += 1
        if not before:
            self._path.when_changed()
        words = f'Rejected a joint trajectory: {self.refusal}'
        if _NUMBER.sub('', self.refusal) == _NUMBER.sub('', before):  # of the same stream
            self._node.get_logger().error(words, throttle_duration_sec=LOG_PERIOD)
        else:
            self._node.get_logger().error(words)

    def status(self) -> Status:
        """Return the status `reference` for the diagnostics."""
        loop, following = self._path.loop, self._path.states.following
        level, words = WARN if self.refusal else OK, 'following' if following else 'none'
        missing = shortfall(loop.controller, loop.drives) if loop is not None and following else ''
        oscillation = '' if loop is None else str(loop.controller.laws.oscillation)
        if loop is not None and loop.goals.interruption:
            level, words = WARN, f'ended early: {loop.goals.interruption}'
        elif missing or oscillation:
            level, words = WARN, '; '.join(filter(None, (missing or words, oscillation)))
        return Status('reference', level, words, {
            'refused': self._refused, 'refusal of the latest': self.refusal,
            'accepted': self._accepted, 'goal of the latest': self._goal,
            'streams that paused': 0 if loop is None else loop.goals.paused_streams,
            'slowed down by': 1.0 if loop is None else round(loop.controller.followed.slowness, 3),
            'share of the gains that the state rate allows':
                1.0 if loop is None else round(loop.controller.gains.least, 3),
            **({} if loop is None else _stiffness_values(loop.controller))}, self._reported)


def _stiffness_values(controller: Controller) -> dict[str, str]:
    """Return stiffness and error at rest of each joint, and its drive, for the diagnostics."""
    found, names = rest_stiffness(controller), controller.arm.joint_names
    columns = [] if found is None else list(zip((STIFFNESS, FRICTION_ERROR), found))
    drives = controller.options.drive_stiffness
    if drives is not None:
        columns.append((DRIVE_STIFFNESS, drives))
    values = {}
    for beginning, column in columns:
        for name, kind, value in zip(names, controller.arm.joint_kinds, column):
            unit = units_of(kind)
            if math.isfinite(value):
                values[joint_key(beginning, name, unit.position if (
                    beginning == FRICTION_ERROR) else f'{unit.effort}/{unit.position}')] = (
                    f'{value:.4g}')
    return values
