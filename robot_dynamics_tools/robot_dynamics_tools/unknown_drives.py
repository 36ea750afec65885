# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The uncertainty of effort scales and offsets of drives that were not calibrated."""

import numpy as np
from robot_dynamics.arrays import FloatArray

SCALE_DEVIATION = 0.3
"""Relative standard deviation of the effort scale of a drive."""
GIVEN_DEVIATION = 0.1
"""That of a scale that was given without a covariance, such as a data sheet's torque constant."""
OFFSET_DEVIATION = 0.05
"""Standard deviation of the effort offset of a drive, relative to the effort limit."""


def unknown_drives(
    scale: FloatArray, limit: FloatArray, deviation: float = SCALE_DEVIATION,
) -> FloatArray:
    """
    Return the covariance (2n, 2n) of scales, then offsets, about assumed scales (n,).

    `limit` (n,) are the effort limits [N·m] or [N]. `deviation` is that of the scales, relative
    to them; that of the offsets changes in proportion.
    """
    offset = OFFSET_DEVIATION * deviation / SCALE_DEVIATION * limit
    return np.diag(np.concatenate([deviation * scale, offset])**2)
