# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A planar chain of n links by the Newton-Euler recursion, with explicit vectors.

The plane is that of `planar`: x to the side, y up, angles from the vertical, each relative to
the link before, positive towards +x. All vectors are (x, y) pairs in the fixed world frame, so
that they can be drawn as they are.

Turning from +y towards +x is positive. The moment of a force f at the lever r is therefore
r_y f_x - r_x f_y, and an angular velocity ω moves the end of a lever r by ω (r_y, -r_x).

The recursion is that of Luh, Walker and Paul, "On-Line Computational Scheme for Mechanical
Manipulators", J. Dyn. Sys., Meas., Control 102 (1980), in the plane and in world coordinates.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.planar.two_link import link_direction, PlanarPositions, PlanarTwoLink
from robot_dynamics.validation import check_scalar, check_vector


@dataclass(frozen=True)
class PlanarChain:
    """
    Parameters of n >= 1 links, first the one at the base.

    Masses [kg], lengths [m] and moments of inertia about the centres of mass (COM) [kg·m²] are
    positive; COM distances [m] are measured from the joint along the link, 0 <= r <= l; gravity
    [m/s²] is >= 0. The values are stored as tuples. Raises InvalidInputError.
    """

    masses: Sequence[float]
    lengths: Sequence[float]
    com_distances: Sequence[float]
    inertias: Sequence[float]
    gravity: float = 9.81

    def __post_init__(self) -> None:
        try:
            count = len(self.masses)
        except TypeError:
            raise InvalidInputError(
                f'masses is {self.masses!r}, expected one number for each link') from None
        if count == 0:
            raise InvalidInputError('masses has 0 values, expected at least 1, one for each link')
        for field in ('masses', 'lengths', 'inertias'):
            self._keep(field, [(0.0, np.inf)] * count, exclusive_minimum=True)
        self._keep('com_distances', [(0.0, length) for length in self.lengths])
        object.__setattr__(self, 'gravity', check_scalar('gravity', self.gravity, 0.0))

    def _keep(
        self, field: str, bounds: list[tuple[float, float]], exclusive_minimum: bool = False,
    ) -> None:
        names = [f'link{i + 1}' for i in range(len(bounds))]
        values = check_vector(field, getattr(self, field), len(bounds), names)
        for i, (value, (low, high)) in enumerate(zip(values, bounds)):
            check_scalar(f'{field}[{i}] ({names[i]})', value, low, high, exclusive_minimum)
        object.__setattr__(self, field, tuple(values.tolist()))

    @classmethod
    def from_two_link(cls, arm: PlanarTwoLink) -> 'PlanarChain':
        """Return the same arm as a chain."""
        return cls(
            (arm.m1, arm.m2), (arm.l1, arm.l2), (arm.r1, arm.r2), (arm.I1, arm.I2), arm.g)

    @property
    def link_count(self) -> int:
        """The number n of links, and of joints."""
        return len(self.masses)


class NewtonEulerPass(NamedTuple):
    """The results of both passes, row i for link i and the joint that carries it."""

    omega: FloatArray
    """Shape (n,): absolute angular velocity of the link [rad/s]."""
    omega_dot: FloatArray
    """Shape (n,): absolute angular acceleration of the link [rad/s²]."""
    joint_position: FloatArray
    """Shape (n, 2): origin of the joint [m]."""
    com_position: FloatArray
    """Shape (n, 2): centre of mass of the link [m]."""
    tip_position: FloatArray
    """Shape (2,): end of the last link [m]."""
    joint_acceleration: FloatArray
    """Shape (n, 2): acceleration of the joint's origin, gravity not included [m/s²]."""
    com_acceleration: FloatArray
    """Shape (n, 2): acceleration of the centre of mass, gravity not included [m/s²]."""
    force: FloatArray
    """Shape (n, 2): force on link i by link i-1 (the base for the first) at joint i [N]."""
    tau: FloatArray
    """Shape (n,): moment on link i by link i-1 about joint i, which the motor delivers [N·m]."""


