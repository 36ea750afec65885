# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The arm that a URDF and the parameters of a node describe, without ROS.

Nodes and tools create their arm from parameters with this module. A parameter file is that of
ROS 2: it contains nodes by name (`dynamics`, or `/**` for all), and for each node
`ros__parameters`, nested like the names of the parameters.
"""

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.actuator import Actuators, make_actuators
from robot_dynamics.joints.effort_calibration import drive_quantities, make_effort_calibration
from robot_dynamics.joints.effort_convention import (
    EffortConvention,
    make_effort_convention,
)
from robot_dynamics.joints.friction import FRICTION_FIELDS, make_friction
from robot_dynamics.joints.parameter_field import per_joint_values
from robot_dynamics.model.arm import arm_from_urdf, ArmModel, STANDARD_GRAVITY
from robot_dynamics.model.effort_deviation import make_uncertainty
from robot_dynamics.urdf.yaml_text import load_yaml
from robot_dynamics.validation import check_vector, covariance_root, LARGEST_VALUE

NODE = 'dynamics'
def read_parameter_file(path: Path, node: str = NODE) -> dict[str, Any]:
    """
    Return the parameters of a node in a file, by their full names.

    Raises InvalidInputError if the file cannot be read or has no parameters for the node,
    MissingDependencyError without PyYAML.
    """
    yaml = optional('yaml', 'a parameter file')
    try:
        document = load_yaml(path.read_text(encoding='utf-8'), 'a parameter file')
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise InvalidInputError(
            f'parameter file {str(path)!r} cannot be read: {error}') from None
    sections = document if isinstance(document, dict) else {}
    values: dict[str, Any] = {}
    for name in ('/**', f'/**/{node}', node, f'/{node}'):
        section = sections.get(name)
        if isinstance(section, dict) and isinstance(section.get('ros__parameters'), dict):
            values |= _flat(section['ros__parameters'])
    if not values:
        raise InvalidInputError(
            f'parameter file {str(path)!r} has no parameters for the node {node!r}, expected '
            f"'{node}:' or '/**:' with ros__parameters; it has {list(sections)}")
    return values


def _flat(values: Mapping[str, Any], prefix: str = '') -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= _flat(value, f'{prefix}{name}.') if isinstance(value, dict) else {
            f'{prefix}{name}': value}
    return flat


def arm_from_parameters(
    urdf: str, values: Mapping[str, Any], joints: Sequence[str] = (),
) -> ArmModel:
    """
    Return the arm of a URDF with joints, gravity, friction, motors and drives of the parameters.

    `values` are parameters of `dynamics_node` by their full names; an omitted parameter has its
    default. `joints` names the actuated joints, in their order; empty means those of the parameter
    `joints`. The arm of only some joints of the parameters has no uncertainty. Raises ModelError,
    or InvalidInputError if the parameters do not match the arm.
    """
    gravity = values.get('gravity', STANDARD_GRAVITY)
    whole = arm_from_urdf(urdf, values.get('joints', ()), gravity)
    names = tuple(joints) or whole.joint_names
    arm = whole if names == whole.joint_names else arm_from_urdf(urdf, names, gravity)
    of_joints = partial(_of_joints, values, whole, names)
    friction, motors = (
        {field.name: of_joints(f'{group}.{field.name}') for field in of_group}
        for group, of_group in (('friction', FRICTION_FIELDS), ('actuator', fields(Actuators))))
    arm = arm.with_friction(make_friction(names, **friction, default=arm.friction))
    limit = per_joint_values(
        'effort.limit', of_joints('effort.limit'), names, arm.limits.effort)
    limit = np.where(limit > 0.0, limit, arm.limits.effort)
    arm = replace(arm, limits=replace(arm.limits, effort=limit))
    covariance = _report_covariance(values, whole, names)
    command, report = (
        make_effort_calibration(
            names, of_joints(f'effort.{direction}_scale'), of_joints(f'effort.{direction}_offset'),
            limit, of_direction, direction)
        for direction, of_direction in (('command', None), ('report', covariance)))
    arm = replace(arm.with_drive(command), report=report)
    if set(names) == set(whole.joint_names):
        arm = replace(arm, uncertainty=make_uncertainty(
            arm, values.get('uncertainty.parameters', ()),
            values.get('uncertainty.covariance', ()), of_joints('uncertainty.noise_deviation'),
            values.get('uncertainty.noise_bandwidth', 0.0),
            of_joints('uncertainty.friction_deviation'),
            of_joints('uncertainty.friction_velocity'),
            of_joints('uncertainty.largest_velocity')))
    reflected = of_joints('actuator.reflected_inertia')
    if not any(len(value) for value in motors.values()):
        return arm.with_reflected_inertia(reflected) if len(reflected) else arm
    if len(motors['torque_constant']) and not len(motors['gear_ratio']):
        motors['gear_ratio'] = _described_gear_ratios(arm)
    return arm.with_actuators(make_actuators(names, **motors, reflected_inertia=reflected))


def _of_joints(
    values: Mapping[str, Any], arm: ArmModel, joints: Sequence[str], name: str,
) -> Sequence[float]:
    """Return the values of an array parameter at `joints`: none, one for all, or one per joint."""
    value = values.get(name, ())
    if not isinstance(value, (list, tuple)):
        raise InvalidInputError(f'{name} is {value!r}, expected an array of numbers')
    check_order_is_given(values, name, arm)
    if len(value) <= 1:
        return value
    given = check_vector(name, value, arm.joint_count, arm.joint_names, LARGEST_VALUE)
    return [float(given[place]) for place in _places(name, arm, joints)]


def _report_covariance(
    values: Mapping[str, Any], arm: ArmModel, joints: Sequence[str],
) -> FloatArray | None:
    """Return the covariance (2m, 2m) of the reports of m `joints`, None if it is not given."""
    name = 'effort.report_covariance'
    value = values.get(name, ())
    if not len(value):
        return None
    check_order_is_given(values, name, arm)
    B = covariance_root(name, value, drive_quantities(arm.joint_names))
    places = np.array(_places(name, arm, joints))
    B = B[np.concatenate([places, arm.joint_count + places])]
    return np.asarray(B @ B.T)


def _places(name: str, arm: ArmModel, joints: Sequence[str]) -> list[int]:
    """Return where `joints` are in a parameter with one value for each joint of `arm`."""
    without = [joint for joint in joints if joint not in arm.joint_names]
    if without:
        raise InvalidInputError(
            f'{name} has no value for {without}, expected them in the parameter joints, which is '
            f'{list(arm.joint_names)}')
    return [arm.joint_names.index(joint) for joint in joints]


def check_order_is_given(values: Mapping[str, Any], name: str, arm: ArmModel) -> None:
    """Raise InvalidInputError if an array has one value per joint, but `joints` is not set."""
    count = len(values.get(name, ()))
    if count > 1 and not values.get('joints') and arm.joint_count > 1:
        raise InvalidInputError(
            f'{name} has {count} values, one per joint, but the parameter joints, '
            'which defines their order, is not set: expected one value, or joints')


def _described_gear_ratios(arm: ArmModel) -> list[float]:
    ratios = arm.gear_ratios
    without = [name for name in arm.joint_names if name not in ratios]
    if without:
        raise InvalidInputError(
            f'actuator.gear_ratio is empty, and no <transmission> of the URDF states a '
            f'mechanicalReduction for {without}, expected one for each of '
            f'{list(arm.joint_names)}, or gear ratios here')
    return [ratios[name] for name in arm.joint_names]


def convention_from_parameters(values: Mapping[str, Any]) -> EffortConvention:
    """Return the effort convention of the parameters; raise InvalidInputError on a wrong one."""
    has_actuators = any(values.get(f'actuator.{field.name}') for field in fields(Actuators))
    return make_effort_convention(
        str(values.get('measured_effort', 'joint_torque')),
        values.get('robot_compensates', ()), has_actuators, values.get('robot_gravity', ()))
