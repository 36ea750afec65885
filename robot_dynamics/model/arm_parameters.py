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

"""
The arm of a URDF with what a parameter file of `dynamics_node` says of it, read without ROS.

The file is that of ROS 2: nodes by name (`dynamics`, or `/**` for all), under each
`ros__parameters`, nested as the names of the parameters are.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from robot_dynamics.exceptions import InvalidInputError, MissingDependencyError
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.joints.effort_convention import EffortConvention, make_effort_convention
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.joints.gear_friction import make_gear_friction
from robot_dynamics.model.arm import ArmModel, load_arm, STANDARD_GRAVITY

NODE = 'dynamics'
FRICTION_FIELDS = ('viscous', 'coulomb', 'static', 'stribeck_velocity', 'offset')
GEAR_FRICTION_FIELDS = (
    'sigmoid', 'sigmoid_velocity', 'load', 'effort_offset', 'presliding_distance')
ACTUATOR_FIELDS = (
    'torque_constant', 'gear_ratio', 'back_emf_constant', 'resistance', 'inductance',
    'rotor_inertia', 'efficiency', 'current_limit', 'voltage_limit')


def read_parameter_file(path: Path, node: str = NODE) -> dict[str, Any]:
    """
    Return the parameters of a node in a file, by their full names.

    Raises InvalidInputError where it cannot be read or has nothing for the node,
    MissingDependencyError without PyYAML.
    """
    try:
        import yaml
    except ImportError:
        raise MissingDependencyError(
            'parameter files need the library PyYAML (apt install python3-yaml, or '
            'pip install pyyaml)') from None
    try:
        document = yaml.safe_load(path.read_text(encoding='utf-8'))
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
            f'parameter file {str(path)!r} has nothing for the node {node!r}, expected '
            f"'{node}:' or '/**:' with ros__parameters; it has {list(sections)}")
    return values


def _flat(values: Mapping[str, Any], prefix: str = '') -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= _flat(value, f'{prefix}{name}.') if isinstance(value, dict) else {
            f'{prefix}{name}': value}
    return flat


def described_arm(
    urdf: str, joints: Sequence[str] = (), values: Mapping[str, Any] | None = None,
) -> ArmModel:
    """
    Return the arm of a URDF with these joints, and gravity, friction and motors by parameters.

    Parameters are in the order of their `joints`, of which `joints` may leave some out. Raises
    ModelError, or InvalidInputError where joints or parameters do not fit the arm.
    """
    given = dict(values or {})
    whole = load_arm(urdf, given.get('joints') or (), given.get('gravity') or STANDARD_GRAVITY)
    names = tuple(joints) or whole.joint_names
    arm = whole if names == whole.joint_names else load_arm(
        urdf, names, given.get('gravity') or STANDARD_GRAVITY)

    def of_joints(field: str) -> Any:
        value = given.get(field, ())
        if not isinstance(value, list) or len(value) <= 1:
            return value if isinstance(value, (list, tuple)) else [value]
        if len(value) != whole.joint_count or not given.get('joints'):
            raise InvalidInputError(
                f'{field} has {len(value)} values, expected one, or one for each of the '
                f'parameter joints, which is {given.get("joints") or "not given"}')
        by_name = dict(zip(whole.joint_names, value))
        return [by_name[name] for name in names]

    viscous, coulomb, static, stribeck_velocity, offset = (
        of_joints(f'friction.{field}') for field in FRICTION_FIELDS)
    arm = arm.with_friction(make_friction(
        names, viscous, coulomb, static, stribeck_velocity, offset, arm.friction))
    arm = arm.with_gear_friction(make_gear_friction(
        names, *(of_joints(f'friction.{field}') for field in GEAR_FRICTION_FIELDS)))
    motors = [of_joints(f'actuator.{field}') for field in ACTUATOR_FIELDS]
    if not any(motors):
        return arm
    if motors[0] and not motors[1]:
        motors[1] = [arm.gear_ratios[name] for name in names if name in arm.gear_ratios]
    return arm.with_actuators(make_actuators(names, *motors))


def described_convention(values: Mapping[str, Any], arm: ArmModel) -> EffortConvention:
    """Return what the robot measures and adds; raise InvalidInputError on what does not fit."""
    return make_effort_convention(
        str(values.get('measured_effort', 'joint_torque')),
        values.get('robot_compensates') or (), arm.actuators is not None)
