# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Periodic motions that begin and end at rest: Fourier series with constrained coefficients.

    q(t) = q₀ + Σ_l a_l / (ω l) sin(ω l t) − b_l / (ω l) (cos(ω l t) − 1),   l = 1 … N,  ω = 2π / T

leaves q₀ at t = 0 and returns at T. Velocity and acceleration are zero at both ends if Σ a_l = 0
and Σ l b_l = 0, which leaves 2 N − 2 free coefficients per joint. Position, velocity and
acceleration are band-limited and known without numerical differentiation. Source: J. Swevers,
C. Ganseman, D. Tükel, J. De Schutter, H. Van Brussel, "Optimal robot excitation and
identification", IEEE Trans. Robotics and Automation 13(5), 1997, section III; the constraints at
the ends are added here.
"""

import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.validation import check_scalar

FEWEST_HARMONICS = 2


Basis = tuple[FloatArray, FloatArray, FloatArray]
"""The contributions of the free coefficients to q − q₀, q̇ and q̈, each (m, 2 N − 2)."""


def free_coefficients(harmonics: int) -> int:
    """Return the number of coefficients per joint; raise InvalidInputError if it is below 1."""
    if harmonics < FEWEST_HARMONICS:
        raise InvalidInputError(
            f'harmonics is {harmonics}, expected at least {FEWEST_HARMONICS}: with fewer, a '
            'motion cannot begin and end at rest')
    return 2 * harmonics - 2


def series_basis(harmonics: int, duration: float, times: FloatArray) -> Basis:
    """
    Return the basis of motions of `duration` T [s] with N `harmonics`, at `times` (m,) [s].

    The coefficients are orthonormal directions of (a, b) that satisfy the constraints. Raises
    InvalidInputError.
    """
    count = free_coefficients(harmonics)
    T = check_scalar('duration', duration, 0.0, exclusive_minimum=True)
    order = np.arange(1.0, harmonics + 1.0)
    w = 2.0 * math.pi / T * order
    sine, cosine = np.sin(np.outer(times, w)), np.cos(np.outer(times, w))
    free = np.zeros((2 * harmonics, count))
    free[:harmonics, :harmonics - 1] = _orthogonal_to(np.ones_like(order))
    free[harmonics:, harmonics - 1:] = _orthogonal_to(order)
    return (np.hstack((sine / w, (1.0 - cosine) / w)) @ free, np.hstack((cosine, sine)) @ free,
            np.hstack((-w * sine, w * cosine)) @ free)


def _orthogonal_to(w: FloatArray) -> FloatArray:
    """
    Return an orthonormal basis (N, N − 1) of the complement of w (N,), w₁ > 0.

    It consists of the columns, except the first, of a Householder reflection that maps the first
    axis to −w. This explicit formula is unique; the basis of a singular value decomposition is
    not.
    """
    u = w / np.sqrt((w**2).sum())
    u[0] += 1.0
    return np.asarray((np.eye(len(w)) - np.outer(u, u) / u[0])[:, 1:])
