# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Marks of an arm for a 3-D view: its joints and payloads, the pose and manipulability of a link.

All points are in the base frame [m].
"""

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics_tools.pictures.stick_figure import tool_link

FULL_TURN = 1.5 * math.pi
"""Angle [rad] of the arc of an effort at its limit; a whole turn would not show its sign."""
LARGEST_RATIO = 1.2
"""Fraction of the limit beyond which arcs do not grow."""
_ARC_STEP = 0.15
"""Angle [rad] between two points of an arc."""
_HEAD = 0.3
"""Length of an arrowhead, as a fraction of the radius of an arc."""
_MARK_SIZE, _LEAST_SIZE, _LARGEST_SIZE = 0.12, 0.02, 0.3
"""Radius of an arc: as a fraction of the reach; smallest and largest [m]."""
_PAYLOAD_DENSITY = 2000.0
"""Density [kg/m³] of the ball that represents a payload."""


class JointPlace(NamedTuple):
    """Where a joint is: its origin and the direction of its axis, (3,); whether it slides."""

    origin: FloatArray
    axis: FloatArray
    slides: bool


class ArmMarks:
    """The marks of one arm with its loads. Not for two threads at a time."""

    def __init__(self, arm: ArmModel, link: str = '') -> None:
        """Mark the pose of `link` (if empty, the one at the end), which must be in the arm."""
        self._arm, self._data = arm, arm.pinocchio_model.createData()
        self._joints = [arm.pinocchio_model.getJointId(name) for name in arm.joint_names]
        end, self._link = (arm.pinocchio_model.getFrameId(name, pin.FrameType.BODY) for name in (
            tool_link(arm), link or tool_link(arm)))
        offsets = [float(np.linalg.norm(place.translation))
                   for place in list(arm.pinocchio_model.jointPlacements)[2:]]
        tip = float(np.linalg.norm(arm.pinocchio_model.frames[end].placement.translation))
        self.reach = max(sum(offsets) + tip, _LEAST_SIZE / _MARK_SIZE)
        """The length of the arm from its first joint to its end, stretched out [m]."""
        self.size = min(max(_MARK_SIZE * self.reach, _LEAST_SIZE), _LARGEST_SIZE)
        """Radius of an arc [m]."""
        mass = sum(inertia.mass for inertia in list(arm.pinocchio_model.inertias)[1:])
        self.weight = 9.81 * mass if mass > 0.0 else 1.0
        """[N] on Earth: the scale of forces."""

    def move(self, q: FloatArray) -> None:
        """Set the position q (n,) for the next marks."""
        model, data = self._arm.pinocchio_model, self._data
        pin.computeJointJacobians(model, data, self._arm.coordinates.position(q))
        pin.updateFramePlacements(model, data)

    def joints(self) -> list[JointPlace]:
        """Return the places of the joints."""
        places = []
        for joint, kind in zip(self._joints, self._arm.joint_kinds):
            slides = kind == 'prismatic'
            column = pin.getJointJacobian(
                self._arm.pinocchio_model, self._data, joint, pin.LOCAL_WORLD_ALIGNED).reshape(
                    6, -1)[:, self._arm.pinocchio_model.joints[joint].idx_v]
            places.append(JointPlace(
                np.array(self._data.oMi[joint].translation),
                np.array(column[:3] if slides else column[3:]), slides))
        return places

    def pose(self) -> tuple[FloatArray, FloatArray]:
        """Return origin (3,) and rotation to the base frame (3, 3) of the link."""
        pose = self._data.oMf[self._link]
        return np.array(pose.translation), np.array(pose.rotation)

    def manipulability(self) -> tuple[FloatArray, FloatArray]:
        """
        Return the half-axes (3,) [m/s] and their directions, as the columns of a rotation (3, 3).

        They span the velocities of the link's origin at joint velocities with the norm 1 rad/s,
        or m/s: the ellipsoid of J Jᵀ (T. Yoshikawa, Int. J. Robotics Research 4(2), 1985).
        """
        J = pin.getFrameJacobian(
            self._arm.pinocchio_model, self._data, self._link, pin.LOCAL_WORLD_ALIGNED)[:3]
        J = self._arm.coordinates.jacobian(J)
        squares, U = np.linalg.eigh(J @ J.T)
        return np.sqrt(np.maximum(squares, 0.0)), U * [1.0, 1.0, np.linalg.det(U)]

    def payloads(self) -> list[tuple[FloatArray, float]]:
        """Return the centre of mass (3,) of each load, and the radius [m] of its ball."""
        balls = []
        for load in self._arm.payloads:
            frame = self._arm.pinocchio_model.getFrameId(load.link, pin.FrameType.BODY)
            centre = np.array(self._data.oMf[frame].act(load.com))
            balls.append((centre, ball_radius(load.mass)))
        return balls


def ball_radius(mass: float) -> float:
    """Return the radius [m] of the ball that represents a payload [kg]."""
    return float((0.75 * mass / (math.pi * _PAYLOAD_DENSITY)) ** (1.0 / 3.0))


def effort_scale(effort: FloatArray, limit: FloatArray) -> FloatArray:
    """Return the effort (n,) of an arc of FULL_TURN: the limit, or else the largest effort."""
    largest = float(np.abs(effort).max(initial=0.0)) or 1.0
    return np.where(np.isfinite(limit) & (limit > 0.0), limit, largest)


def effort_line(place: JointPlace, ratio: float, size: float) -> FloatArray:
    """
    Return the line (k, 3) of an effort: an arc about the axis, right-handed if it is positive.

    The line ends in an arrowhead, which is not longer than the line. At the limit, the arc covers
    FULL_TURN. The line of a prismatic joint is straight, with a length of 3 sizes at the limit.
    """
    ratio = min(max(ratio, -LARGEST_RATIO), LARGEST_RATIO)
    sign = math.copysign(1.0, ratio)
    first, second = _across(place.axis)
    if place.slides:
        length = 3.0 * size * ratio
        line = place.origin + np.outer([0.0, length], place.axis)
        return _with_head(line, sign * place.axis, first, min(_HEAD * size, abs(length)))
    turn = FULL_TURN * ratio
    angles = np.linspace(0.0, turn, max(2, math.ceil(abs(turn) / _ARC_STEP) + 1))
    line = place.origin + size * (
        np.outer(np.cos(angles), first) + np.outer(np.sin(angles), second))
    out = np.cos(turn) * first + np.sin(turn) * second
    along = sign * (np.cos(turn) * second - np.sin(turn) * first)
    return _with_head(line, along, out, size * min(_HEAD, abs(turn)))


def _with_head(
    line: FloatArray, along: FloatArray, across: FloatArray, length: float,
) -> FloatArray:
    """Return a line (k, 3) with a head of this length at its end, in the plane of both axes."""
    tip, back = line[-1], line[-1] - length * along
    aside = 0.7 * length * across
    return np.vstack([line, back + aside, tip, back - aside])


def _across(axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors (3,) that are right-handed with an axis."""
    first = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    first = first / np.linalg.norm(first)
    return np.asarray(first), np.asarray(np.cross(axis, first))
