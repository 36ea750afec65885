# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Gravity torque at rest, linear in masses and first moments: g(q) = Y(q) φ.

φ = (m, m c_x, m c_y, m c_z) of a body: [kg], [kg·m], in the frame of its link.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.regressor import COUNT, inertial_parameters, TorqueRegressor

NAMES = ('m', 'mx', 'my', 'mz')
"""Names of φ of a body."""
UNITS = ('kg', 'kg·m', 'kg·m', 'kg·m')


def gravity_parameters(arm: ArmModel) -> FloatArray:
    """Return φ (4 × bodies,) of the arm, with its payload."""
    return inertial_parameters(arm).reshape(-1, COUNT)[:, :len(NAMES)].ravel()


def gravity_regressor(arm: ArmModel, q: FloatArray) -> FloatArray:
    """Return Y (m, n, 4 × bodies) at positions (m, n); bodies as in `regressor`."""
    zero = np.zeros_like(q)
    Y = TorqueRegressor(arm)(q, zero, zero)
    return np.asarray(Y[:, :, np.arange(Y.shape[2]) % COUNT < len(NAMES)])


def link_columns(arm: ArmModel, link: str) -> FloatArray:
    """
    Return T (4 × bodies, 4): Y T is the regressor of a load on a link, in the frame of the link.

    Raises InvalidInputError for an unknown link.
    """
    frame = arm.link_frame(link, 'link')
    T = np.zeros((len(NAMES) * (arm.pinocchio_model.njoints - 1), len(NAMES)))
    if frame.parentJoint == 0:
        return T  # fixed to the base: no joint bears it
    body = T[len(NAMES) * (frame.parentJoint - 1):][:len(NAMES)]
    body[0, 0] = 1.0
    body[1:, 0] = frame.placement.translation
    body[1:, 1:] = frame.placement.rotation
    return T
