# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The markers for RViz: `~/markers`, published while there are subscribers.

While there are subscribers, the newest state is stored here and a timer draws it in the thread of
the executor. Without subscribers, no state is stored and the timer is stopped. The drawn efforts
are those of `effort_command`, or g(q) without a command.
"""

from collections.abc import Iterable, Sequence
import time
from typing import Any

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point
import numpy as np
import pinocchio as pin
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.ros.middleware.conversions import stamp_from_ros, stamp_to_ros
from robot_dynamics.ros.middleware.joint_state_reader import JointStateReader
from robot_dynamics.ros.middleware.pausing_timer import PausingTimer
from robot_dynamics.urdf.parser import parse_urdf
from robot_dynamics_tools.monitor.followed_model import Followed
from robot_dynamics_tools.monitor.states import MeasuredState
from robot_dynamics_tools.pictures.arm_marks import ArmMarks, effort_line, effort_scale
from robot_dynamics_tools.reporting import figures
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

PERIOD = 1.0 / 30.0
"""[s] between two messages, on the steady clock."""
TIME_FRACTION = 0.1
"""Largest fraction of the time for drawing; arms of many joints are drawn less often."""
LIFETIME = Duration(nanosec=500_000_000)
"""Lifetime: RViz removes markers of a removed payload, or if no joint states arrive."""
COMMANDS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
LARGEST_LAG_NS = 500_000_000
"""[ns] between a state and a command that is drawn."""
WARM, HOT = 0.5, 0.9
"""Fractions of the effort limit from which an effort is drawn in a warning colour."""


AXES = '#FF0000', '#00FF00', '#0000FF'
"""Colours of x, y and z, as in RViz."""
SMALL = 0.02
"""Fraction of the scale of a wrench; a smaller force or torque is noise."""
FORCE_SCALE, TORQUE_SCALE = 0.5, 0.05
"""Force by the arm's weight, torque by weight and reach, whose arrow is as long as the arm."""
MANIPULABILITY_SCALE = 0.25
"""[s]: length of a half-axis by its velocity."""


