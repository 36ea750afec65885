# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A step of motion under viscous friction that is too stiff for an explicit method.

Light links with strong damping relax within microseconds; an explicit method would need equally
short steps. With constant A = M⁻¹F_v over the step, v̇ = −A v + g is solved exactly for a g that
is linear in time: the exponential method ETD2RK (S. M. Cox and P. C. Matthews, J. Comput. Phys.
176, 2002, section 2.2), of order 2, extended to the position.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.simulation.runge_kutta import Acceleration


def damping_rate(M: FloatArray, viscous: FloatArray, free: BoolArray) -> float:
    """
    Return a bound [1/s] of the relaxation rates of the joints: the trace of M⁻¹F_v.

    Only the joints that move, `free` (n,), count: stuck joints have no relaxation.
    """
    return float(np.diag(np.linalg.inv(M[np.ix_(free, free)])) @ viscous[free])


class DampedStep(NamedTuple):
    """
    Position and velocity (n,) after a step.

    `correction` (n,) is the difference of the velocity from that of the method of order 1.
    """

    position: FloatArray
    velocity: FloatArray
    correction: FloatArray


def damped_step(
    q: FloatArray, v: FloatArray, h: float, acceleration: Acceleration,
    M: FloatArray, viscous: FloatArray, free: BoolArray,
) -> DampedStep:
    """
    Return the motion after h [s].

    `acceleration(q, v)` includes the viscous friction; `free` (n,) marks the moving joints. The
    velocity of all other joints is and remains 0.
    """
    phi = _Phi(M, viscous, free, h)

    def rest(q: FloatArray, v: FloatArray) -> FloatArray:
        return acceleration(q, v) + phi.A @ v

    g0 = rest(q, v)
    v_a = phi.exp @ v + h * (phi.one @ g0)
    q_a = q + h * (phi.one @ v) + h**2 * (phi.two @ g0)
    change = rest(q_a, v_a) - g0
    correction = h * (phi.two @ change)
    return DampedStep(q_a + h**2 * (phi.three @ change), v_a + correction, correction)


class _Phi:
    """exp(−hA) and φ_k(hA), φ_k(z) = ∫₀¹ e^(−z(1−s)) s^(k−1)/(k−1)! ds, as matrices (n, n)."""

    def __init__(
        self, M: FloatArray, viscous: FloatArray, free: BoolArray, h: float,
    ) -> None:
        n = len(viscous)
        index = np.flatnonzero(free)
        L = np.linalg.cholesky(M[np.ix_(index, index)])
        L_inverse = np.linalg.inv(L)
        # A = M⁻¹F_v is similar to a symmetric matrix: A = L⁻ᵀ (L⁻¹ F_v L⁻ᵀ) Lᵀ.
        rates, Q = np.linalg.eigh(L_inverse @ (viscous[index, None] * L_inverse.T))
        rates = np.maximum(rates, 0.0)
        left, right = L_inverse.T @ Q, Q.T @ L.T

        def function(values: FloatArray) -> FloatArray:
            full = np.zeros((n, n))
            full[np.ix_(index, index)] = (left * values) @ right
            return full

        z = h * rates
        self.A = function(rates)
        self.exp = function(np.exp(-z))
        one, two, three = phi_functions(z)
        self.one, self.two, self.three = function(one), function(two), function(three)


def phi_functions(z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return φ₁, φ₂, φ₃ of z >= 0, accurate to rounding also for small z."""
    series = z < 0.5
    safe = np.where(series, 1.0, z)
    one = -np.expm1(-safe) / safe
    two = (1.0 - one) / safe
    three = (0.5 - two) / safe
    # φ_k(z) = Σ_j (−z)^j / (j + k)!
    small = np.where(series, z, 0.0)
    term3 = np.full_like(z, 1.0 / 6.0)
    sum3 = term3.copy()
    for j in range(1, 14):
        term3 = -term3 * small / (j + 3)
        sum3 = sum3 + term3
    sum2 = 0.5 - small * sum3
    sum1 = 1.0 - small * sum2
    return (np.where(series, sum1, one), np.where(series, sum2, two),
            np.where(series, sum3, three))
