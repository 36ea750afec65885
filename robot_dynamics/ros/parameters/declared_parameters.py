# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Declared parameters: name, type, default, range, description, and whether they may change.

A node lists its `ParameterSpec`s. `DeclaredParameters` declares them, rejects invalid values
with a reason, at start and at run time, and passes accepted changes to the node.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
import math
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.ros.middleware.rclpy_internals import (
    parameter_overrides,
)
from robot_dynamics.validation import check_choice, check_scalar

Type = Parameter.Type
Values = Mapping[str, Any]

NODES = ('robot_dynamics.ros.dynamics.parameters', 'robot_dynamics.ros.simulated_arm.node')
"""Modules whose SPECS are those of the nodes, which may share a parameter file."""
OF_TOOLS = {
    'mjcf', 'mjcf_joints', 'dynamics', 'residual_bandwidth', 'effort.report_covariance',
    'external_wrench.frame', 'external_wrench.largest_force', 'external_wrench.largest_torque'}
"""Parameters of `mujoco_arm` and `dynamics_monitor`, which may share the file too."""


@dataclass(frozen=True)
class ParameterSpec:
    """
    One parameter; the default of an array may be empty.

    `minimum` and `maximum` apply to a number, or to each number of an array; `choices` applies
    to a text, or to each text of an array.
    """

    name: str
    kind: Any
    default: Any
    description: str
    read_only: bool = False
    minimum: float = -math.inf
    maximum: float = math.inf
    choices: tuple[str, ...] = ()

    def descriptor(self) -> ParameterDescriptor:
        """Return the descriptor that `ros2 param describe` prints."""
        descriptor = ParameterDescriptor(
            name=self.name, type=self.kind.value, description=self.description,
            read_only=self.read_only)
        if self.choices:
            descriptor.additional_constraints = (
                f'{"each " if self.kind is Type.STRING_ARRAY else ""}one of {list(self.choices)}')
        if self.kind is Type.DOUBLE:
            descriptor.floating_point_range = [FloatingPointRange(
                from_value=float(self.minimum), to_value=float(self.maximum))]
        elif self.kind is Type.INTEGER:
            descriptor.integer_range = [IntegerRange(
                from_value=int(self.minimum), to_value=int(self.maximum), step=1)]
        elif self.kind is Type.DOUBLE_ARRAY:  # rclpy checks ranges of scalars only
            descriptor.additional_constraints = f'each in [{self.minimum:g}, {self.maximum:g}]'
        return descriptor

    def check(self, value: Any) -> None:
        """Raise InvalidInputError, which names this parameter, for an invalid value."""
        is_array = self.kind in (Type.STRING_ARRAY, Type.DOUBLE_ARRAY)
        for i, entry in enumerate(value if is_array else [value]):
            name = f'{self.name}[{i}]' if is_array else self.name
            if self.choices:
                check_choice(name, entry, self.choices)
            elif isinstance(entry, float):  # rclpy accepts what is close to a bound
                check_scalar(name, entry, self.minimum, self.maximum)


def number(
    name: str, default: float, minimum: float, maximum: float, description: str,
    read_only: bool = False,
) -> ParameterSpec:
    """Return the specification of a number; a whole number if the default is one."""
    kind = Type.INTEGER if isinstance(default, int) else Type.DOUBLE
    return ParameterSpec(name, kind, default, description, read_only, minimum, maximum)


def numbers(
    name: str, minimum: float, maximum: float, description: str,
    default: Sequence[float] = (), read_only: bool = False,
) -> ParameterSpec:
    """Return the specification of an array of numbers."""
    return ParameterSpec(
        name, Type.DOUBLE_ARRAY, list(default), description, read_only, minimum, maximum)


def numbers_per_joint(
    name: str, minimum: float, maximum: float, description: str, rest: str = '.',
    default: Sequence[float] = (), read_only: bool = False,
) -> ParameterSpec:
    """Return the same for an array that has one value for all joints or one per joint."""
    return numbers(
        name, minimum, maximum,
        f'{description}; one value for all joints or one per joint{rest}', default, read_only)


def flag(name: str, default: bool, description: str, read_only: bool = False) -> ParameterSpec:
    """Return the specification of a parameter that is true or false."""
    return ParameterSpec(name, Type.BOOL, default, description, read_only)


