# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ArmDynamics` and `RigidBody` accept every sequence of numbers, and reject all other inputs."""

from collections.abc import Callable
from dataclasses import fields
from functools import partial
import inspect
from typing import Any

import numpy as np
import pytest
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.control.safety.effort_limiter import EffortLimits
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.actuator import Actuators, make_actuators
from robot_dynamics.joints.effort_calibration import make_effort_calibration
from robot_dynamics.joints.friction import FRICTION_FIELDS, JointFriction, make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics, RigidBody
from robot_dynamics.model.effort_deviation import make_uncertainty
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation

_BARE = load_arm(default_arm_urdf())
ARM = _BARE.with_friction(make_friction(
    _BARE.joint_names, [0.5], [1.0], load_coefficient=[0.1, 0.3], presliding_distance=[0.01]))
STATE = {'q': (1, -2), 'v': (3, 2), 'a': (-4, 5), 'tau': (20, -6), 'load': (7, -8)}
MANY = {'inverse_dynamics_batch', 'gravity_batch', 'friction_along'}
"""Methods whose arrays are (samples, n)."""
WRENCHES = [ExternalWrench('tool0', np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]))]
Inputs = dict[str, tuple[Any, ...]]


def inputs_of(kind: type, method: str) -> Inputs:
    """Return integers for each parameter of a method that is an array over the joints."""
    names = [name for name in inspect.signature(getattr(kind, method)).parameters if name in STATE]
    return {name: (STATE[name], STATE[name][::-1]) if method in MANY else STATE[name]
            for name in names}


def caller(one: Any, method: str) -> Callable[..., Any]:
    """Return the method of an arm's dynamics or bodies, with WRENCHES if it takes wrenches."""
    bound = getattr(one, method)
    has_wrenches = 'wrenches' in inspect.signature(bound).parameters
    return partial(bound, wrenches=WRENCHES) if has_wrenches else bound


METHODS = [
    (kind, name) for kind in (ArmDynamics, RigidBody)
    for name, _ in inspect.getmembers(kind, inspect.isfunction) if not name.startswith('_')]
FIELDS = [(kind, name, field) for kind, name in METHODS for field in inputs_of(kind, name)]


def in_bytes(result: Any) -> bytes:
    parts = result if isinstance(result, tuple) else (result,)
    return b''.join(np.asarray(part, dtype=np.float64).tobytes() for part in parts)


def refusal(kind: type, method: str, field: str, value: Any) -> str:
    with pytest.raises(InvalidInputError) as caught:
        caller(kind(ARM), method)(**{**inputs_of(kind, method), field: value})
    return str(caught.value)


@pytest.mark.parametrize(('kind', 'method'), METHODS)
def test_lists_tuples_and_arrays_give_the_same_bits_as_the_unchecked_method(kind, method):
    call, integers = caller(kind(ARM), method), inputs_of(kind, method)
    arrays = {field: np.array(value, dtype=np.float64) for field, value in integers.items()}
    expected = in_bytes(call(**arrays))
    assert np.isfinite(np.frombuffer(expected)).all()
    assert in_bytes(call(**integers)) == expected
    assert in_bytes(call(**{f: np.array(x) for f, x in integers.items()})) == expected
    assert in_bytes(call(**{f: x.tolist() for f, x in arrays.items()})) == expected
    assert in_bytes(call(**{f: x.astype(np.float32) for f, x in arrays.items()})) == expected
    unchecked = kind(ARM).unchecked
    unchecked = unchecked if hasattr(unchecked, method) else unchecked.rigid_body
    assert in_bytes(caller(unchecked, method)(**arrays)) == expected


def test_each_field_is_a_finite_number_per_joint():
    for kind, method, field in FIELDS:
        value = inputs_of(kind, method)[field]
        many = isinstance(value[0], tuple)
        for bad in ('fast', {'joint1': 1.0}, [[1.0], [2.0, 3.0]]):
            assert refusal(kind, method, field, bad) == f'{field} is {bad!r}, expected numbers'
        if many:
            assert refusal(kind, method, field, [row + (0,) for row in value]) == (
                f"{field} has an array of shape (2, 3), expected samples × 2 joints "
                "(['joint1', 'joint2']), row by row")
            if field != 'q':
                assert refusal(kind, method, field, [[1.0, 2.0]]) == (
                    f'{field} has the shape (1, 2), expected (2, 2) as q has')
        else:
            for length in (0, 1, 3):
                assert refusal(kind, method, field, [0.0] * length) == (
                    f"{field} has {length} values, expected 2, one for each of "
                    "['joint1', 'joint2']")
        for bad in (np.nan, -np.inf, '1.0', None, True, 1j):
            entries = np.array(value, dtype=float if isinstance(bad, float) else object)
            entries[(0, 1) if many else 1] = bad
            for given in (entries, entries.tolist()):
                assert refusal(kind, method, field, given) == (
                    f'{field}{"[0]" * many}[1] (joint2) is {bad!r}, expected a finite number')


