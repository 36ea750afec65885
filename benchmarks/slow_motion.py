# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A slow motion for `dynamics` to follow, so that every effort differs from the previous one."""

import math
import threading
import time

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

AMPLITUDE = 0.02
"""[rad] of 1 - cos, at each joint."""
POINTS_A_TURN = 8
SHORTEST_STEP = 0.5
"""[s] between two points."""
MOST_POINTS = 1600
AGAIN = 1.0
"""[s] after which the motion is sent again: it may have come before the first joint state."""
TIMEOUT = 30.0


def hanging(joints: int) -> list[float]:
    """Return the position [rad] where a planar arm hangs straight down."""
    return [math.pi] + [0.0] * (joints - 1)


def slow_motion(joints: int, seconds: float) -> JointTrajectory:
    """Return a sine of at least `seconds` that begins and ends at rest, hanging straight down."""
    step = max(SHORTEST_STEP, seconds / MOST_POINTS)
    rate = 2.0 * math.pi / (POINTS_A_TURN * step)
    trajectory = JointTrajectory(joint_names=[f'joint{i + 1}' for i in range(joints)])
    for k in range(1, POINTS_A_TURN * math.ceil(seconds / (POINTS_A_TURN * step)) + 1):
        phase = 2.0 * math.pi * (k % POINTS_A_TURN) / POINTS_A_TURN
        point = JointTrajectoryPoint(
            positions=[q + AMPLITUDE * (1.0 - math.cos(phase)) for q in hanging(joints)],
            velocities=[AMPLITUDE * rate * math.sin(phase)] * joints)
        fraction, whole = math.modf(k * step)
        point.time_from_start.sec = int(whole)
        point.time_from_start.nanosec = int(1e9 * fraction)
        trajectory.points.append(point)
    return trajectory


def follow_slow_motion(node: Node, joints: int, seconds: float) -> None:
    """
    Make `dynamics` follow a slow motion of `seconds`; return once `dynamics` follows it.

    `node` has to spin. Raises TimeoutError if `dynamics` follows no motion.
    """
    follows = threading.Event()
    publisher = node.create_publisher(JointTrajectory, 'dynamics/joint_trajectory', 1)
    subscription = node.create_subscription(
        JointState, 'dynamics/computed_torque', lambda _: follows.set(),
        QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT))
    motion, deadline = slow_motion(joints, seconds), time.monotonic() + TIMEOUT
    while not follows.is_set():
        if time.monotonic() > deadline:
            raise TimeoutError(f'no motion is followed in {TIMEOUT:g} s')
        if publisher.get_subscription_count() > 0:
            publisher.publish(motion)
        follows.wait(AGAIN)
    node.destroy_subscription(subscription)
    node.destroy_publisher(publisher)
