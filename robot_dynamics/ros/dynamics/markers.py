# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The markers of `dynamics` for RViz: `~/markers`, published while there are subscribers.

While there are subscribers, the control path stores the newest state here and a timer draws it in
the thread of the executor. Without subscribers, no state is stored and the timer is stopped.
"""

import time
from typing import NamedTuple

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point
import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_output import ControlOutput
from robot_dynamics.control.controller import Controller
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.pictures.arm_marks import ArmMarks, effort_line, effort_scale
from robot_dynamics.reporting.figures import BLUE, GREY, ORANGE, PURPLE, VERMILION
from robot_dynamics.ros.middleware.conversions import stamp_to_ros
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

PERIOD = 1.0 / 30.0
"""[s] between two messages, on the steady clock."""
TIME_FRACTION = 0.1
"""Largest fraction of the time for drawing; arms of many joints are drawn less often."""
LIFETIME = Duration(nanosec=500_000_000)
"""Lifetime: RViz removes markers of a removed payload, or if no joint states arrive."""
WARM, HOT = 0.5, 0.9
"""Fractions of the effort limit from which an effort is drawn in a warning colour."""


class _Seen(NamedTuple):
    """The drawn quantities of a state: all (n,)."""

    stamp_ns: int
    q: FloatArray
    effort: FloatArray
    external: FloatArray | None


class LiveMarkers:
    """Publishes markers; the control thread calls `look`, the executor's thread the rest."""

    def __init__(self, node: Node) -> None:
        self._controller: Controller | None = None
        self._marks: tuple[object, ArmMarks] | None = None
        self._frame = ''
        self._seen: _Seen | None = None
        self._rests_until = 0.0
        self.is_on = False
        """Whether there are subscribers."""
        self._timer = node.create_timer(
            PERIOD, self._draw, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._timer.cancel()
        self._publisher = node.create_publisher(
            MarkerArray, '~/markers', QoSProfile(depth=1),
            event_callbacks=PublisherEventCallbacks(matched=self._match))

    def _match(self, event: object) -> None:
        self.is_on = self._publisher.get_subscription_count() > 0
        if self.is_on:
            self._timer.reset()
        else:
            self._timer.cancel()
            self._seen = None  # outdated for the next subscriber

    def set_controller(self, controller: Controller, frame: str) -> None:
        """Draw this arm, whose base link is `frame`, from the next state on."""
        self._controller, self._frame = controller, frame
        self._seen = self._marks = None

    def forget(self) -> None:
        """Draw nothing."""
        self._controller = self._seen = self._marks = None

    def look(
        self, stamp_ns: int, q: FloatArray, output: ControlOutput, external: FloatArray | None,
    ) -> None:
        """Take a state whose command is published, and the estimated external effort (n,)."""
        effort = output.computed_torque
        self._seen = _Seen(
            stamp_ns, q, effort if effort is not None else output.gravity_compensation, external)

    def _draw(self) -> None:
        began, controller = time.monotonic(), self._controller
        if controller is None or began < self._rests_until:
            return
        seen, self._seen = self._seen, None
        arm = controller.loaded_arm
        if seen is None or len(seen.q) != arm.joint_count:  # a state of the previous arm
            return
        if self._marks is None or self._marks[0] is not arm:
            self._marks = arm, ArmMarks(arm)
        with np.errstate(over='ignore', invalid='ignore'):
            message = drawn(self._marks[1], arm, seen.q, seen.effort, seen.external)
        stamp = stamp_to_ros(seen.stamp_ns)
        for marker in message.markers:
            marker.header.frame_id, marker.header.stamp = self._frame, stamp
        self._publisher.publish(message)
        self._rests_until = began + (time.monotonic() - began) / TIME_FRACTION


def drawn(
    marks: ArmMarks, arm: ArmModel, q: FloatArray, effort: FloatArray,
    external: FloatArray | None,
) -> MarkerArray:
    """
    Return the markers of an arm at q; all arguments are (n,). The caller sets the headers.

    There are a line and a text for the effort of each joint, with a colour by its fraction of the
    limit, and a ball for each payload. If the external effort is known, there are also a line for
    it at each joint, and the force on the tool that explains it, if one does.
    """
    marks.move(q)
    places, limit = marks.joints(), arm.limits.effort
    full = effort_scale(effort, limit)
    markers = []
    for i, (place, fraction) in enumerate(zip(places, (effort / full).tolist())):
        unit = 'N' if place.slides else 'N·m'
        colour = _colour_of(abs(fraction), bool(np.isfinite(limit[i])))
        markers.append(_line('effort', i, effort_line(place, fraction, marks.size), marks, colour))
        markers.append(_text(
            i, place.origin + 1.2 * marks.size * place.axis,
            f'{round(effort[i], 1) + 0.0:.1f} {unit}', marks))
    if external is not None:
        for i, (place, fraction) in enumerate(zip(places, (external / full).tolist())):
            line = effort_line(place, fraction, 1.3 * marks.size)
            markers.append(_line('external effort', i, line, marks, PURPLE))
        force = marks.tool_force(external)
        if force is not None:
            markers.append(_arrow(marks, force))
    for i, ball in enumerate(marks.payloads()):
        marker = _marker('payload', i, Marker.SPHERE, GREY, 2.0 * ball.radius)
        marker.scale.y = marker.scale.z = 2.0 * ball.radius
        marker.pose.position = _point(ball.centre)
        marker.color.a = 0.6
        markers.append(marker)
    return MarkerArray(markers=markers)


def _colour_of(fraction: float, has_limit: bool) -> str:
    if not has_limit:
        return GREY
    return BLUE if fraction < WARM else ORANGE if fraction < HOT else VERMILION


def _line(namespace: str, i: int, line: FloatArray, marks: ArmMarks, colour: str) -> Marker:
    marker = _marker(namespace, i, Marker.LINE_STRIP, colour, 0.12 * marks.size)
    marker.points = [_point(point) for point in line]
    return marker


def _text(i: int, place: FloatArray, text: str, marks: ArmMarks) -> Marker:
    marker = _marker('effort in numbers', i, Marker.TEXT_VIEW_FACING, GREY, 0.0)
    marker.text, marker.scale.z = text, 0.5 * marks.size
    marker.pose.position = _point(place)
    return marker


def _arrow(marks: ArmMarks, force: FloatArray) -> Marker:
    """Return an arrow that ends at the tool, as long as the arm at half of the arm's weight."""
    marker = _marker('external force', 0, Marker.ARROW, PURPLE, 0.25 * marks.size)
    marker.scale.y, marker.scale.z = 0.6 * marks.size, 0.8 * marks.size
    length = 2.0 * marks.reach / marks.weight
    longest = marks.reach / float(np.linalg.norm(force))
    tool = marks.tool()
    marker.points = [_point(tool - min(length, longest) * force), _point(tool)]
    return marker


def _marker(namespace: str, i: int, kind: int, colour: str, width: float) -> Marker:
    marker = Marker(ns=namespace, id=i, type=kind, action=Marker.ADD, lifetime=LIFETIME)
    marker.pose.orientation.w = 1.0
    marker.scale.x = width
    marker.color = _rgba(colour)
    return marker


def _rgba(colour: str) -> ColorRGBA:
    red, green, blue = (int(colour[i:i + 2], 16) / 255.0 for i in (1, 3, 5))
    return ColorRGBA(r=red, g=green, b=blue, a=1.0)


def _point(point: FloatArray) -> Point:
    x, y, z = point.tolist()
    return Point(x=x, y=y, z=z)