def text(
    name: str, default: str, description: str, choices: tuple[str, ...] = (),
    read_only: bool = False,
) -> ParameterSpec:
    """Return the specification of a text, which is one of the choices if there are any."""
    return ParameterSpec(name, Type.STRING, default, description, read_only, choices=choices)


def texts(
    name: str, description: str, choices: tuple[str, ...] = (), read_only: bool = False,
) -> ParameterSpec:
    """Return the specification of an array of texts, which is empty by default."""
    return ParameterSpec(name, Type.STRING_ARRAY, [], description, read_only, choices=choices)


class DeclaredParameters:
    """The parameters of one node."""

    def __init__(
        self, node: Node, specs: Sequence[ParameterSpec],
        check: Callable[[Values], object], apply: Callable[[Values], None],
    ) -> None:
        """
        Declare all parameters; `values` are then the values of the command line and the files.

        `check` checks all values together and raises RobotDynamicsError if they are
        inconsistent; `apply` applies an accepted change. Raises InvalidInputError on an invalid
        start value or an unknown name.
        """
        self._node = node
        self._specs = {spec.name: spec for spec in specs}
        self._check, self._apply = check, apply
        self.values: dict[str, Any] = {spec.name: self._declare(spec) for spec in specs}
        """All values by name; arrays as tuples."""
        self._check_names()
        self._check(self.values)
        node.add_on_set_parameters_callback(self._judge)
        node.add_post_set_parameters_callback(self._take_over)

    def _declare(self, spec: ParameterSpec) -> Any:
        descriptor, empty = spec.descriptor(), spec.default == []
        try:
            if empty:  # rclpy infers a list of bytes from an empty list, unless it is set later
                descriptor.read_only = False
            parameter = self._node.declare_parameter(
                spec.name, spec.kind if empty else spec.default, descriptor)
        except ParameterException as error:
            raise InvalidInputError(
                f'parameter {spec.name}: {error} '
                f'(expected {_type_in_words(spec)}: {spec.description})') from None
        if empty:
            if parameter.type_ is Type.NOT_SET:
                parameter = Parameter(spec.name, spec.kind, [])
                self._node.set_parameters([parameter])
            self._node.set_descriptor(spec.name, spec.descriptor())
        return _checked(spec, parameter)

    def _check_names(self) -> None:
        """Raise InvalidInputError for a name that no node has."""
        node = self._node
        unknown = [name for name in parameter_overrides(node) if not node.has_parameter(name)]
        others = [import_module(module).SPECS for module in NODES] if unknown else []
        of_others = OF_TOOLS.union(spec.name for specs in others for spec in specs)
        for name in unknown:
            if name not in of_others:
                close = get_close_matches(name, self._specs, n=1)
                raise InvalidInputError(
                    f'unknown parameter {name!r}'
                    f'{f", probably {close[0]!r}" if close else ""}; expected parameters of '
                    f'{node.get_name()}, and those of other nodes in a section with their name')

    def _judge(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            self._check(self._changed(parameters))
        except RobotDynamicsError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _take_over(self, parameters: list[Parameter]) -> None:
        values = self._changed(parameters)
        self._apply(values)
        self.values = values

    def _changed(self, parameters: list[Parameter]) -> dict[str, Any]:
        values = dict(self.values)
        for parameter in parameters:
            spec = self._specs.get(parameter.name)
            if spec is not None:  # else a parameter of rclpy, such as use_sim_time
                values[spec.name] = _checked(spec, parameter)
        return values


def _checked(spec: ParameterSpec, parameter: Parameter) -> Any:
    if parameter.type_ is Type.NOT_SET:
        raise InvalidInputError(f'{parameter.name} cannot be unset')
    given = parameter.value
    value = given if isinstance(given, (bool, int, float, str)) else tuple(given)
    spec.check(value)
    return value


def _type_in_words(spec: ParameterSpec) -> str:
    words = {
        Type.DOUBLE: 'a number with a decimal point, such as 1.0',
        Type.DOUBLE_ARRAY: 'numbers with a decimal point, such as [1.0, 2.0]',
        Type.STRING_ARRAY: 'names, such as [joint1, joint2]',
        Type.BOOL: 'true or false',
        Type.INTEGER: 'a whole number',
        Type.STRING: 'text',
    }
    return words[spec.kind]
