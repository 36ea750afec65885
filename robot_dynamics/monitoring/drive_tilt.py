# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The cause that the base is tilted: another direction of gravity than that of the model."""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.monitoring.drive_causes import ALL, Cause, DriveModel

TILTED = 'gravity tilted by'
LEAST_TILT, OTHER_SIZE = 15.0, 0.3
"""Least angle [°] of a tilted base that is named, and largest relative error of its gravity."""


def tilted(model: DriveModel, columns: FloatArray, gravity: FloatArray) -> Cause:
    """
    Return the cause that the base is tilted, with its log evidence.

    `columns` (k, n, 3) are torques per γ, `gravity` γ (3,) [m/s²] is that of the model.
    """
    evidence, change = model.common(columns, np.full(3, np.linalg.norm(gravity)))
    true = gravity - change
    size = np.linalg.norm(true) / max(float(np.linalg.norm(gravity)), 1e-9)
    angle = np.degrees(np.arccos(np.clip(
        true @ gravity / max(float(np.linalg.norm(true) * np.linalg.norm(gravity)), 1e-9),
        -1.0, 1.0)))
    is_tilt = angle > LEAST_TILT and abs(size - 1.0) < OTHER_SIZE
    return Cause(TILTED, ALL, evidence if is_tilt else -np.inf, float(angle),
                 gravity=tuple(true.tolist()))
