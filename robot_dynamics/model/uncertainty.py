# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The uncertainty of the parameters of an arm; `effort_deviation` has what follows from it."""

from dataclasses import dataclass
import math

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray

VISCOUS_ERROR = 0.5
"""Deviation of F_v beyond the recorded speeds, by F_v: within 2 σ, its slope is 0 to 2 F_v."""


@dataclass(frozen=True, eq=False)
class ModelUncertainty:
    """
    The covariance of k parameters of an arm with n joints, and the noise of its measured effort.

    `columns` (k,) are the places of the parameters in `uncertain_names`; `root` (k, k) is a matrix
    B with the covariance B Bᵀ. `noise_deviation` (n,) [N·m] or [N] is the standard deviation of
    the measured effort about the model, after a filter that passes the band of `noise_bandwidth`
    [Hz]. `friction_deviation` (n,) [N·m] or [N] is that of friction at rest, which decreases to 0
    at `friction_velocity` (n,) [rad/s] or [m/s]. Beyond `largest_velocity` (n,), the fastest of
    the recordings, viscous friction is extrapolated, and uncertain by VISCOUS_ERROR.
    """

    columns: IntArray
    root: FloatArray
    noise_deviation: FloatArray
    noise_bandwidth: float
    friction_deviation: FloatArray
    friction_velocity: FloatArray
    largest_velocity: FloatArray

    @property
    def has_covariance(self) -> bool:
        """Whether any parameter has a covariance."""
        return len(self.columns) > 0

    def friction(self, v: FloatArray, viscous: FloatArray) -> FloatArray:
        """
        Return the standard deviation of friction at velocities (..., n).

        `viscous` (n,) [N·m·s/rad] or [N·s/m] is the viscous friction F_v of the model.
        """
        speed = np.abs(v)
        left = 1.0 - speed / np.where(self.friction_velocity > 0.0, self.friction_velocity, np.inf)
        near_rest = self.friction_deviation * np.maximum(left, 0.0)
        beyond = np.maximum(speed - self.largest_velocity, 0.0)
        return np.asarray(np.hypot(near_rest, VISCOUS_ERROR * viscous * beyond))

    def noise(self, bandwidth: float, dt: float) -> FloatArray:
        """
        Return the standard deviation (n,) of the effort noise behind another filter.

        `bandwidth` [Hz] is the equivalent noise bandwidth of the filter, dt [s] the period of the
        samples. The noise counts as white in a wider band; in a narrower band, it has all its
        power.
        """
        band = min(bandwidth, 0.5 / dt)
        return np.asarray(self.noise_deviation * math.sqrt(max(1.0, band / self.noise_bandwidth)))
