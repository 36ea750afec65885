# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The properties of a joint parameter: name, unit, default, bounds and description."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from robot_dynamics.arrays import FloatArray
from robot_dynamics.validation import check_per_joint, is_empty, LARGEST_VALUE


class ParameterField(NamedTuple):
    """
    One parameter of a term of friction, for parameter specs, identification, export and reports.

    `unit` is that of a revolute or prismatic joint, '' for a fraction. `default` is used if the
    parameter is empty; None means the source that `otherwise` describes. `minimum` and `maximum`
    bound a parameter of the nodes. `meaning` is the description, with `{unit}`. `follows` names
    the parameter whose value is the default. A parameter with `needs`, such as a width, acts only
    if one of these parameters is not 0; the others are magnitudes, to which the effort is
    proportional.

    `heading` is the heading of its column in reports, and the name of its columns in regressions;
    '' if identification does not estimate it. `candidates` are the values of a width from which
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
        """The units of a revolute and of a prismatic joint, such as 'N·m' and 'N'."""
        unit = self.unit or '1 or 1'
        return [part.strip('[]').replace(' ', '·') for part in unit.split(' or ')]

    @property
    def is_estimated(self) -> bool:
        """Whether identification estimates this magnitude."""
        return bool(self.heading) and not self.needs


def per_joint_values(
    label: str, value: Any, joint_names: Sequence[str], default: FloatArray,
) -> FloatArray:
    """
    Return a parameter as an array (n,): `value` is empty, one value for all, or one per joint.

    Empty means `default`. Raises InvalidInputError, naming the parameter as `label`, for another
    number of values, or for a value that is not finite or too large.
    """
    return default if is_empty(value) else (
        check_per_joint(label, value, joint_names, LARGEST_VALUE))
