# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The messages that the controls of the viewer send to the nodes."""

import math

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import InertiaStamped, WrenchStamped
import numpy as np
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND, wrap_to_pi
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.payload import make_payload
from robot_dynamics.ros.middleware.conversions import floats_to_ros, payload_to_ros
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

DENSITY = 2000.0
"""Density [kg/m^3] of the ball that represents a load."""
SHORTEST_MOTION = 0.5
"""[s]"""
RISE_TIME = 0.25
"""Shortest time [s] in which a joint reaches its speed."""
UNLIMITED_SPEED = {'prismatic': 0.25}
"""Velocity of a prismatic joint without a limit [m/s]; of a revolute joint, 1 rad/s."""
HELD = 3600.0
"""[s] to the second point of a reference, which is held."""

# Of a quintic from rest to rest over D in T: the largest velocity is 15/8 D/T, the largest
# acceleration 10/sqrt(3) D/T^2; from a velocity v to rest where it is, about 4 v/T.
_PEAK_VELOCITY, _PEAK_ACCELERATION, _STOPPING = 15.0 / 8.0, 10.0 / math.sqrt(3.0), 4.0


def motion_time(
    arm: ArmModel, q: FloatArray, goal: FloatArray, speed: float, v: FloatArray | None = None,
) -> float:
    """
    Return the duration [s] of a motion from q to a goal, both (n,).

    From rest, no joint is faster than `speed`, a fraction of its velocity limit. With an initial
    velocity v (n,) the duration allows to stop, so that a moving goal is followed smoothly.
    """
    default = np.array([UNLIMITED_SPEED.get(kind, 1.0) for kind in arm.joint_kinds])
    limit = arm.limits.velocity
    fastest = speed * np.where(np.isfinite(limit) & (limit > 0.0), limit, default)
    way = np.abs(np.where(
        arm.is_continuous, wrap_to_pi(goal - q), goal - q))
    return float(max(
        SHORTEST_MOTION, (_PEAK_VELOCITY * way / fastest).max(),
        np.sqrt(_PEAK_ACCELERATION * way * RISE_TIME / fastest).max(),
        0.0 if v is None else (_STOPPING * np.abs(v) * RISE_TIME / fastest).max()))


def reference_to(arm: ArmModel, goal: FloatArray, seconds: float, sender: str) -> JointTrajectory:
    """
    Return the reference that reaches a goal (n,) after a time, and holds it.

    Of two points, the last one is held; a single point would be a sample of a stream. `sender`
    is in `frame_id`.
    """
    rest = floats_to_ros(np.zeros(arm.joint_count))
    message = JointTrajectory(joint_names=list(arm.joint_names), points=[
        JointTrajectoryPoint(
            positions=floats_to_ros(goal), velocities=rest, accelerations=rest,
            time_from_start=_duration(time)) for time in (seconds, seconds + HELD)])
    message.header.frame_id = sender
    return message


def ball(link: str, mass: float) -> InertiaStamped:
    """Return the load of a ball [kg] at the origin of a link; mass 0 removes the load."""
    radius = (0.75 * mass / (math.pi * DENSITY)) ** (1.0 / 3.0)
    message = payload_to_ros(make_payload(
        link, mass, (0.0, 0.0, 0.0), 0.4 * mass * radius**2 * np.eye(3)))
    message.header.frame_id = link
    return message


def force_on(link: str, force: FloatArray, R: FloatArray) -> WrenchStamped:
    """Return a force (3,) [N] of the base frame on a link, which R (3, 3) turns into it."""
    message = WrenchStamped()
    message.header.frame_id = link
    f = message.wrench.force
    f.x, f.y, f.z = (R.T @ force).tolist()
    return message


def _duration(seconds: float) -> Duration:
    nanoseconds = round(1e9 * seconds)
    return Duration(sec=nanoseconds // NANOSECONDS_PER_SECOND,
        nanosec=nanoseconds % NANOSECONDS_PER_SECOND)
