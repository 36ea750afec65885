# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The torque regressor: the efforts of rigid bodies are linear in their inertial parameters.

τ = Y(q, q̇, q̈) φ, with the ten parameters φ of each body (`pseudo_inertia`). There is one body
per moving joint of Pinocchio, which includes the links that are fixed to it. The parameters of a
load on a link, about the origin of the link in its frame, are a linear map of those of its body.
Source: C. G. Atkeson, C. H. An, J. M. Hollerbach, "Estimation of inertial parameters of
manipulator loads and links", Int. J. Robotics Research 5(3), 1986. The reflected inertia of rotors
is not included.
"""

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.payload import Payload
from robot_dynamics.model.pseudo_inertia import (
    COUNT,
    NAMES,
    parameters_of,
    pseudo_inertia_matrix,
)


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
        self._data = arm.pinocchio_model.createData()

    def __call__(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return Y, (m, n, parameters), at m samples of shape (m, n)."""
        x, model, data = self.arm.coordinates, self.arm.pinocchio_model, self._data
        states = zip(x.position(q), x.rate(v), x.rate(a))
        tree = np.empty((len(q), model.nv, self.parameter_count))
        for row, state in zip(tree, states):
            row[:] = pin.computeJointTorqueRegressor(model, data, *state)
        if x.is_identity:
            return tree
        return np.asarray(np.einsum('mtp,tj->mjp', tree, x.G, optimize=True))


class LoadRegressor:
    """The regressor Y of a rigid body that is attached to one link; for one thread."""

    def __init__(self, arm: ArmModel, link: str) -> None:
        """Raise InvalidInputError for an unknown link."""
        frame = arm.link_frame(link, 'link')
        self.arm = arm
        self._regressor = TorqueRegressor(arm)
        # Pinocchio has no body for what is fixed to the base, which needs no effort.
        self._first = COUNT * (frame.parentJoint - 1)
        T = frame.placement.homogeneous
        self._to_body = np.array(
            [parameters_of(T @ pseudo_inertia_matrix(unit) @ T.T) for unit in np.eye(COUNT)]).T

    def __call__(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return Y, (m, n, 10), at m samples of shape (m, n)."""
        if self._first < 0:
            return np.zeros((*q.shape, COUNT))
        body = self._regressor(q, v, a)[..., self._first:self._first + COUNT]
        return np.asarray(body @ self._to_body)


def load_parameters(payload: Payload) -> FloatArray:
    """Return the parameters (10,) of a payload, about the origin of its link."""
    inertia = pin.Inertia(payload.mass, payload.com, payload.inertia)
    return np.asarray(inertia.toDynamicParameters())


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
