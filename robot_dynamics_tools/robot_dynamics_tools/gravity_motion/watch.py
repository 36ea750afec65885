# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The node and the arm during a calibration: whether it is free, moves, has arrived and rests."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
import time

import numpy as np
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.tools.command_line import ToolError
from robot_dynamics_tools.gravity_motion.plan import Move
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError
from robot_dynamics_tools.ros2_dynamics.motion_watch import MotionWatch
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

WATCH_TIME = 1.0
"""[s] in which another client of the node is noticed before the arm moves."""
SETTLE_TIME = 20.0
"""[s] by the stamps, within which the arm comes to rest at a pose."""
LATE_FACTOR, LATE_TIME = 10.0, 30.0
"""A move may take this many times its planned duration, and this time [s] in addition."""
Publish = Callable[[Sequence[float], float], None]


class ArmWatch(MotionWatch):
    """Moves the arm and waits; raises ToolError or NoAnswerError for all that goes wrong."""

    def __init__(self, client: DynamicsClient, arm: ArmModel) -> None:
        """Watch the joints of the node that `client` speaks to."""
        super().__init__(client, arm.joint_names, arm.joint_kinds)
        self._arm = arm
        self._newest_ns, self._newest = -1, time.monotonic()
        self._late_ns: float = np.inf
        self._has_effort = False

    def following(self) -> AbstractContextManager[None]:
        """Receive in `with`, from now on."""
        self._newest = time.monotonic()
        return super().following()

    def on_state(self, message: JointState) -> None:
        super().on_state(message)
        self._has_effort |= bool(
            set(message.name) & set(self._arm.joint_names)) and bool(message.effort)

    # ------------------------------------------------------------------ before the motion

    def check_free(self) -> None:
        """Raise ToolError if another client moves the arm or sends goals, or without efforts."""
        client, topic = self.client, self.client.resolve('~/joint_trajectory')
        moves, goals = False, list[JointTrajectory]()

        def is_used() -> bool:
            nonlocal moves
            moves = moves or self.reference is not None and any(self.reference[2])
            return moves or bool(goals)

        with client.subscribed((JointTrajectory, topic, goals.append, QoSProfile(depth=10))):
            client.wait(is_used, WATCH_TIME)
        if goals:
            raise ToolError(
                f'another client sends goals on {topic}; end it before the calibration')
        if moves:
            raise ToolError(
                f'{client.name} follows the reference of another client; wait until it has ended')
        if not self._has_effort:
            raise InvalidInputError(
                f'{client.joint_state_topic()} has no efforts, expected the measured effort of '
                'each joint')

    # ------------------------------------------------------------------ motion

    def move(self, move: Move, publish: Publish, on_progress: Callable[[float], None]) -> None:
        """Move to a goal; `on_progress` receives the time [s] since the start."""
        goal = move.goal.tolist()
        self._late_ns = np.inf
        self.wait_taken(goal, lambda: publish(goal, move.duration))
        limit = LATE_FACTOR * move.duration + LATE_TIME
        self._late_ns = self.position_ns + 1e9 * limit
        self.wait_end(goal, on_progress)
        self._late_ns = np.inf

    def wait_held(
        self, goal: FloatArray, seconds: float, tolerance: FloatArray | None = None,
    ) -> None:
        """
        Wait until all joints have rested for `seconds` by the stamps, while the node holds `goal`.

        The arm may rest at a distance from its goal (n,), at most the `tolerance` (n,), if any.
        """
        resting_since, start_ns = self.rest(), self.position_ns

        def has_rested() -> bool:
            self.check_following()
            assert self.reference is not None
            if not self.is_at(goal.tolist(), self.reference[1]):
                raise ToolError('another reference replaced that of the calibration')
            if self.position_ns - resting_since() >= 1e9 * seconds:
                return True
            if self.position_ns - start_ns > 1e9 * (seconds + SETTLE_TIME):
                names = [name for name, one in zip(self.names, self.restless) if one]
                raise ToolError(
                    f'{", ".join(names)} did not come to rest in {SETTLE_TIME:g} s: the position '
                    f'changes by more than {float(self.still[self.restless][0]):g}')
            return False

        self.client.wait(has_rested, np.inf)
        if tolerance is not None:
            self._check_arrived(goal, tolerance)

    def check_following(self) -> None:
        """Raise ToolError after an early end or for a late goal, NoAnswerError without states."""
        super().check_following()
        now = time.monotonic()
        if self.position_ns != self._newest_ns:
            self._newest_ns, self._newest = self.position_ns, now
        elif now - self._newest > self.client.timeout:
            raise NoAnswerError(
                f'no joint state with a new stamp on {self.client.joint_state_topic()} for '
                f'{self.client.timeout:g} s')
        if self.position_ns > self._late_ns:
            raise ToolError('the reference did not reach its goal in time')

    def _check_arrived(self, goal: FloatArray, tolerance: FloatArray) -> None:
        position = self.measured()
        error = np.abs(self.error(goal.tolist(), position))
        for j in np.flatnonzero(error > tolerance)[:1]:
            raise ToolError(
                f'{self._arm.joint_names[j]} rests at {position[j]:.4g}, {error[j]:.3g} from its '
                f'goal {goal[j]:.4g}, expected at most {tolerance[j]:g} (--tolerance)')
