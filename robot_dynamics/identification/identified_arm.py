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
The identified model as parameters of the node.

`dynamics_node` with the URDF of `fitted_urdf` and the parameters of `parameter_values`
computes what the fit predicts: rigid bodies, reflected inertia, friction of joints and gears.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from robot_dynamics.identification.friction_regressor import joint_estimate, JointEstimate
from robot_dynamics.identification.regularized_fit import Fit
from robot_dynamics.joints.friction import FRICTION_FIELDS
from robot_dynamics.model.arm import ArmModel

_DIGITS = 9


def joint_estimates(arm: ArmModel, fit: Fit) -> tuple[JointEstimate, ...]:
    """Return friction and rotor of each joint."""
    return tuple(
        joint_estimate(structure, kind, values[structure.columns])
        for structure, kind, values in zip(fit.structures, arm.joint_kinds, fit.joint_values))


def parameter_values(
    arm: ArmModel, fit: Fit, drive_gain: Sequence[float] | None = None,
    given: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """
    Return the parameters of `dynamics_node`, by name, that belong to the identified URDF.

    `drive_gain` (n,) [N·m/A] or [N/A], where effort is current: the joint effort a unit of it.
    `given` are parameters that were there before: those that identification does not find stay.
    """
    joints = joint_estimates(arm, fit)

    def rounded(found: Sequence[float]) -> list[float]:
        return [float(f'{value:.{_DIGITS}g}') for value in found]

    kept = {name: value for name, value in (given or {}).items()
            if not name.startswith('friction.') and not name.startswith('robot_description')}
    values: dict[str, Any] = {
        'joints': list(arm.joint_names),
        'gravity': [float(x) for x in arm.pinocchio_model.gravity.linear],
        **{f'friction.{field.name}': rounded([joint.friction[field.name] for joint in joints])
           for field in FRICTION_FIELDS
           if field.name in joints[0].friction},
    }
    rotors = rounded([joint.reflected_inertia for joint in joints])
    if arm.actuators is not None and drive_gain is None:
        values['actuator.rotor_inertia'] = [
            float(f'{inertia / ratio**2:.{_DIGITS}g}')
            for inertia, ratio in zip(rotors, arm.actuators.gear_ratio)]
    elif any(rotors) or drive_gain is not None:
        # Motor quantities on the joint side, N = 1: only N K_t and N² J_r were identified.
        values['actuator.gear_ratio'] = [1.0]
        values['actuator.torque_constant'] = [1.0] if drive_gain is None else [
            float(f'{gain:.{_DIGITS}g}') for gain in drive_gain]
        values['actuator.rotor_inertia'] = rotors
    if drive_gain is not None:
        values['measured_effort'] = 'motor_current'
    return dict(sorted({**kept, **values}.items(), key=lambda item: _order(item[0])))


def _order(name: str) -> tuple[bool, str, bool]:
    """Sort the plain parameters before the groups, `joints` first."""
    prefix, separator, _ = name.rpartition('.')
    return (bool(separator), prefix, name != 'joints')


def parameter_file(values: Mapping[str, Any], comments: Sequence[str] = ()) -> str:
    """Return a parameter file of ROS 2 for `dynamics` and `simulated_arm`, comments first."""
    lines = [*(f'# {comment}'.rstrip() for comment in comments), '/**:',
             '  ros__parameters:']
    group = ''
    for name, value in values.items():
        prefix, _, field = name.rpartition('.')
        if prefix and prefix != group:
            lines.append(f'    {prefix}:')
        group = prefix
        indent = '      ' if prefix else '    '
        lines.append(f'{indent}{field}: {_as_yaml(value)}')
    return '\n'.join(lines) + '\n'


def _as_yaml(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return f'[{", ".join(_as_yaml(item) for item in value)}]'
    if isinstance(value, float):
        text = f'{value:.{_DIGITS}g}'
        # YAML 1.1 takes 1e-05 for a word
        mantissa, exponent, power = text.partition('e')
        return f'{mantissa if "." in mantissa else mantissa + ".0"}{exponent}{power}'
    return str(value)
