# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The properties of a joint parameter: name, unit, default, bounds and description."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.validation import check_per_joint, is_empty, LARGEST_VALUE


class ParameterField(NamedTuple):
    """
    One parameter of a joint, which parameter specs, file reading and reports use.

    `unit` is that of a revolute or prismatic joint, '' for a fraction. `default` is used if the
    parameter is empty; None means that the description names another source. `minimum` and
    `maximum` bound a parameter of the nodes. `template` is the description, with `{unit}` and
    `{default}`. `heading` is the heading of its column in reports, which show the parameter if one
    of the parameters `needs` is not 0.
    """

    name: str
    unit: str
    default: float | None
    minimum: float
    maximum: float
    template: str
    heading: str = ''
    needs: tuple[str, ...] = ()

    @property
    def description(self) -> str:
        return self.template.format(unit=self.unit, default=self.default)


def per_joint_values(
    label: str, value: npt.ArrayLike, joint_names: Sequence[str], default: FloatArray,
) -> FloatArray:
    """
    Return a parameter as an array (n,): `value` is empty, one number for all, or one per joint.

    Empty means `default`. Raises InvalidInputError, naming the parameter as `label`, for another
    number of values, or for a value that is not finite or too large.
    """
    return default if is_empty(value) else (
        check_per_joint(label, value, joint_names, LARGEST_VALUE))
