# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The position loop of a drive (MIT mode): τ = k_p (q_d − q) + k_d (q̇_d − q̇) + τ_ff."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import check_order_is_given
from robot_dynamics.validation import check_per_joint, LARGEST_VALUE

DRIVE_PERIOD = 1e-3
"""[s] between two efforts of the drive."""
GAINS = {'drive.stiffness': 'drive.stiffness_limit', 'drive.damping': 'drive.damping_limit'}
"""The gains of the drive, and their limits."""


class DriveLoop(NamedTuple):
    """
    The gains of the drives of n joints, each (n,).

    `stiffness` k_p [N·m/rad] or [N/m], `damping` k_d [N·m·s/rad] or [N·s/m], and the largest
    effort `limit` [N·m] or [N] of a drive.
    """

    stiffness: FloatArray
    damping: FloatArray
    limit: FloatArray

    def effort(self, command: FloatArray, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return the effort (n,) for a command (3, n): position, velocity and effort."""
        position, velocity, effort = command
        wanted = self.stiffness * (position - q) + self.damping * (velocity - v) + effort
        return np.asarray(np.clip(wanted, -self.limit, self.limit))


def drive_loop_from(arm: ArmModel, values: Mapping[str, Any]) -> DriveLoop | None:
    """
    Return the position loops that the parameters `drive.*` describe, None without them.

    Raises InvalidInputError if one gain is given without the other, or exceeds its limit.
    """
    given = {name: values[name] for name in GAINS}
    if not any(given.values()):
        return None
    for name, value in given.items():
        if not value:
            raise InvalidInputError(
                f'{name} is empty, expected one value for all joints or one per joint, because '
                f'{next(other for other in GAINS if other != name)} is given')
        check_order_is_given(values, name, arm)
    names = arm.joint_names
    stiffness, damping = (
        check_per_joint(name, value, names, LARGEST_VALUE) for name, value in given.items())
    for (name, limit_name), gains in zip(GAINS.items(), (stiffness, damping)):
        limit = values[limit_name]
        j = int(np.argmax(gains))
        if 0.0 < limit < gains[j]:
            raise InvalidInputError(
                f'{name} of {names[j]!r} is {gains[j]:g}, expected at most {limit:g} '
                f'({limit_name})')
    effort = arm.given_drive.limit
    largest = values['drive.effort_limit']
    return DriveLoop(
        stiffness, damping, np.minimum(effort, largest) if largest > 0.0 else effort)
