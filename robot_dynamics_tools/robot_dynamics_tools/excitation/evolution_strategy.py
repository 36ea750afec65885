# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Minimisation by comparing costs: a separable CMA evolution strategy.

Each generation draws candidates around a mean, ranks them by cost, and moves the mean, the step
size and the variance per coordinate towards the better half. Source: R. Ros and N. Hansen, "A
simple modification in CMA-ES achieving linear time and space complexity", PPSN X, 2008, with the
constants of N. Hansen, "The CMA evolution strategy: a tutorial", arXiv:1604.00772, table 1.

Only the rank of a cost matters. Rounding differences between BLAS kernels or processors therefore
do not change the path of the search, unless two costs agree to all digits. A search by numerical
gradients amplifies such differences: the same seed led to different minima. All arithmetic on the
candidates is per element and uses no BLAS kernel. scipy has no CMA evolution strategy.
"""

from collections.abc import Callable
import math

import numpy as np
from robot_dynamics.arrays import FloatArray


class _Constants:
    """Constants of the strategy in d dimensions, with the names of the tutorial."""

    def __init__(self, d: int) -> None:
        self.population = 4 + int(3.0 * math.log(d))
        mu = self.population // 2
        weights = math.log(mu + 0.5) - np.log(np.arange(1.0, mu + 1.0))
        self.weights = weights / weights.sum()
        mu_eff = self.mu_eff = float(1.0 / (self.weights**2).sum())
        self.c_sigma = (mu_eff + 2.0) / (d + mu_eff + 5.0)
        slower = max(0.0, math.sqrt((mu_eff - 1.0) / (d + 1.0)) - 1.0)
        self.d_sigma = 1.0 + 2.0 * slower + self.c_sigma
        self.c_c = (4.0 + mu_eff / d) / (d + 4.0 + 2.0 * mu_eff / d)
        faster = (d + 2.0) / 3.0  # faster learning: d variances instead of d (d + 1) / 2
        self.c_1 = faster * 2.0 / ((d + 1.3)**2 + mu_eff)
        c_mu = faster * 2.0 * (mu_eff - 2.0 + 1.0 / mu_eff) / ((d + 2.0)**2 + mu_eff)
        self.c_mu = min(1.0 - self.c_1, c_mu)
        self.chi = math.sqrt(d) * (1.0 - 1.0 / (4.0 * d) + 1.0 / (21.0 * d * d))


def minimize_by_rank(
    cost: Callable[[FloatArray], float], start: FloatArray, step: float, generations: int,
    random: np.random.Generator, when_done: Callable[[int], None] = lambda _: None,
) -> FloatArray:
    """
    Return the best candidate (d,) of a search around `start` (d,).

    `step` is the standard deviation of the first generation.

    `when_done` is called with the number of completed generations.
    """
    c = _Constants(len(start))
    mean, sigma = start, step
    variance = np.ones_like(start)
    p_sigma, p_c = np.zeros_like(start), np.zeros_like(start)
    best, least = start, cost(start)
    for generation in range(1, generations + 1):
        z = random.normal(size=(c.population, len(start)))
        y = np.sqrt(variance) * z
        candidates = mean + sigma * y
        costs = np.array([cost(x) for x in candidates])
        ranked = np.argsort(costs, kind='stable')[:len(c.weights)]
        if costs[ranked[0]] < least:
            best, least = candidates[ranked[0]], costs[ranked[0]]
        z_mean, y_mean = _weighted(c.weights, z[ranked]), _weighted(c.weights, y[ranked])
        mean = mean + sigma * y_mean
        p_sigma = (1.0 - c.c_sigma) * p_sigma + math.sqrt(
            c.c_sigma * (2.0 - c.c_sigma) * c.mu_eff) * z_mean
        length = math.sqrt((p_sigma**2).sum())
        expected = c.chi * math.sqrt(1.0 - (1.0 - c.c_sigma)**(2 * generation))
        h = float(length < (1.4 + 2.0 / (len(start) + 1.0)) * expected)
        p_c = (1.0 - c.c_c) * p_c + h * math.sqrt(c.c_c * (2.0 - c.c_c) * c.mu_eff) * y_mean
        variance = (
            (1.0 - c.c_1 - c.c_mu + (1.0 - h) * c.c_1 * c.c_c * (2.0 - c.c_c)) * variance
            + c.c_1 * p_c**2 + c.c_mu * _weighted(c.weights, y[ranked]**2))
        sigma *= math.exp(min(1.0, c.c_sigma / c.d_sigma * (length / c.chi - 1.0)))
        when_done(generation)
    return best


def _weighted(weights: FloatArray, rows: FloatArray) -> FloatArray:
    return np.asarray((weights[:, np.newaxis] * rows).sum(axis=0))
