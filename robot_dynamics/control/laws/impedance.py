# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Stiffness and damping ratio of a joint impedance, and their defaults."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.error_feedback import DEFAULT_DAMPING_RATIO, per_joint
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.validation import is_empty

FULL_EFFORT_ERROR = 0.25
"""[rad] or [m] of error at which the default stiffness takes the effort limit of a joint."""
UNLIMITED_STIFFNESS = 100.0
"""Default stiffness [N·m/rad] or [N/m] of a joint without an effort limit."""

LEAST_DAMPING_RATIO = 0.2


class Impedance(NamedTuple):
    """
    Stiffness [N·m/rad] or [N/m], damping ratio and damping [N·m·s/rad] or [N·s/m], each (n,).

    Without a damping, None, it follows from the damping ratio.
    """

    stiffness: FloatArray
    damping_ratio: FloatArray
    damping: FloatArray | None = None


def make_impedance(
    joint_names: Sequence[str], effort_limit: FloatArray, stiffness: npt.ArrayLike = (),
    damping_ratio: npt.ArrayLike = DEFAULT_DAMPING_RATIO, damping: npt.ArrayLike = (),
) -> Impedance:
    """
    Return an impedance; each argument is one number for all joints, or one value per joint.

    By default the stiffness is `effort_limit` (n,) divided by FULL_EFFORT_ERROR, and the damping
    follows from the damping ratio. Raises InvalidInputError for another number of values, for a
    negative value, and for a damping ratio below LEAST_DAMPING_RATIO: late feedback of an error
    that is hardly damped oscillates.
    """
    zeta = per_joint('impedance.damping_ratio', damping_ratio, joint_names)
    for name, value in zip(joint_names, zeta):
        if value < LEAST_DAMPING_RATIO:
            raise InvalidInputError(
                f'impedance.damping_ratio of {name!r} is {value:g}, expected at least '
                f'{LEAST_DAMPING_RATIO:g}')
    default = np.where(
        np.isfinite(effort_limit), effort_limit / FULL_EFFORT_ERROR, UNLIMITED_STIFFNESS)
    return Impedance(
        default if is_empty(stiffness) else per_joint(
            'impedance.stiffness', stiffness, joint_names),
        zeta, None if is_empty(damping) else per_joint(
            'impedance.damping', damping, joint_names))
