# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Invalid parameter values while the node commands: rejected, without any change."""

from collections.abc import Sequence
import math
from typing import Any

from fault_table import fault, fault_cases
import pytest
from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.parameter import Parameter
from request_bench import ControlContinues
from robot_dynamics.ros.dynamics.parameters import SPECS
from robot_dynamics.ros.parameters.declared_parameters import ParameterSpec, Type

GROUP = 'Parameters at run time'
REFUSED = 'rejected with name, value and expectation; the old value stays; control continues'
NAN, INF = float('nan'), float('inf')
CHANGEABLE = [spec for spec in SPECS if not spec.read_only]
NUMBERS = [spec for spec in CHANGEABLE if spec.kind in (Type.DOUBLE, Type.DOUBLE_ARRAY)]
ARRAYS = [spec for spec in NUMBERS if spec.kind is Type.DOUBLE_ARRAY and spec.name != 'gravity']
"""Parameters with one value per joint."""
CHOICES = [spec for spec in CHANGEABLE if spec.choices]


def number(spec: ParameterSpec, value: float) -> Parameter:
    """Return a number for a parameter, as an array if the parameter is one."""
    return Parameter(spec.name, spec.kind, [value] if spec.kind is Type.DOUBLE_ARRAY else value)


def of_another_type(spec: ParameterSpec) -> Parameter:
    """Return a value of a wrong type for a parameter."""
    if spec.kind is Type.STRING:
        return Parameter(spec.name, Type.DOUBLE, 1.0)
    return Parameter(spec.name, Type.STRING, 'text')


BAD_VALUES = {
    'NaN and infinity, for every number and array parameter': [
        number(spec, value) for spec in NUMBERS for value in (NAN, INF)],
    'a value below or above the range, for every number and array parameter': [
        number(spec, value) for spec in NUMBERS for value in (
            math.nextafter(float(spec.minimum or 0.0), -INF),
            math.nextafter(float(spec.maximum or 0.0), INF))],
    'a wrong type, for every parameter; an integer, for every floating-point parameter': [
        *map(of_another_type, CHANGEABLE),
        *(Parameter(spec.name, Type.INTEGER, 1) for spec in NUMBERS if spec.kind is Type.DOUBLE)],
    'three values for two joints; two values without an order of the joints': [
        *(Parameter(spec.name, Type.DOUBLE_ARRAY, [1.0] * 3) for spec in ARRAYS
          if not spec.name.startswith('cartesian.')),  # one per axis
        *(Parameter(spec.name, Type.DOUBLE_ARRAY, [1.0] * 2) for spec in ARRAYS)],
    'an unknown choice': [Parameter(spec.name, Type.STRING, 'fly') for spec in CHOICES],
    'unsetting a parameter': [Parameter(spec.name, Type.NOT_SET) for spec in CHANGEABLE],
    'setting a read-only parameter': [
        Parameter(spec.name, spec.kind, spec.default) for spec in SPECS if spec.read_only],
}


def values_of(control: ControlContinues, names: Sequence[str]) -> Any:
    """Return the values of parameters."""
    return control.ask('get_parameters', GetParameters, names=names).values


def check_unchanged(control: ControlContinues, before: Any) -> None:
    """Check that no parameter has changed."""
    assert values_of(control, [spec.name for spec in SPECS]) == before


@pytest.fixture
def before(control: ControlContinues) -> Any:
    """Return the values of all parameters before the test."""
    return values_of(control, [spec.name for spec in SPECS])


@fault_cases('parameters', GROUP, '{}', REFUSED, BAD_VALUES.items())
def test_bad_values(control, parameters, before):
    assert parameters
    with control.checked():
        results = control.ask('set_parameters', SetParameters, parameters=[
            parameter.to_parameter_msg() for parameter in parameters]).results
    for parameter, result in zip(parameters, results, strict=True):
        assert not result.successful, parameter
        assert parameter.name in result.reason
        assert len(result.reason) > len(parameter.name) + 10
    check_unchanged(control, before)


@fault(GROUP, 'unknown parameter names, one empty, one of a million characters',
       'rejected with the name, which is shortened if it is long; requests for them have empty '
       'answers; control continues')
def test_unknown_names(control, before):
    names = ['efort_scale', '', 'gains', 'gains.', 'x' * 1_000_000]
    with control.checked():
        results = control.ask('set_parameters', SetParameters, parameters=[
            Parameter(name, Type.DOUBLE, 1.0).to_parameter_msg() for name in names]).results
    for name, result in zip(names, results, strict=True):
        assert not result.successful
        assert result.reason.startswith(f"there is no parameter '{name[:100]}")
        assert len(result.reason) < 5000
    with control.checked():
        for name in names[::4]:
            for service, kind, field in (
                    ('get_parameters', GetParameters, 'values'),
                    ('get_parameter_types', GetParameterTypes, 'types'),
                    ('describe_parameters', DescribeParameters, 'descriptors')):
                assert len(getattr(control.ask(service, kind, names=[name]), field)) == 0
            listed = control.ask('list_parameters', ListParameters, prefixes=[name])
            assert listed.result.names == []
    check_unchanged(control, before)


GOOD = Parameter('effort_limit_fraction', Type.DOUBLE, 0.5).to_parameter_msg()


@fault(GROUP, 'a type 77, or an invalid value, among valid values in `~/set_parameters` and '
       '`~/set_parameters_atomically`',
       'rejected with name, type and the valid types, or the reason; no value of the request is '
       'set; control continues')
def test_all_or_none(control, before):
    unknown = ParameterMsg(name='hold_time', value=ParameterValue(type=77))
    bad = Parameter('gains.damping_ratio', Type.DOUBLE_ARRAY, [NAN]).to_parameter_msg()
    with control.checked():
        results = control.ask(
            'set_parameters', SetParameters, parameters=[GOOD, unknown, GOOD]).results
        assert len(results) == 3
        results += [control.ask('set_parameters_atomically', SetParametersAtomically,
                                parameters=parameters).result
                    for parameters in ([GOOD, unknown, GOOD], [GOOD, bad])]
    *of_type, of_value = results
    for result in of_type:
        assert not result.successful
        assert "parameter 'hold_time' has the type 77, expected one of [0, 1, 2" in result.reason
    assert not of_value.successful
    assert 'gains.damping_ratio[0] is nan' in of_value.reason
    check_unchanged(control, before)


@fault(GROUP, '`use_sim_time` set to true and back, while /clock has no publisher; then with a '
       'wrong type, or unset',
       'control continues, because no watchdog uses /clock; wrong types are rejected')
def test_use_sim_time(control):
    node = control.bench.name('').rstrip('/')
    for value in (True, False):
        with control.checked():
            control.bench.client.set_parameters(node, {'use_sim_time': value})
    with control.checked():
        for value in (
                Parameter('use_sim_time', Type.INTEGER, 1),
                Parameter('use_sim_time', Type.STRING, 'true'),
                Parameter('use_sim_time', Type.NOT_SET)):
            reason = control.bench.client.rejection(node, 'use_sim_time', value)
            assert 'use_sim_time' in reason
    assert control.bench.client.get_parameter(node, 'use_sim_time') is False
