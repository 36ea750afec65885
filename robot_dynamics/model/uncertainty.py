# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The uncertainty of the parameters of an arm; `effort_deviation` has what follows from it."""

from dataclasses import dataclass
import math

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray

REVERSAL = 0.25
"""Half of the time that a zero-phase filter needs for a step, by the period of its bandwidth."""


@dataclass(frozen=True, eq=False)
class ModelUncertainty:
    """
    The covariance of k parameters of an arm with n joints, and the noise of its measured effort.

    `columns` (k,) are the places of the parameters in `uncertain_names`; `root` (k, k) is a matrix
    B with the covariance B Bᵀ. `noise_deviation` (n,) [N·m] or [N] is the standard deviation of
    the measured effort about the model, after a filter that passes the band of `noise_bandwidth`
    [Hz]. `friction_deviation` (n,) [N·m] or [N] is that of friction at rest, which decreases
    around `friction_velocity` (n,) [rad/s] or [m/s]; see `speed_from_rest`.
    """

    columns: IntArray
    root: FloatArray
    noise_deviation: FloatArray
    noise_bandwidth: float
    friction_deviation: FloatArray
    friction_velocity: FloatArray

    @property
    def has_covariance(self) -> bool:
        """Whether any parameter has a covariance."""
        return len(self.columns) > 0

    def friction(self, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return the standard deviation (n,) of friction at a velocity and acceleration (n,)."""
        speed = speed_from_rest(v, a, self.noise_bandwidth)
        return np.asarray(self.friction_deviation * friction_share(speed / self.friction_velocity))

    def noise(self, bandwidth: float, dt: float) -> FloatArray:
        """
        Return the standard deviation (n,) of the effort noise behind another filter.

        `bandwidth` [Hz] is the equivalent noise bandwidth of the filter, dt [s] the period of the
        samples. The noise counts as white in a wider band; in a narrower band, it has all its
        power.
        """
        band = min(bandwidth, 0.5 / dt)
        return np.asarray(self.noise_deviation * math.sqrt(max(1.0, band / self.noise_bandwidth)))


def speed_from_rest(v: FloatArray, a: FloatArray, bandwidth: float) -> FloatArray:
    """
    Return the speed |v| beyond that which a joint gains while a filter passes a reversal.

    A filter of this `bandwidth` [Hz] smooths the step of dry friction where v changes its sign:
    within REVERSAL / bandwidth seconds of it, at the acceleration a, a joint counts as at rest.
    """
    return np.maximum(np.abs(v) - REVERSAL * np.abs(a) / bandwidth, 0.0)


def friction_share(ratio: FloatArray) -> FloatArray:
    """Return the deviation of friction at a velocity, by that at rest."""
    return np.asarray(1.0 / (1.0 + ratio**2))
