# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Pose and Jacobian of a link without its dynamics, for control loops and inverse kinematics."""

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel


class FrameKinematics:
    """
    Forward kinematics of a link, with finite float64 arrays; for one thread.

    Translations are in the base frame [m]; rotations (3, 3) are from the link to the base.
    """

    def __init__(self, arm: ArmModel, frame: str, field: str = 'frame') -> None:
        """Raise InvalidInputError for an unknown link, as a value of `field`."""
        arm.link_frame(frame, field)
        self.frame = frame
        self._x, self._model = arm.coordinates, arm.pinocchio_model
        self._id = self._model.getFrameId(frame, pin.FrameType.BODY)
        self._data = self._model.createData()

    def pose(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return translation (3,) and rotation (3, 3) at q (n,)."""
        pin.forwardKinematics(self._model, self._data, self._x.position(q))
        pose = pin.updateFramePlacement(self._model, self._data, self._id)
        return pose.translation.copy(), pose.rotation.copy()

    def jacobian(self, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return translation, rotation, and J (6, n) along the axes of the base, at q (n,)."""
        pin.computeJointJacobians(self._model, self._data, self._x.position(q))
        pose = pin.updateFramePlacement(self._model, self._data, self._id)
        J = pin.getFrameJacobian(self._model, self._data, self._id, pin.LOCAL_WORLD_ALIGNED)
        return pose.translation.copy(), pose.rotation.copy(), self._x.jacobian(J)


def rotation_vector(R: FloatArray) -> FloatArray:
    """Return the axis of a rotation (3, 3) times its angle (3,) [rad], at most π."""
    return np.asarray(pin.log3(R))


def last_link(arm: ArmModel) -> str:
    """Return the last of the links that the largest number of joints moves."""
    q = np.zeros(arm.joint_count)
    moved = [np.count_nonzero(FrameKinematics(arm, link).jacobian(q)[2].any(axis=0))
             for link in arm.link_names]
    return arm.link_names[len(moved) - 1 - int(np.argmax(moved[::-1]))]
