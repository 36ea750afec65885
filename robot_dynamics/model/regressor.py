# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The torque regressor: the efforts of rigid bodies are linear in their inertial parameters.

τ = Y(q, q̇, q̈) φ, with the ten parameters φ = (m, m c, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz) of each
body; the tensor is about the origin of its frame. There is one body per moving joint of
Pinocchio, which includes the links that are fixed to it. Source: C. G.
Atkeson, C. H. An, J. M. Hollerbach, "Estimation of inertial parameters of manipulator loads and
links", Int. J. Robotics Research 5(3), 1986. The reflected inertia of rotors is not included.
"""

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel

COUNT = 10
"""Number of parameters of a body."""
NAMES = ('m', 'mx', 'my', 'mz', 'Ixx', 'Ixy', 'Iyy', 'Ixz', 'Iyz', 'Izz')


def body_names(arm: ArmModel) -> tuple[str, ...]:
    """Return the link that moves with each joint of Pinocchio; bodies have these names."""
    names = list(arm.pinocchio_model.names)
    for frame in arm.pinocchio_model.frames:
        if frame.type == pin.FrameType.BODY and frame.placement.isIdentity(1e-12):
            index = frame.parentJoint
            if names[index] == arm.pinocchio_model.names[index]:
                names[index] = frame.name
    return tuple(names[1:])


def parameter_names(arm: ArmModel) -> tuple[str, ...]:
    """Return the names of φ, such as 'Ixx(forearm_link)'."""
    return tuple(f'{name}({body})' for body in body_names(arm) for name in NAMES)


def inertial_parameters(arm: ArmModel) -> FloatArray:
    """Return φ (10 × bodies,) of the arm, with its payload."""
    inertias = list(arm.pinocchio_model.inertias)[1:]
    return np.concatenate([inertia.toDynamicParameters() for inertia in inertias])


class TorqueRegressor:
    """The regressor Y of one arm; for one thread, because of Pinocchio's scratch memory."""

    def __init__(self, arm: ArmModel) -> None:
        self.arm = arm
        self.parameter_count = COUNT * (arm.pinocchio_model.njoints - 1)
        self._model, self._data = arm.pinocchio_model, arm.pinocchio_model.createData()

    def __call__(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return Y, (m, n, parameters), at m samples of shape (m, n)."""
        x = self.arm.coordinates
        tree = np.empty((len(q), self._model.nv, self.parameter_count))
        for row, *state in zip(tree, x.position(q), x.rate(v), x.rate(a)):
            row[:] = self._of_state(*state)
        if x.is_identity:
            return tree
        return np.asarray(np.einsum('mtp,tj->mjp', tree, x.G, optimize=True))

    def _of_state(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return Y of the joints of Pinocchio."""
        return np.asarray(pin.computeJointTorqueRegressor(self._model, self._data, q, v, a))


class LoadRegressor(TorqueRegressor):
    """
    The regressor Y of a body that is rigidly attached to a link: τ = Y(q, q̇, q̈) π.

    π = (m, m c, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz), first moments and tensor about the origin of
    the link, in its frame. Y = J_Lᵀ A, with the Jacobian of the link and the regressor A of its
    Newton–Euler equations.
    """

    def __init__(self, arm: ArmModel, link: str) -> None:
        """Raise InvalidInputError for an unknown link."""
        super().__init__(arm)
        arm.link_frame(link, 'link')
        self.parameter_count = COUNT
        self._frame = self._model.getFrameId(link, pin.FrameType.BODY)

    def _of_state(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        model, data, frame = self._model, self._data, self._frame
        pin.rnea(model, data, q, v, a)  # computes the accelerations that include gravity
        body = pin.frameBodyRegressor(model, data, frame)
        return np.asarray(pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL).T @ body)


class GravityRegressor(TorqueRegressor):
    """The regressor G of gravity: g(q) = G(q) γ, with γ (3,) [m/s²] in the base frame."""

    def __init__(self, arm: ArmModel) -> None:
        super().__init__(arm)
        self.parameter_count = 3
        self._model = arm.pinocchio_model.copy()

    def _of_state(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        columns = []
        for axis in np.eye(3):
            self._model.gravity.linear = axis
            columns.append(pin.computeGeneralizedGravity(self._model, self._data, q).copy())
        return np.stack(columns, axis=1)


def random_states(arm: ArmModel, count: int, seed: int = 0) -> (
        tuple[FloatArray, FloatArray, FloatArray]):
    """Return positions within the limits, velocities and accelerations, each (count, n)."""
    rng = np.random.default_rng(seed)
    n = arm.joint_count
    low = np.where(np.isfinite(arm.limits.lower), arm.limits.lower, -np.pi)
    high = np.where(np.isfinite(arm.limits.upper), arm.limits.upper, np.pi)
    return (
        rng.uniform(low, high, (count, n)), rng.normal(size=(count, n)),
        rng.normal(scale=3.0, size=(count, n)))
