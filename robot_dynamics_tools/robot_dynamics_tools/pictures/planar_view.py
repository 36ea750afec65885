# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A planar chain from any URDF, viewed along the axes of its joints.

`planar.chain` has the recursion for links whose centres of mass lie on the links. This module
takes the passes of the general recursive Newton-Euler algorithm (R. Featherstone, *Rigid Body
Dynamics Algorithms*, Springer 2008, section 5.3) and projects them on the plane of motion. For an
arm of `planar_urdf` both results are equal.
"""

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import ModelError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.planar.chain import NewtonEulerPass

_PARALLEL = 1e-6
"""Largest sine between two axes, or fraction of gravity, that counts as zero."""
_SHORTEST = 1e-6
"""[m]"""


class Plane(NamedTuple):
    """
    Axes of the plane in the base frame, each (3,): to the side, up, and the rotation axis.

    Turning from `up` to `side` is positive, as in `planar.chain`; `normal` = up × side.
    """

    side: FloatArray
    up: FloatArray
    normal: FloatArray


class PlanarView:
    """
    The plane in which an arm moves, and the motion in this plane. Not for two threads at a time.

    Motions are in the order of `arm.joint_names`; links, and joints in results, are counted from
    the base. `up` is against gravity; if gravity is perpendicular to the plane, it is along the
    arm at zero.
    """

    def __init__(self, arm: ArmModel) -> None:
        """Raise ModelError for an arm that is no chain of joints turning about parallel axes."""
        self.arm = arm
        self._model = arm.pinocchio_model
        self._data = self._model.createData()
        self._count = self._model.njoints - 1
        self._check_chain()
        zero = np.zeros(arm.joint_count)
        self._place(zero)
        # in the base frame, (n, 3), from the base on; Pinocchio returns a flat array for one joint
        axes = np.asarray(pin.computeJointJacobians(
            self._model, self._data, arm.coordinates.position(zero)).reshape(6, -1)[3:].T)
        sines = np.linalg.norm(np.cross(axes[:, None], axes), axis=2)
        if sines.max() > _PARALLEL:
            together = max(sines <= _PARALLEL, key=np.count_nonzero)
            such = [name for name, fits in zip(self.chain_names, together) if fits]
            raise self._no_chain(f'joints whose axes are parallel, such as {such}')
        self._tool = self._tool_frame(axes[0])
        self.plane = self._choose_plane(axes[0])
        q = arm.coordinates.position(zero)
        self.upright_at_zero = bool(
            np.abs(self._in_plane(self._points())[:, 0]).max() < _SHORTEST and not q.any())
        """Whether all joints and the tip are straight above joint 1 if all positions are 0."""

    @property
    def chain_names(self) -> tuple[str, ...]:
        """The names of the joints, starting at the base."""
        return tuple(self._model.names)[1:]

    def passes(self, q: FloatArray, v: FloatArray, a: FloatArray) -> NewtonEulerPass:
        """
        Return the passes of the Newton-Euler recursion for a motion, each (n,), row i for link i.

        Vectors are (x, y) in the plane, from joint 1; moments and rates are positive from up to
        the side. Pinocchio's own moment is about the joint's origin.
        """
        x = self.arm.coordinates
        state = x.position(q), x.rate(v), x.rate(a)
        model, data = self._model, self._data
        pin.forwardKinematics(model, data, *state)
        pin.updateFramePlacements(model, data)
        n, joints = self.plane.normal, range(1, self._count + 1)
        omega = np.array([data.oMi[i].rotation @ data.v[i].angular for i in joints])
        alpha = np.array([data.oMi[i].rotation @ data.a[i].angular for i in joints])
        origin = np.array([pin.getClassicalAcceleration(
            model, data, i, pin.LOCAL_WORLD_ALIGNED).linear for i in joints])
        points = self._points()
        coms = np.array([data.oMi[i].act(model.inertias[i].lever) for i in joints])
        lever = coms - points[:-1]
        com = origin + np.cross(alpha, lever) + np.cross(omega, np.cross(omega, lever))
        pin.rnea(model, data, *state)
        force = np.array([data.oMi[i].rotation @ data.f[i].linear for i in joints])
        moment = np.array([data.oMi[i].rotation @ data.f[i].angular for i in joints])
        flat = self._in_plane(points)
        return NewtonEulerPass(
            omega @ n, alpha @ n, flat[:-1], self._in_plane(coms, points[0]), flat[-1],
            self._on_axes(origin), self._on_axes(com), self._on_axes(force), moment @ n)

    def weight(self, link: int) -> FloatArray:
        """Return the weight of a link in the plane, (2,) [N]; links count from 0 at the base."""
        g = np.asarray(self._model.gravity.linear)
        return np.asarray(self._on_axes(self._model.inertias[link + 1].mass * g[None])[0])

    def reach(self) -> float:
        """Return the largest distance [m] of the tip or a joint from joint 1."""
        self._place(np.zeros(self.arm.joint_count))
        steps = np.diff(self._in_plane(self._points()), axis=0)
        return float(np.linalg.norm(steps, axis=1).sum())

    def _check_chain(self) -> None:
        arm, parents = self.arm, self._model.parents
        if arm.mimic_joints:
            raise self._no_chain(
                f'no joints that mimic others, as {[one.name for one in arm.mimic_joints]} do')
        slides = [name for name, kind in zip(arm.joint_names, arm.joint_kinds)
                  if kind == 'prismatic']
        if slides:
            raise self._no_chain(f'joints that turn, which {slides} do not')
        branches = [name for i, name in enumerate(self._model.names)
                    if i > 0 and parents[i] != i - 1]
        if branches:
            raise self._no_chain(f'one joint after the other, but {branches} branch off')

    def _no_chain(self, expected: str) -> ModelError:
        return ModelError(
            f'robot {self.arm.name!r} with the joints {list(self.arm.joint_names)} is no planar '
            f'chain: expected {expected}; joints that are not named are locked')

    def _place(self, q: FloatArray) -> None:
        pin.framesForwardKinematics(self._model, self._data, self.arm.coordinates.position(q))

    def _tool_frame(self, axis: FloatArray) -> int | None:
        """Return the frame on the last link that is farthest from its joint's axis, if any is."""
        origin = self._data.oMi[self._count].translation
        distances = {index: float(np.linalg.norm(np.cross(placement.translation - origin, axis)))
                     for index, placement in enumerate(self._data.oMf)
                     if self._model.frames[index].parentJoint == self._count}
        farthest = max(distances, key=lambda index: distances[index])
        return farthest if distances[farthest] > _SHORTEST else None

    def _choose_plane(self, axis: FloatArray) -> Plane:
        points = self._points()
        along = next(
            (step for step in np.diff(points, axis=0) - np.outer(
                np.diff(points, axis=0) @ axis, axis) if np.linalg.norm(step) > _SHORTEST),
            np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())]))
        g = np.asarray(self._model.gravity.linear)
        against = -(g - (g @ axis) * axis)
        size = max(float(np.linalg.norm(g)), 1.0)
        up = against if np.linalg.norm(against) > _PARALLEL * size else along
        up = up / np.linalg.norm(up)
        return Plane(np.cross(axis, up), up, axis)

    def _points(self) -> FloatArray:
        """Return the origins of all joints and the tip, (n + 1, 3)."""
        data = self._data
        last = data.oMi[self._count]
        tip = data.oMf[self._tool].translation if self._tool is not None else (
            last.act(2.0 * self._model.inertias[self._count].lever))
        return np.array([*(data.oMi[i].translation for i in range(1, self._count + 1)), tip])

    def _in_plane(self, points: FloatArray, origin: FloatArray | None = None) -> FloatArray:
        return self._on_axes(points - (points[0] if origin is None else origin))

    def _on_axes(self, vectors: FloatArray) -> FloatArray:
        return np.column_stack([vectors @ self.plane.side, vectors @ self.plane.up])
