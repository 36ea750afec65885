# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The properties of a joint parameter: name, unit, default, bounds and description."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.validation import check_per_joint, is_empty, LARGEST_VALUE, SMALLEST_DIVISOR


class ParameterField(NamedTuple):
    """
    One parameter of a term of friction, for parameter specs, identification, export and reports.

    `unit` is that of a revolute or prismatic joint, '' for a fraction. `default` is used if the
    parameter is empty; None means the source that `otherwise` describes. `minimum` and `maximum`
    bound a parameter of the nodes. `meaning` is the description, with `{unit}`.

    The effort is proportional to a parameter without `needs`, a magnitude. One with `needs`, such
    as a width, acts only if one of these magnitudes does; `range` is the multiple of a velocity
    beyond which friction no longer changes with the speed. The parameter that a magnitude
    `follows` is its default and its least value, and `within` is its largest size.

    `heading` is the heading of its column in reports, and the name of its columns in regressions;
    '' if identification does not estimate it. `candidates` are the values from which
    identification selects. `counterpart` is the attribute of `<dynamics>` in a URDF to which the
    parameter adds, 'damping' or 'friction', which MJCF has too; `omitted` is the part without a
    counterpart in MJCF.
    """

    name: str
    unit: str
    default: float | None
    minimum: float
    maximum: float
    meaning: str
    heading: str = ''
    needs: tuple[str, ...] = ()
    otherwise: str = ''
    follows: str = ''
    within: str = ''
    range: float = 0.0
    candidates: tuple[float, ...] = ()
    counterpart: str = ''
    omitted: str = ''

    @property
    def description(self) -> str:
        """The description of the parameter of the nodes."""
        return (f'{self.meaning.format(unit=self.unit)}; one value for all joints or one per '
                f'joint. If empty, {self.otherwise or format(self.default, "g")}.')

    @property
    def units(self) -> list[str]:
        """The units of a revolute and of a prismatic joint, such as 'N·m' and 'N', or '1'."""
        return [part.strip('[]').replace(' ', '·') for part in (self.unit or '1').split(' or ')]

    @property
    def is_estimated(self) -> bool:
        """Whether identification estimates this magnitude."""
        return bool(self.heading) and not self.needs

    def check(self, values: Mapping[str, FloatArray], joint_names: Sequence[str]) -> None:
        """Raise InvalidInputError for a value outside its bounds; `values` are all parameters."""
        value, low, high, expected = values[self.name], 0.0, np.inf, 'a number >= 0'
        if self.minimum < 0.0:
            low = -np.inf
        elif self.minimum > 0.0:
            low, expected = SMALLEST_DIVISOR, f'a number > 0, at least {SMALLEST_DIVISOR:g}'
        elif self.maximum < 1.0:
            high, expected = self.maximum, f'a number in [0, {self.maximum:g}]'
        is_valid = (value >= low) & (value <= high)
        if self.follows:
            is_valid &= value >= values[self.follows]
            expected = f'at least friction.{self.follows} of that joint'
        if self.within:
            is_valid &= np.abs(value) <= values[self.within]
            expected = (f'at most friction.{self.within} of that joint in size, or friction would '
                        'create energy')
        if not is_valid.all():
            joint = int(np.argmin(is_valid))
            raise InvalidInputError(
                f'friction.{self.name} of {joint_names[joint]!r} is {value[joint]:g}, expected '
                f'{expected}')


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