class LiveMarkers:
    """Publishes markers; the thread of the states calls `update`, the executor the rest."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._model: Followed | None = None
        self._marks: ArmMarks | None = None
        self._frame = ''
        self._seen: tuple[MeasuredState, FloatArray | None, FloatArray | None] | None = None
        self._command: JointState | None = None
        self._commands: Any = None
        self._rests_until = 0.0
        self.is_on = False
        """Whether there are subscribers."""
        self._timer = PausingTimer(node, PERIOD, self._draw)
        self._publisher = node.create_publisher(
            MarkerArray, '~/markers', QoSProfile(depth=1),
            event_callbacks=PublisherEventCallbacks(matched=self._match))

    def _match(self, event: object) -> None:
        is_on = self._publisher.get_subscription_count() > 0
        if is_on == self.is_on:
            return
        self.is_on = is_on
        self._timer.run(is_on)
        if is_on:
            self._commands = self._node.create_subscription(
                JointState, 'effort_command', self._on_command, COMMANDS)
        else:
            self._node.destroy_subscription(self._commands)
            self._seen = self._command = None  # outdated for the next subscriber

    def _on_command(self, message: JointState) -> None:
        self._command = message

    def set_model(self, model: Followed | None, link: str = '') -> None:
        """Draw this arm and the pose of a link, None without a model."""
        if model is not None and (self._model is None or self._model.base is not model.base):
            self._frame, self._seen = parse_urdf(model.xml).root_link, None
        self._model, self._marks = model, None if model is None else ArmMarks(model.arm, link)

    def update(
        self, state: MeasuredState, external: FloatArray | None, wrench: FloatArray | None,
    ) -> None:
        """Take a state, its external effort (n,) and wrench (6,)."""
        self._seen = state, external, wrench

    def _draw(self) -> None:
        began, model, marks = time.monotonic(), self._model, self._marks
        if model is None or marks is None or began < self._rests_until:
            return
        seen, self._seen = self._seen, None
        if seen is None or len(seen[0].q) != model.arm.joint_count:  # of the previous arm
            return
        state, external, wrench = seen
        with np.errstate(over='ignore', invalid='ignore'):
            effort = self._effort(model, state)
            message = drawn(marks, model.arm, state.q, effort, external, wrench)
        stamp = stamp_to_ros(state.stamp_ns)
        for marker in message.markers:
            marker.header.frame_id, marker.header.stamp = self._frame, stamp
        self._publisher.publish(message)
        self._rests_until = began + (time.monotonic() - began) / TIME_FRACTION

    def _effort(self, model: Followed, state: MeasuredState) -> FloatArray:
        """Return the commanded effort (n,) at the joints, g(q) if there is no command."""
        command, arm = self._command, model.arm
        if command is None or abs(
                state.stamp_ns - stamp_from_ros(command.header.stamp)) > LARGEST_LAG_NS:
            return UncheckedArmDynamics(arm).rigid_body.gravity(state.q)
        effort = arm.given_drive.torque(JointStateReader(arm.joint_names).finite_effort(command))
        return effort + model.robot_gravity(state.q) if (
            model.convention.compensates_gravity) else effort


def drawn(
    marks: ArmMarks, arm: ArmModel, q: FloatArray, effort: FloatArray,
    external: FloatArray | None, wrench: FloatArray | None = None,
) -> MarkerArray:
    """
    Return the markers of an arm at q (n,), to which the caller adds headers.

    There are a line and a text for the effort (n,) of each joint, with a colour by its fraction of
    the limit, a ball for each payload, the axes of the link of `marks` and its manipulability
    ellipsoid. If they are known, there are also a line for the external effort (n,) at each joint,
    and arrows for force and torque of the external wrench (6,) on the link, in its axes.
    """
    marks.move(q)
    places, limit = marks.joints(), arm.limits.effort
    full, width = effort_scale(effort, limit), (0.12 * marks.size, 0.0, 0.0)
    markers = []
    for i, (place, fraction) in enumerate(zip(places, (effort / full).tolist())):
        markers.append(_marker(
            'effort', i, Marker.LINE_STRIP, _colour_of(abs(fraction), bool(np.isfinite(limit[i]))),
            width, points=effort_line(place, fraction, marks.size)))
        markers.append(_marker(
            'effort in numbers', i, Marker.TEXT_VIEW_FACING, figures.GREY,
            (0.0, 0.0, 0.5 * marks.size), place.origin + 1.2 * marks.size * place.axis,
            text=f'{round(effort[i], 1) + 0.0:.1f} {"N" if place.slides else "N·m"}'))
    if external is not None:
        markers += [
            _marker('external effort', i, Marker.LINE_STRIP, figures.PURPLE, width,
                    points=effort_line(place, fraction, 1.3 * marks.size))
            for i, (place, fraction) in enumerate(zip(places, (external / full).tolist()))]
    markers += [
        _marker('payload', i, Marker.SPHERE, figures.YELLOW, 3 * (2.0 * radius,), centre)
        for i, (centre, radius) in enumerate(marks.payloads())]
    return MarkerArray(markers=markers + _at_link(marks, wrench))


def _at_link(marks: ArmMarks, wrench: FloatArray | None) -> list[Marker]:
    """Return the axes of the link, its manipulability ellipsoid and the wrench (6,) on it."""
    origin, R = marks.pose()
    markers = [
        _arrow('frame axes', i, colour, origin, origin + 1.5 * marks.size * R[:, i], 0.1, marks)
        for i, colour in enumerate(AXES)]
    half_axes, U = marks.manipulability()
    ellipsoid = _marker(
        'manipulability', 0, Marker.SPHERE, figures.GREEN,
        np.maximum(2.0 * MANIPULABILITY_SCALE * half_axes, 0.02 * marks.size).tolist(), origin,
        opacity=0.25)
    turn = ellipsoid.pose.orientation
    turn.x, turn.y, turn.z, turn.w = pin.Quaternion(U).coeffs().tolist()
    markers.append(ellipsoid)
    if wrench is None:
        return markers
    for kind, vector, colour, full in (
            ('force', R @ wrench[:3], figures.PURPLE, FORCE_SCALE * marks.weight),
            ('torque', R @ wrench[3:], figures.SKY, TORQUE_SCALE * marks.weight * marks.reach)):
        ratio = float(np.linalg.norm(vector)) / full
        if ratio > SMALL:
            along = marks.reach / max(ratio, 1.0) / full * vector
            ends = (origin - along, origin) if kind == 'force' else (origin, origin + along)
            markers.append(_arrow(f'external {kind}', 0, colour, *ends, 0.25, marks))
    return markers


def _colour_of(fraction: float, has_limit: bool) -> str:
    if not has_limit:
        return figures.GREY
    if fraction >= HOT:
        return figures.VERMILION
    return figures.BLUE if fraction < WARM else figures.ORANGE


def _arrow(
    namespace: str, i: int, colour: str, start: FloatArray, end: FloatArray, width: float,
    marks: ArmMarks,
) -> Marker:
    """Return an arrow whose shaft has a width in radii of an arc; a short one is all head."""
    width *= marks.size
    head = min(3.2 * width, float(np.linalg.norm(end - start)))
    return _marker(
        namespace, i, Marker.ARROW, colour, (width, 2.4 * width, head), points=(start, end))


def _marker(
    namespace: str, i: int, kind: int, colour: str, size: Sequence[float],
    place: FloatArray | None = None, points: Iterable[FloatArray] = (), text: str = '',
    opacity: float = 1.0,
) -> Marker:
    marker = Marker(
        ns=namespace, id=i, type=kind, action=Marker.ADD, lifetime=LIFETIME, text=text,
        points=list(map(_point, points)))
    marker.pose.orientation.w = 1.0
    if place is not None:
        marker.pose.position = _point(place)
    marker.scale.x, marker.scale.y, marker.scale.z = size
    red, green, blue = (int(colour[i:i + 2], 16) / 255.0 for i in (1, 3, 5))
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=opacity)
    return marker


def _point(point: FloatArray) -> Point:
    x, y, z = point.tolist()
    return Point(x=x, y=y, z=z)
