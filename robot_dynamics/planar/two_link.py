# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The planar two-link arm in closed form, by Lagrange.

    M(q) a + C(q, v) v + g(q) = tau

The plane has x to the side and y up. Angles are measured from the vertical: at q = (0, 0) both
links stand upright, a positive angle leans towards +x, and q[1] is relative to link 1. A link at
the absolute angle φ points along (sin φ, cos φ), so a point at distance r on it has the height
r cos φ. In space this is a rotation about +y in the x-z plane, as in `planar_urdf`.

Both joints have friction-free motors, and link i has mass m_i, length l_i, its centre of mass
(COM) on the link at r_i from joint i, and the moment of inertia I_i about that COM.

`docs/planar_arm.md` derives every formula. The same arm is worked out in Siciliano, Sciavicco,
Villani and Oriolo, "Robotics: Modelling, Planning and Control" (2009), section 7.3.2, and in
Spong, Hutchinson and Vidyasagar, "Robot Modeling and Control" (2006), section 7.4; both measure
angles from the horizontal and may number the indices of c_ijk differently.
"""

from dataclasses import dataclass, fields
import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.validation import check_scalar, check_vector

JOINT_NAMES = ('joint1', 'joint2')


@dataclass(frozen=True)
class PlanarTwoLink:
    """
    Parameters of the arm, in SI units: kg, m, kg·m² and m/s².

    Raises InvalidInputError unless masses, lengths and inertias are positive, every COM lies on
    its link (0 <= r <= l), and g >= 0 (0: the plane is horizontal).
    """

    m1: float = 5.0
    m2: float = 3.0
    l1: float = 1.0
    l2: float = 0.8
    r1: float = 0.5
    r2: float = 0.4
    I1: float = 0.1
    I2: float = 0.05
    g: float = 9.81

    def __post_init__(self) -> None:
        for name in ('m1', 'm2', 'l1', 'l2', 'I1', 'I2'):
            check_scalar(name, getattr(self, name), 0.0, exclusive_minimum=True)
        check_scalar('r1', self.r1, 0.0, self.l1)
        check_scalar('r2', self.r2, 0.0, self.l2)
        check_scalar('g', self.g, 0.0)
        for field in fields(self):
            object.__setattr__(self, field.name, float(getattr(self, field.name)))


class PlanarPositions(NamedTuple):
    """Points of an arm of n links in the plane, (x, y) in m from joint 1."""

    joints: FloatArray
    """Shape (n, 2): the origin of each joint."""
    coms: FloatArray
    """Shape (n, 2): the centre of mass of each link."""
    tip: FloatArray
    """Shape (2,): the end of the last link."""


class Energies(NamedTuple):
    """Mechanical energy of an arm [J]; the potential one is 0 at the height of joint 1."""

    kinetic: float
    potential: float

    @property
    def total(self) -> float:
        """Kinetic plus potential energy [J]."""
        return self.kinetic + self.potential


def link_direction(angle: npt.ArrayLike) -> FloatArray:
    """Return the unit vectors (sin φ, cos φ) of links at absolute angles φ; (..., 2)."""
    return np.stack([np.sin(angle), np.cos(angle)], axis=-1)


def forward_kinematics(arm: PlanarTwoLink, q: npt.ArrayLike) -> PlanarPositions:
    """Return the positions of joints, centres of mass and tip at q, shape (2,) [rad]."""
    q1, q2 = _joint_vector('q', q)
    u1, u2 = link_direction([q1, q1 + q2])
    elbow = arm.l1 * u1
    return PlanarPositions(
        joints=np.stack([np.zeros(2), elbow]),
        coms=np.stack([arm.r1 * u1, elbow + arm.r2 * u2]),
        tip=elbow + arm.l2 * u2,
    )


def mass_matrix(arm: PlanarTwoLink, q: npt.ArrayLike) -> FloatArray:
    """
    Return M(q), shape (2, 2) [kg·m²], symmetric and positive definite.

    M_11 is the inertia of everything that joint 1 turns, including I_1 + m_1 r_1² of link 1.
    """
    _, q2 = _joint_vector('q', q)
    cos2 = math.cos(q2)
    M11 = (arm.I1 + arm.m1 * arm.r1**2
           + arm.I2 + arm.m2 * (arm.l1**2 + arm.r2**2 + 2.0 * arm.l1 * arm.r2 * cos2))
    M12 = arm.I2 + arm.m2 * arm.r2 * (arm.r2 + arm.l1 * cos2)
    M22 = arm.I2 + arm.m2 * arm.r2**2
    return np.array([[M11, M12], [M12, M22]])


def christoffel_symbols(arm: PlanarTwoLink, q: npt.ArrayLike) -> FloatArray:
    """
    Return the Christoffel symbols of the first kind c[i, j, k], shape (2, 2, 2) [kg·m²].

    c_ijk = (∂M_ij/∂q_k + ∂M_ik/∂q_j - ∂M_jk/∂q_i) / 2; i is the equation, and j and k can be
    swapped. With h = m_2 l_1 r_2 sin q_2: c_112 = c_121 = c_122 = -h, c_211 = h, the rest 0.
    """
    _, q2 = _joint_vector('q', q)
    h = arm.m2 * arm.l1 * arm.r2 * math.sin(q2)
    c = np.zeros((2, 2, 2))
    c[0, 0, 1] = c[0, 1, 0] = c[0, 1, 1] = -h
    c[1, 0, 0] = h
    return c


def coriolis_matrix(arm: PlanarTwoLink, q: npt.ArrayLike, v: npt.ArrayLike) -> FloatArray:
    """
    Return C(q, v), shape (2, 2) [kg·m²/s], with C_ij = sum over k of c_ijk v_k.

    Many matrices give the same C v; this one makes dM/dt - 2C skew-symmetric.
    """
    return christoffel_symbols(arm, q) @ _joint_vector('v', v)


def coriolis_vector(arm: PlanarTwoLink, q: npt.ArrayLike, v: npt.ArrayLike) -> FloatArray:
    """Return C(q, v) v, the Coriolis and centrifugal torques, shape (2,) [N·m]."""
    return coriolis_matrix(arm, q, v) @ _joint_vector('v', v)


def gravity_vector(arm: PlanarTwoLink, q: npt.ArrayLike) -> FloatArray:
    """
    Return g(q) = ∂P/∂q, shape (2,) [N·m]: the motor torques that hold the arm at q.

    The torques of the weight are -g(q). At q = 0 both are 0, and the arm is in its unstable
    equilibrium.
    """
    q1, q2 = _joint_vector('q', q)
    g2 = -arm.m2 * arm.r2 * arm.g * math.sin(q1 + q2)
    g1 = -(arm.m1 * arm.r1 + arm.m2 * arm.l1) * arm.g * math.sin(q1) + g2
    return np.array([g1, g2])


def nonlinear_terms(arm: PlanarTwoLink, q: npt.ArrayLike, v: npt.ArrayLike) -> FloatArray:
    """Return N(q, v) = C(q, v) v + g(q), shape (2,) [N·m], so that M(q) a + N(q, v) = tau."""
    return coriolis_vector(arm, q, v) + gravity_vector(arm, q)


def inverse_dynamics(
    arm: PlanarTwoLink, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike,
) -> FloatArray:
    """
    Return the joint torques tau, shape (2,) [N·m], of the motion q, v, a.

    q [rad], v [rad/s] and a [rad/s²] have shape (2,). Raises InvalidInputError on another shape
    or a value that is not finite, as every function here does.
    """
    return mass_matrix(arm, q) @ _joint_vector('a', a) + nonlinear_terms(arm, q, v)


def forward_dynamics(
    arm: PlanarTwoLink, q: npt.ArrayLike, v: npt.ArrayLike, tau: npt.ArrayLike,
) -> FloatArray:
    """Return the joint accelerations a, shape (2,) [rad/s²], under the torques tau [N·m]."""
    rest = _joint_vector('tau', tau) - nonlinear_terms(arm, q, v)
    return np.asarray(np.linalg.solve(mass_matrix(arm, q), rest), dtype=np.float64)


def kinetic_energy(arm: PlanarTwoLink, q: npt.ArrayLike, v: npt.ArrayLike) -> float:
    """Return K = v·M(q) v / 2 [J]."""
    velocity = _joint_vector('v', v)
    return float(0.5 * velocity @ mass_matrix(arm, q) @ velocity)


def potential_energy(arm: PlanarTwoLink, q: npt.ArrayLike) -> float:
    """Return P = m_1 g h_1 + m_2 g h_2 [J], with heights counted from joint 1."""
    q1, q2 = _joint_vector('q', q)
    h1 = arm.r1 * math.cos(q1)
    h2 = arm.l1 * math.cos(q1) + arm.r2 * math.cos(q1 + q2)
    return (arm.m1 * h1 + arm.m2 * h2) * arm.g


def energies(arm: PlanarTwoLink, q: npt.ArrayLike, v: npt.ArrayLike) -> Energies:
    """Return kinetic and potential energy [J]; their sum changes at the rate tau·v."""
    return Energies(kinetic_energy(arm, q, v), potential_energy(arm, q))


def _joint_vector(field: str, value: Any) -> FloatArray:
    return check_vector(field, value, 2, JOINT_NAMES)