def fields_of(value: Any) -> dict[str, Any]:
    own = FRICTION_FIELDS if isinstance(value, JointFriction) else fields(value)
    return {field.name: np.asarray(getattr(value, field.name)).tolist() for field in own}


PER_JOINT: dict[str, Callable[[Any], Any]] = {
    **{f'friction.{field.name}': lambda x, name=field.name: fields_of(  # type: ignore[misc]
        make_friction(_BARE.joint_names, **{'coulomb': float(name == 'offset'), name: x}))
       for field in FRICTION_FIELDS},
    **{f'actuator.{name}': lambda x, name=name: fields_of(  # type: ignore[misc]
        make_actuators(_BARE.joint_names, **{'torque_constant': 0.1, 'gear_ratio': 50.0,
                                             'resistance': 1.0, 'rotor_inertia': 1.0, name: x}))
       for name in (field.name for field in fields(Actuators))},
    'with_reflected_inertia': lambda x: _BARE.with_reflected_inertia(x).reflected_inertia.tolist(),
    'effort.command_offset': lambda x: fields_of(
        make_effort_calibration(_BARE.joint_names, 2.0, x)),
    'uncertainty.noise_deviation': lambda x: fields_of(make_uncertainty(
        _BARE, noise_deviation=x, noise_bandwidth=1.0)),
    **{f'gains.{name}': lambda x, name=name: fields_of(  # type: ignore[misc]
        make_gains(_BARE.joint_names, **{name: x}))
       for name in ('natural_frequency', 'damping_ratio')},
    'following_error': lambda x: ControllerOptions(
        make_gains(_BARE.joint_names), following_error=x).largest_error(
            _BARE.limits.velocity).tolist(),
    'effort_rate': lambda x: EffortLimits(
        *(_BARE.limits.lower, _BARE.limits.upper, _BARE.limits.velocity),
        np.asarray(x) if isinstance(x, list) else x).rate.tolist(),
    'effort_limits': lambda x: fields_of(load_arm(planar_arm_urdf(
        [1.0, 1.0], [1.0, 1.0], [0.5, 0.5], [0.1, 0.1], effort_limits=x)).limits),
}
"""Parameters with one value per joint."""


@pytest.mark.parametrize('parameter', PER_JOINT)
def test_one_number_is_a_parameter_of_all_joints(parameter):
    make = PER_JOINT[parameter]
    expected = make([0.9, 0.9])
    assert expected != make([0.9, 0.8])
    for number in (0.9, np.float64(0.9), np.array(0.9)):
        assert make(number) == expected


def test_a_state_needs_a_value_per_joint_and_a_mass_is_a_number():
    for bad in ('1.0', None, True):
        with pytest.raises(InvalidInputError, match=f'inertia.m is {bad!r}, expected a number in'):
            make_payload('tool0', bad)
        with pytest.raises(InvalidInputError, match='^friction.viscous is .*, expected '):
            make_friction(_BARE.joint_names, bad)
    with pytest.raises(InvalidInputError, match=r'initial_position has an array of shape \(\)'):
        ArmSimulation(_BARE, 0.5)


def test_a_wrench_is_checked_where_it_is_made():
    body, q = RigidBody(ARM), (1, -2)
    assert in_bytes(body.external(q, [ExternalWrench('tool0', (1, 2, 3), [4, 5, 6])])) == (
        in_bytes(body.external(q, WRENCHES)))
    for force, words in (
            ((0, 0, np.nan), r'force\[2\] \(z\) is nan, expected a finite number'),
            ((0, 0), 'force has 2 values, expected 3'), ('up', "force is 'up', expected numbers")):
        with pytest.raises(InvalidInputError, match=words):
            ExternalWrench('tool0', force, (0, 0, 0))
    with pytest.raises(InvalidInputError, match=r'torque\[0\] \(x\) is inf'):
        ExternalWrench('tool0', (0, 0, 0), (np.inf, 0, 0))