def newton_euler(
    chain: PlanarChain, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike,
) -> NewtonEulerPass:
    """
    Return the torques of the motion q [rad], v [rad/s], a [rad/s²], with the intermediate results.

    The outward pass, from the base, computes positions and accelerations of the links. The inward
    pass, from the tip, computes the force and the moment that each joint transmits. Raises
    InvalidInputError if q, v or a does not have shape (n,) or is not finite.
    """
    points = forward_kinematics(chain, q)
    omega, omega_dot = np.cumsum(_joints(chain, 'v', v)), np.cumsum(_joints(chain, 'a', a))
    joint_acceleration, com_acceleration = _outward(points, omega, omega_dot)
    force, tau = _inward(chain, points, omega_dot, com_acceleration)
    return NewtonEulerPass(
        omega, omega_dot, points.joints, points.coms, points.tip,
        joint_acceleration, com_acceleration, force, tau)


def _outward(
    points: PlanarPositions, omega: FloatArray, omega_dot: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    ends = _link_ends(points)
    joint_acceleration, com_acceleration = np.zeros_like(ends), np.zeros_like(ends)
    acceleration: FloatArray = np.zeros(2)
    for i, joint in enumerate(points.joints):
        joint_acceleration[i] = acceleration
        com_acceleration[i] = acceleration + _acceleration_about(
            points.coms[i] - joint, omega[i], omega_dot[i])
        # The next joint is at the end of the link: the next link starts from the acceleration of
        # this point, not from that of the COM.
        acceleration = acceleration + _acceleration_about(
            ends[i] - joint, omega[i], omega_dot[i])
    return joint_acceleration, com_acceleration


def _inward(
    chain: PlanarChain,
    points: PlanarPositions,
    omega_dot: FloatArray,
    com_acceleration: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    ends = _link_ends(points)
    up = np.array([0.0, 1.0])
    force, tau = np.zeros_like(ends), np.zeros(chain.link_count)
    next_force, next_tau = np.zeros(2), 0.0
    for i in reversed(range(chain.link_count)):
        # m (acceleration + g up) is the force that both neighbours together exert on the link: it
        # accelerates the link and carries its weight.
        needed = chain.masses[i] * (com_acceleration[i] + chain.gravity * up)
        force[i] = next_force + needed
        tau[i] = (next_tau + chain.inertias[i] * omega_dot[i]
                  + _moment(points.coms[i] - points.joints[i], needed)
                  + _moment(ends[i] - points.joints[i], next_force))
        next_force, next_tau = force[i], tau[i]
    return force, tau


def forward_kinematics(chain: PlanarChain, q: npt.ArrayLike) -> PlanarPositions:
    """Return the positions of joints, centres of mass and tip at q, shape (n,) [rad]."""
    directions = link_direction(np.cumsum(_joints(chain, 'q', q)))
    ends = np.cumsum(np.array(chain.lengths)[:, None] * directions, axis=0)
    joints = np.vstack([np.zeros((1, 2)), ends[:-1]])
    coms = joints + np.array(chain.com_distances)[:, None] * directions
    return PlanarPositions(joints, coms, ends[-1])


def _joints(chain: PlanarChain, field: str, value: Any) -> FloatArray:
    names = [f'joint{i + 1}' for i in range(chain.link_count)]
    return check_vector(field, value, chain.link_count, names)


def _link_ends(points: PlanarPositions) -> FloatArray:
    return np.vstack([points.joints[1:], points.tip])


def _moment(lever: FloatArray, force: FloatArray) -> float:
    return float(lever[1] * force[0] - lever[0] * force[1])


def _acceleration_about(lever: FloatArray, omega: float, omega_dot: float) -> FloatArray:
    """Return the acceleration of the lever's end relative to its start: tangential, inward."""
    return omega_dot * np.array([lever[1], -lever[0]]) - omega**2 * lever
