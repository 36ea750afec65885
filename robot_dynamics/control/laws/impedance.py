# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Stiffness and damping ratio of a joint impedance, and their defaults."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.error_feedback import DEFAULT_DAMPING_RATIO, per_joint
from robot_dynamics.validation import is_empty

FULL_EFFORT_ERROR = 0.25
"""[rad] or [m] of error at which the default stiffness takes the effort limit of a joint."""
UNLIMITED_STIFFNESS = 100.0
"""Default stiffness [N·m/rad] or [N/m] of a joint without an effort limit."""


class Impedance(NamedTuple):
    """Stiffness [N·m/rad] or [N/m], and damping ratio, each (n,)."""

    stiffness: FloatArray
    damping_ratio: FloatArray


def make_impedance(
    joint_names: Sequence[str], effort_limit: FloatArray, stiffness: npt.ArrayLike = (),
    damping_ratio: npt.ArrayLike = DEFAULT_DAMPING_RATIO,
) -> Impedance:
    """
    Return an impedance; each argument is one number for all joints, or one value per joint.

    By default the stiffness is `effort_limit` (n,) divided by FULL_EFFORT_ERROR. Raises
    InvalidInputError for another number of values, and for a negative value.
    """
    default = np.where(
        np.isfinite(effort_limit), effort_limit / FULL_EFFORT_ERROR, UNLIMITED_STIFFNESS)
    return Impedance(
        default if is_empty(stiffness) else per_joint(
            'impedance.stiffness', stiffness, joint_names),
        per_joint('impedance.damping_ratio', damping_ratio, joint_names))
