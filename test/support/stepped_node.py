# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A node `dynamics` in this process, whose control path is called in this thread."""

from collections.abc import Iterator
from contextlib import contextmanager
import struct
import time

import numpy as np
from own_process import own_process, OwnProcess
from rclpy.serialization import serialize_message
from robot_dynamics.planar.urdf import planar_arm_urdf
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

JOINTS = 7
NAMES = [f'joint{i + 1}' for i in range(JOINTS)]
PERIOD = 2_000_000
"""[ns] from one stamp to the next."""


def chain(n: int) -> str:
    ones = [1.0] * n
    return planar_arm_urdf(ones, ones, [0.5] * n, [0.1] * n)


class SteppedNode:
    """A node of an arm of 7 joints at rest; it has answered some states."""

    def __init__(self, process: OwnProcess) -> None:
        self.namespace = process.namespace
        self.node = process.dynamics(
            robot_description=chain(JOINTS), state_timeout=60.0, state_max_age=60.0)
        self._stamp = time.time_ns()
        self._data = bytearray(serialize_message(
            JointState(name=NAMES, position=[0.1] * JOINTS, velocity=[0.0] * JOINTS)))
        self.take_states(20)  # then the rate and the noise of the states are known

    def next_state(self) -> bytes:
        """Return a joint state, PERIOD after the last one."""
        self._stamp += PERIOD
        self._data[4:12] = struct.pack('<iI', *divmod(self._stamp, 1_000_000_000))
        return bytes(self._data)

    def deliver(self, state: bytes) -> None:
        """Let the node answer a joint state in this thread."""
        self.node._loop._deliver(state)

    def take_states(self, count: int) -> None:
        """Answer this number of states."""
        with np.errstate(over='ignore', invalid='ignore'):  # as in the thread of the loop
            for _ in range(count):
                self.deliver(self.next_state())

    def follow(self) -> None:
        """Follow a trajectory that does not end."""
        message = JointTrajectory(joint_names=NAMES)
        for seconds, position in ((1, 0.1), (100_000, 0.2)):
            point = JointTrajectoryPoint(
                positions=[position] * JOINTS, velocities=[0.0] * JOINTS,
                accelerations=[0.0] * JOINTS)
            point.time_from_start.sec = seconds
            message.points.append(point)
        self.node._trajectories.take(message, {})


@contextmanager
def stepped_node() -> Iterator[SteppedNode]:
    """Yield a node; destroy it at the end."""
    with own_process() as process:
        yield SteppedNode(process)
