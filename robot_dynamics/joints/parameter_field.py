# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What is known of a parameter of a joint: name, unit, default, bounds and description."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from robot_dynamics.arrays import FloatArray
from robot_dynamics.validation import check_per_joint, is_empty, LARGEST_VALUE


class ParameterField(NamedTuple):
    """
    One parameter of a joint, of which parameter specs, file reading and reports are made.

    `unit` is that of a revolute or prismatic joint, '' for a share. `default` holds if the
    parameter is empty; None takes it from elsewhere, as the description says. `minimum` and
    `maximum` bound a parameter of the nodes. `template` is the description, with `{unit}` and
    `{default}`. `heading` is that of its column in reports, which shows the parameter if one of
    the parameters `needs` is not 0.
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
    label: str, value: Any, joint_names: Sequence[str], default: FloatArray,
) -> FloatArray:
    """
    Return a parameter as an array (n,): `value` is empty, one value for all, or one per joint.

    Empty means `default`. Raises InvalidInputError, naming the parameter as `label`, on another
    number of values, or one that is not finite or too large.
    """
    return default if is_empty(value) else (
        check_per_joint(label, value, joint_names, LARGEST_VALUE))
