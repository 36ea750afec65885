# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Actions of the controls of the viewer: references, pushes, loads, a reset.

They are messages to the nodes.
"""

import time

from geometry_msgs.msg import InertiaStamped, WrenchStamped
import numpy as np
from robot_dynamics.arrays import FloatArray, wrap_to_pi
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.payload import make_payload
from robot_dynamics.ros.middleware.conversions import payload_to_ros, trajectory_to_ros
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from robot_dynamics_tools.excitation.demo_motion import rest_to_rest_seconds
from robot_dynamics_tools.pictures.arm_marks import ball_radius
from robot_dynamics_tools.viewer.node import ViewerNode
from robot_dynamics_tools.viewer.panel import ArmPanel
from robot_dynamics_tools.viewer.scene import ArmScene
from trajectory_msgs.msg import JointTrajectory

SEND_PERIOD = 0.1
"""[s] between two references while a slider is moved."""
LOAD_TIME = 0.5
"""Transition time [s] of a load: the arm hardly moves if one node gets it later."""
RISE_TIME = 0.25
"""Shortest time [s] in which a joint reaches its speed."""
UNLIMITED_SPEED = {'prismatic': 0.25}
"""Velocity of a prismatic joint without a limit [m/s]; of a revolute joint, 1 rad/s."""
HELD = 3600.0
"""[s] to the second point of a reference, which is held."""
_STOPPING = 4.0
"""The acceleration of a quintic from a velocity v to rest at the same place in T is ≈ 4 v / T."""


class ArmPage:
    """
    An arm on the page, which performs the actions of its panel in each cycle.

    `close` ends active actions, and removes the arm.
    """

    def __init__(
        self, node: ViewerNode, xml: str, arm: ArmModel, scene: ArmScene, panel: ArmPanel,
    ) -> None:
        self._node, self.xml, self.arm, self.scene, self.panel = node, xml, arm, scene, panel
        self._sender = f'viewer-{id(self):x}'
        self._push: tuple[FloatArray, str, float] | None = None
        """Force (3,) [N] in the base frame on a link, until a time [s]."""
        self._q: FloatArray | None = None
        self.is_wished = False
        """Whether a slider was moved and the reference for it is not published yet."""
        self.is_own = False
        """Whether the newest reference is from this page."""
        self.sent_time = -np.inf
        """Time [s] of the last published reference on the monotonic clock."""
        self.answer = ''
        """Text about the result of the newest action."""
        panel.on = {
            'reference': self._wish, 'hold': self._hold, 'push': self._begin_push,
            'reset': self._reset, 'attach': lambda: self._set_load(panel.load[0]),
            'detach': lambda: self._set_load(0.0)}

    def turn(self, q: FloatArray | None, v: FloatArray | None) -> None:
        """Continue the active actions; the arm is at q, v (n,), None if unknown."""
        now, self._q = time.monotonic(), q
        if self.is_wished and now - self.sent_time >= SEND_PERIOD:
            self._send_reference(q, v)
        if self._push is not None:
            force, link, until = self._push
            if now < until:
                self._node.push(force_on(link, force, self.scene.rotation(link)))
            else:
                self._end_push()

    def close(self) -> None:
        """End all actions on the arm, and remove it from the page."""
        self._end_push()
        self.scene.close()
        self.panel.close()

    def _end_push(self) -> None:
        if self._push is not None:
            self._node.push(force_on(self._push[1], np.zeros(3), np.eye(3)))
            self._push = None

    # ------------------------------------------------------------------ references

    def receive(self, trajectory: JointTrajectory) -> None:
        """Note a published reference, from this page or from others."""
        self.is_own = trajectory.header.frame_id == self._sender

    def _wish(self) -> None:
        self.is_wished = True

    def _hold(self) -> None:
        if self._q is not None:
            self.panel.follow(self._q)
        self._wish()

    def _send_reference(self, q: FloatArray | None, v: FloatArray | None) -> None:
        self.is_wished = False
        goal = self.panel.take_goal()
        if q is None:
            self.answer = 'no joint states: the start of the reference is unknown'
            return
        seconds = motion_time(self.arm, q, goal, self.panel.speed, v)
        self._node.send_trajectory(reference_to(self.arm, goal, seconds, self._sender))
        self.sent_time, self.is_own = time.monotonic(), True
        self.answer = f'reference sent: {seconds:.1f} s'

    # ------------------------------------------------------------------ the simulated arm

    def _begin_push(self) -> None:
        if not self._node.has_simulated_arm:
            self.answer = f'node {self._node.simulated_arm} not found; push a real arm by hand'
            return
        force, link, seconds = self.panel.push
        self._end_push()
        self._push = force, link, time.monotonic() + seconds

    def _reset(self) -> None:
        self._end_push()
        self.is_own = self.is_wished = False
        self._node.reset_simulated_arm(self._take_answer)

    # ------------------------------------------------------------------ loads

    def _set_load(self, mass: float) -> None:
        panel, node = self.panel, self._node
        for is_for, name in zip(panel.load_is_for, (node.dynamics, node.simulated_arm)):
            if is_for:
                node.set_payload(name, ball(panel.load[1], mass), LOAD_TIME, self._take_answer)

    def _take_answer(self, words: str) -> None:
        self.answer = words


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
    fastest = speed * np.where(np.isfinite(limit), limit, default)
    way = np.where(arm.is_continuous, wrap_to_pi(goal - q), goal - q)
    return max(
        rest_to_rest_seconds(way, fastest, fastest / RISE_TIME),
        0.0 if v is None else float((_STOPPING * np.abs(v) * RISE_TIME / fastest).max()))


def reference_to(arm: ArmModel, goal: FloatArray, seconds: float, sender: str) -> JointTrajectory:
    """
    Return the reference that reaches a goal (n,) after a time, and holds it.

    Of two points, the last one is held; a single point would be a sample of a stream. `sender`
    is in `frame_id`.
    """
    rest = 2 * [np.zeros(arm.joint_count)]
    message = trajectory_to_ros(make_trajectory(
        arm.joint_names, [seconds, seconds + HELD], [goal, goal], rest, rest))
    message.header.frame_id = sender
    return message


def ball(link: str, mass: float) -> InertiaStamped:
    """Return the load of a ball [kg] at the origin of a link; mass 0 removes the load."""
    message = payload_to_ros(make_payload(
        link, mass, (0.0, 0.0, 0.0), 0.4 * mass * ball_radius(mass)**2 * np.eye(3)))
    message.header.frame_id = link
    return message


def force_on(link: str, force: FloatArray, R: FloatArray) -> WrenchStamped:
    """Return a force (3,) [N] of the base frame on a link, which R (3, 3) turns into it."""
    message = WrenchStamped()
    message.header.frame_id = link
    f = message.wrench.force
    f.x, f.y, f.z = (R.T @ force).tolist()
    return message
