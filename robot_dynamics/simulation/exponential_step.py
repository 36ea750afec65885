# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A step of motion with damping or springs that are too stiff for an explicit method.

Light links with strong damping relax within microseconds; an explicit method would need equally
short steps. With constant M, damping D and stiffness K over the step,
M q̈ + D q̇ + K (q − q₀) = M g is solved exactly for a g that is linear in time: the exponential
method ETD2RK (S. M. Cox and P. C. Matthews, J. Comput. Phys. 176, 2002, section 2.2), of order 2.
Its φ functions are blocks of the exponential of one larger matrix (R. B. Sidje, ACM Trans.
Mathematical Software 24(1), 1998, theorem 1).
"""

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.simulation.runge_kutta import Acceleration

_PADE_DEGREE = 6


def exponential_step(
    q: FloatArray, v: FloatArray, h: float, acceleration: Acceleration,
    M: FloatArray, damping: FloatArray, stiffness: FloatArray, free: BoolArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """
    Return position and velocity after h [s], and the correction of the velocity, (n,) each.

    The correction is the difference of the velocity from that of the method of order 1.

    `acceleration(q, v)` includes damping and springs, both (n,), 0 without any; `free` (n,) marks
    the moving joints. The velocity of all other joints is and remains 0.
    """
    index = np.flatnonzero(free)
    n = len(index)
    # In p = Lᵀ (q − q₀), M = L Lᵀ, damping and stiffness are symmetric.
    L = np.linalg.cholesky(M[index[:, None], index])
    L_inverse = np.linalg.inv(L)
    K = L_inverse @ (stiffness[index, None] * L_inverse.T)
    D = L_inverse @ (damping[index, None] * L_inverse.T)
    rate = float(np.sqrt(np.trace(K))) or 1.0
    unit = np.eye(n)
    generator = np.zeros((4 * n, 4 * n))  # of (rate p, ṗ), of g and of its rate
    generator[:n, n:2 * n] = rate * unit
    generator[n:2 * n, :n], generator[n:2 * n, n:2 * n] = -K / rate, -D
    generator[n:2 * n, 2 * n:3 * n] = generator[2 * n:3 * n, 3 * n:] = unit
    blocks = matrix_exponential(h * generator)[:2 * n]

    def motion(y: FloatArray) -> tuple[FloatArray, FloatArray]:
        after_q, after_v = q.copy(), np.zeros_like(v)
        after_q[index] += L_inverse.T @ y[:n] / rate
        after_v[index] = L_inverse.T @ y[n:]
        return after_q, after_v

    def rest(y: FloatArray, q: FloatArray, v: FloatArray) -> FloatArray:
        return L.T @ acceleration(q, v)[index] + K @ y[:n] / rate + D @ y[n:]

    y = np.concatenate((np.zeros(n), L.T @ v[index]))
    g = rest(y, q, v)
    first = blocks[:, :2 * n] @ y + blocks[:, 2 * n:3 * n] @ g
    change = blocks[:, 3 * n:] @ (rest(first, *motion(first)) - g) / h
    return *motion(first + change), motion(change)[1]


def matrix_exponential(A: FloatArray) -> FloatArray:
    """
    Return exp(A) by scaling and squaring of a Padé approximant.

    Source: G. H. Golub and C. F. Van Loan, *Matrix Computations*, Johns Hopkins 1996, algorithm
    11.3.1.
    """
    halvings = max(0, int(np.ceil(np.log2(max(float(np.abs(A).sum(axis=0).max()), 1e-300)))) + 1)
    A = A / 2.0**halvings
    power = np.eye(len(A))
    above, below, c = power.copy(), power.copy(), 1.0
    for k in range(1, _PADE_DEGREE + 1):
        c *= (_PADE_DEGREE - k + 1) / (k * (2 * _PADE_DEGREE - k + 1))
        power = A @ power
        above += c * power
        below += (-c if k % 2 else c) * power
    result = np.linalg.solve(below, above)
    for _ in range(halvings):
        result = result @ result
    return np.asarray(result, dtype=np.float64)
