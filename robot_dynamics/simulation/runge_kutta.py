# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A step of the fifth-order Runge–Kutta method of Dormand and Prince, for q̈ = a(q, q̇).

Source: E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*, Springer
1993, table II.5.2.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray

Acceleration = Callable[[FloatArray, FloatArray], FloatArray]

# Weights of the previous stages in each stage, and in the last row of all stages in the result.
_TABLEAU = tuple(np.array(row) for row in (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
))
WEIGHTS = _TABLEAU[-1]
# Weights of the embedded fourth-order method for the stages and the final slope, minus WEIGHTS.
_ERROR_WEIGHTS = WEIGHTS - np.array((
    5179 / 57600, 0.0, 7571 / 16695, 393 / 640, -92097 / 339200, 187 / 2100))
_ERROR_WEIGHT_OF_END = -1 / 40


class RungeKuttaStep(NamedTuple):
    """Position and velocity (n,) after a step; velocities, accelerations (6, n) of its stages."""

    position: FloatArray
    velocity: FloatArray
    velocities: FloatArray
    accelerations: FloatArray

    def error(self, h: float, acceleration: Acceleration, weights: FloatArray) -> float:
        """Return the largest estimated error, times its weight, of the velocity after h [s]."""
        end = acceleration(self.position, self.velocity)
        error = _ERROR_WEIGHTS @ self.accelerations + _ERROR_WEIGHT_OF_END * end
        return h * float(np.abs(weights * error).max())

    def positions(self, q: FloatArray, h: float) -> FloatArray:
        """Return the positions (6, n) of the stages of this step of h [s] from q (n,)."""
        stages = np.zeros((6, 6))
        for i, row in enumerate(_tableau(h)[:-1], start=1):
            stages[i, :i] = row
        return np.asarray(q + stages @ self.velocities)


def runge_kutta_step(
    q: FloatArray, v: FloatArray, h: float, acceleration: Acceleration,
    a: FloatArray | None = None,
) -> RungeKuttaStep:
    """
    Return position and velocity (n,) after h [s], with an error of order h⁶.

    `a` (n,) is the acceleration at (q, v), if it is already known.
    """
    n = len(q)
    start = np.concatenate((q, v))
    slopes = np.empty((6, 2 * n))  # of position and velocity
    now = start
    for i, row in enumerate(_tableau(h)):
        slopes[i, :n] = now[n:]
        slopes[i, n:] = acceleration(now[:n], now[n:]) if i or a is None else a
        now = start + row.dot(slopes[:i + 1])
    return RungeKuttaStep(now[:n], now[n:], slopes[:, :n], slopes[:, n:])


@lru_cache(maxsize=8)
def _tableau(h: float) -> list[FloatArray]:
    return [h * row for row in _TABLEAU]
