# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Efforts and inertias of an arm over the positions of two of its joints, with the others fixed.

The efforts at all positions of a grid are computed in a few batches of inverse dynamics.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics, RigidBody
from robot_dynamics.model.worst_gravity import BRIEF, search_box, worst_gravity
from robot_dynamics.validation import check_unique, check_vector, is_empty

SAMPLES = 121
"""Number of positions of a joint."""


class PositionGrid(NamedTuple):
    """
    Positions of two joints, by their index: `x` (k,) of the first, `y` (l,) of the second.

    `positions` (l, k, n) are those of all joints, [rad] or [m].
    """

    joints: tuple[int, int]
    x: FloatArray
    y: FloatArray
    positions: FloatArray


def make_grid(
    arm: ArmModel, joints: Sequence[str] = (), position: npt.ArrayLike = (),
    samples: int = SAMPLES,
) -> PositionGrid:
    """
    Return a grid over the ranges of two joints, limited to one turn per joint.

    `joints` names them; empty chooses the two joints with the largest gravity torques. `position`
    (n,) is that of the other joints; empty means 0, or the limit nearest to 0. Raises
    InvalidInputError.
    """
    n = arm.joint_count
    if n < 2:
        raise InvalidInputError(
            f'robot {arm.name!r} has the joint {list(arm.joint_names)}, expected at least two '
            'joints that move')
    first, second = _chosen(arm, joints)
    low, high = search_box(arm)
    home = np.clip(np.zeros(n), low, high) if is_empty(position) else check_vector(
        'position', position, n, arm.joint_names)
    x = np.linspace(low[first], high[first], samples)
    y = np.linspace(low[second], high[second], samples)
    positions = np.tile(home, (samples, samples, 1))
    positions[:, :, first], positions[:, :, second] = x, y[:, None]
    return PositionGrid((first, second), x, y, positions)


def joint_index(arm: ArmModel, field: str, name: str) -> int:
    """Return the index of a joint; raise InvalidInputError, which lists the valid names."""
    if name not in arm.joint_names:
        raise InvalidInputError(
            f'{field} has {name!r}, expected joints out of {list(arm.joint_names)}')
    return arm.joint_names.index(name)


def gravity_efforts(arm: ArmModel, grid: PositionGrid) -> FloatArray:
    """Return g(q) over the grid, (l, k, n) [N·m] or [N]."""
    return rigid_body_efforts(RigidBody(arm), grid, *np.zeros((2, arm.joint_count)))


def motion_efforts(
    arm: ArmModel, grid: PositionGrid, velocity: npt.ArrayLike, acceleration: npt.ArrayLike,
) -> FloatArray:
    """
    Return τ of one velocity and acceleration, (n,) each, over the grid, (l, k, n) [N·m] or [N].

    Friction is part of it. Raises InvalidInputError.
    """
    n, names = arm.joint_count, arm.joint_names
    v = check_vector('velocity', velocity, n, names)
    a = check_vector('acceleration', acceleration, n, names)
    return _inverse_dynamics(ArmDynamics(arm), grid, v, a)


def rigid_body_efforts(
    body: RigidBody, grid: PositionGrid, v: FloatArray, a: FloatArray, gravity: float = 1.0,
) -> FloatArray:
    """Return M(q) a + C(q, v) v, plus a share of g(q), over the grid, (l, k, n) [N·m] or [N]."""
    zero = np.zeros_like(v)
    efforts = _inverse_dynamics(body, grid, v, a)
    return efforts if gravity == 1.0 else efforts - (1.0 - gravity) * _inverse_dynamics(
        body, grid, zero, zero)


def inertia_diagonal(arm: ArmModel, grid: PositionGrid) -> FloatArray:
    """Return M_ii(q) over the grid, (l, k, n) [kg·m²], at prismatic joints [kg]."""
    body, shape = RigidBody(arm), grid.positions.shape
    return np.array([
        body.mass_matrix(q).diagonal() for q in grid.positions.reshape(-1, shape[2])]).reshape(
            shape)


def _chosen(arm: ArmModel, joints: Sequence[str]) -> tuple[int, int]:
    if not joints:
        largest = np.argsort(-worst_gravity(arm, BRIEF).effort, kind='stable')[:2]
        return int(largest.min()), int(largest.max())
    check_unique('joints', joints)
    first, second = (joint_index(arm, 'joints', name) for name in joints)
    return first, second


def _inverse_dynamics(
    dynamics: ArmDynamics, grid: PositionGrid, v: FloatArray, a: FloatArray,
) -> FloatArray:
    shape = grid.positions.shape
    q = grid.positions.reshape(-1, shape[2])
    tau = dynamics.inverse_dynamics_batch(
        q, np.ascontiguousarray(np.broadcast_to(v, q.shape)),
        np.ascontiguousarray(np.broadcast_to(a, q.shape)))
    return np.asarray(tau.reshape(shape))
