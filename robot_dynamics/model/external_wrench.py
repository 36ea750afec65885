# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A force and torque that the environment exerts on a link of an arm."""

from collections.abc import Sequence
from dataclasses import dataclass

from robot_dynamics.arrays import FloatArray
from robot_dynamics.validation import check_vector


@dataclass(frozen=True, eq=False)
class ExternalWrench:
    """
    An external wrench on a link, in the frame of that link, at its origin.

    `force` is (3,) [N], `torque` (3,) [N·m]. Raises InvalidInputError for another length or a
    value that is not finite.
    """

    link: str
    force: FloatArray
    torque: FloatArray

    def __post_init__(self) -> None:
        for field in ('force', 'torque'):
            value = check_vector(field, getattr(self, field), 3, ('x', 'y', 'z'))
            object.__setattr__(self, field, value)


Wrenches = Sequence[ExternalWrench]
"""Wrenches on links, any number of them on the same link."""
