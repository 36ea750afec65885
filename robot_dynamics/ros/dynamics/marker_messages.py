# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The marks of an arm as messages for RViz and Foxglove."""

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.pictures.arm_marks import ArmMarks, effort_line, effort_scale
from robot_dynamics.reporting.figures import BLUE, GREY, ORANGE, PURPLE, VERMILION
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

LIFETIME = Duration(nanosec=500_000_000)
"""A mark that is not renewed goes: a payload that was cleared, a state that came no more."""
WARM, HOT = 0.5, 0.9
"""Shares of the limit from which an effort is drawn in a warning colour."""


def drawn(
    marks: ArmMarks, arm: ArmModel, q: FloatArray, effort: FloatArray,
    external: FloatArray | None,
) -> MarkerArray:
    """
    Return the marks of an arm at q; all arguments are (n,). Headers are left to the caller.

    A line and a text for the effort of each joint, coloured by its share of the limit; where the
    external effort is known, a line for it at each joint, and the force on the tool that explains
    it, if one does; a ball for each payload.
    """
    marks.move(q)
    places, limit = marks.joints(), arm.limits.effort
    full = effort_scale(effort, limit)
    markers = []
    for i, (place, ratio) in enumerate(zip(places, (effort / full).tolist())):
        unit = 'N' if place.slides else 'N m'
        colour = _colour_of(abs(ratio), bool(np.isfinite(limit[i])))
        markers.append(_line('effort', i, effort_line(place, ratio, marks.size), marks, colour))
        markers.append(_text(
            i, place.origin + 1.2 * marks.size * place.axis,
            f'{round(effort[i], 1) + 0.0:.1f} {unit}', marks))
    if external is not None:
        for i, (place, ratio) in enumerate(zip(places, (external / full).tolist())):
            line = effort_line(place, ratio, 1.3 * marks.size)
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


def _colour_of(ratio: float, has_limit: bool) -> str:
    if not has_limit:
        return GREY
    return BLUE if ratio < WARM else ORANGE if ratio < HOT else VERMILION


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
    """Return an arrow that ends at the tool; half the reach long for the weight of the arm."""
    marker = _marker('external force', 0, Marker.ARROW, PURPLE, 0.15 * marks.size)
    marker.scale.y, marker.scale.z = 0.35 * marks.size, 0.5 * marks.size
    length = 0.5 * marks.reach / marks.weight
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
