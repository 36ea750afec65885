# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The regressor of a body that is rigidly attached to a link: τ = Y(q, q̇, q̈) π.

π = (m, m c, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz), first moments and tensor about the origin of the
link, in its frame. Y = J_Lᵀ A, with the Jacobian of the link and the regressor A of its
Newton–Euler equations. Source: C. G. Atkeson, C. H. An, J. M. Hollerbach, "Estimation of inertial
parameters of manipulator loads and links", Int. J. Robotics Research 5(3), 1986.
"""

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.payload import Payload
from robot_dynamics.model.pseudo_inertia import COUNT


class LoadRegressor:
    """The regressor Y of a load on one link; for one thread, because of scratch memory."""

    def __init__(self, arm: ArmModel, link: str) -> None:
        """Raise InvalidInputError for an unknown link."""
        arm.link_frame(link, 'link')
        self.arm = arm
        self._model, self._data = arm.pinocchio_model, arm.pinocchio_model.createData()
        self._frame = self._model.getFrameId(link, pin.FrameType.BODY)

    def __call__(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return Y, (m, n, 10), at m samples of shape (m, n)."""
        x, model, data, frame = self.arm.coordinates, self._model, self._data, self._frame
        tree = np.empty((len(q), model.nv, COUNT))
        for row, *state in zip(tree, x.position(q), x.rate(v), x.rate(a)):
            pin.rnea(model, data, *state)  # computes the accelerations that include gravity
            body = pin.frameBodyRegressor(model, data, frame)
            row[:] = pin.computeFrameJacobian(model, data, state[0], frame, pin.LOCAL).T @ body
        if x.is_identity:
            return tree
        return np.asarray(np.einsum('mtp,tj->mjp', tree, x.G, optimize=True))


def load_parameters(payload: Payload) -> FloatArray:
    """Return π (10,) of a payload."""
    inertia = pin.Inertia(payload.mass, payload.com, payload.inertia)
    return np.asarray(inertia.toDynamicParameters())
