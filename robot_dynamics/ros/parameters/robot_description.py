# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The parameters that describe the robot, and the source of the URDF of a node.

The URDF is in a parameter, in a file or in a package, or it is the URDF of the embedded arm.
"""

from robot_dynamics.exceptions import InvalidInputError, ModelError
from robot_dynamics.joints.effort_calibration import LARGEST_SCALE, LEAST_SCALE
from robot_dynamics.joints.effort_convention import MEASURED_EFFORTS
from robot_dynamics.joints.friction import FRICTION_FIELDS
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.ros.parameters.declared_parameters import (
    number,
    numbers,
    numbers_per_joint,
    ParameterSpec,
    text,
    texts,
    Values,
)
from robot_dynamics.urdf.description_file import read_description_file
from robot_dynamics.validation import LARGEST_VALUE

MOST_JOINTS = 100
"""Joints of an arm; the model check takes 2 s for this number, and minutes for more."""

DESCRIPTION_SPECS = (
    text('robot_description', '', (
        'URDF of the arm as XML text.'), read_only=True),
    text('robot_description_file', '', (
        'URDF file of the arm: a path or package://PACKAGE/PATH. A .xacro file is expanded if '
        'xacro is installed.'), read_only=True),
    texts('joints', (
        'Names of the actuated joints, in the order of all arrays. If empty, all joints that move '
        'and do not mimic others, in the order of the URDF. Moving joints that are not named are '
        'locked.'), read_only=True),
    numbers('gravity', -1000.0, 1000.0, (
        'Gravitational acceleration in the base frame [m/s²]. A change at run time takes effect '
        'gradually in dynamics (20 m/s³), at once in simulated_arm.'),
        default=[0.0, 0.0, -9.81]),
)
MEASURED_EFFORT_SPEC = text('measured_effort', 'joint_torque', (
    'Meaning of the field effort in joint_states: joint_torque, joint_torque_without_gravity, '
    'motor_torque [N·m] or motor_current [A] (the last two require actuator parameters), or '
    'none.'), choices=MEASURED_EFFORTS, read_only=True)
ROBOT_GRAVITY_SPEC = numbers('robot_gravity', -1000.0, 1000.0, (
    'Gravitational acceleration in the base frame [m/s²] that the robot itself assumes, if '
    'robot_compensates contains gravity. If empty, that of the parameter gravity.'),
    read_only=True)

DRIVE_STIFFNESS_SPEC = numbers_per_joint('drive.stiffness', 0.0, 1e8, (
    'Stiffness k_p [N·m/rad] or [N/m] of the position loops of the drives'), (
    '. dynamics computes with it the positions of ~/position_offset. With it simulated_arm takes '
    'the commands of dynamics/feed_forward instead of effort_command, and its drives close their '
    'loops at 1 kHz.'), read_only=True)

FRICTION_SPECS = tuple(
    numbers(f'friction.{field.name}', field.minimum, field.maximum, field.description,
            read_only=True)
    for field in FRICTION_FIELDS)


def _actuator_spec(
    field: str, description: str, without: str, low: float, high: float,
) -> ParameterSpec:
    """`without` describes the meaning of an empty array."""
    return numbers_per_joint(
        f'actuator.{field}', low, high, description, f'. If empty, {without}.', read_only=True)


ACTUATOR_SPECS = (
    _actuator_spec(
        'torque_constant', 'Motor torque constant K_t [N·m/A]',
        'there is no actuator model; setting it together with gear_ratio enables the model',
        0, 1e6),
    _actuator_spec(
        'gear_ratio', 'Gear ratio N, motor revolutions per joint revolution',
        'the mechanicalReduction of the <transmission> in the URDF', -1e6, 1e6),
    _actuator_spec('back_emf_constant', 'Back-EMF constant K_e [V·s/rad]', 'K_t', 0, 1e6),
    _actuator_spec('resistance', 'Winding resistance R [Ohm]', '0', 0, 1e6),
    _actuator_spec(
        'rotor_inertia', 'Rotor inertia J_r [kg·m²] about the motor axis', '0', 0, 1e6),
    _actuator_spec(
        'reflected_inertia', 'Reflected rotor inertia on the joint side, N² J_r [kg·m²] or '
        '[kg]; needs no other actuator parameter and replaces rotor_inertia', 'N² J_r', 0, 1e6),
    _actuator_spec('efficiency', 'Efficiency of the gear, in (0, 1]', '1', 0, 1),
    _actuator_spec('current_limit', 'Largest motor current [A]', 'there is no limit', 0, 1e6),
    _actuator_spec('voltage_limit', 'Largest motor voltage [V]', 'there is no limit', 0, 1e6),
)
SIMULATED_ACTUATOR_SPECS = (
    _actuator_spec('inductance', 'Winding inductance L [H]', '0', 0, 1e6),
    _actuator_spec(
        'current_time_constant', 'Time constant T_c [s] of the current loop', '0.0002', 0, 10),
    _actuator_spec(
        'backlash', 'Backlash of the gear on the joint side [rad] or [m], the whole gap; '
        'requires rotor_inertia or reflected_inertia', '0', 0, 1),
    _actuator_spec(
        'restitution', 'Coefficient of restitution e of the gear teeth at contact, in [0, 1]', '0',
        0, 1),
)
"""Parameters that act in a simulation only."""
UNCERTAINTY_SPECS = (
    texts('uncertainty.parameters', (
        'Names of the model parameters whose covariance is known, such as mz(LINK), '
        'viscous(JOINT). If empty, the effort deviations of the model are unknown. identify '
        'writes these names.'), read_only=True),
    numbers('uncertainty.covariance', -1e12, 1e12, (
        'Covariance of uncertainty.parameters in SI units: the lower triangle of the matrix, row '
        'by row.'), read_only=True),
    numbers_per_joint('uncertainty.noise_deviation', 0.0, 1e9, (
        'Standard deviation [N·m] or [N] of the measured effort about the model, after a filter '
        'that passes uncertainty.noise_bandwidth'), (
        '. If empty, 0.'), read_only=True),
    number('uncertainty.noise_bandwidth', 0.0, 0.0, 1e6, (
        'Bandwidth [Hz] to which uncertainty.noise_deviation refers. In a wider band, the noise '
        'counts as white. It must be above 0 if uncertainty.noise_deviation is set.'),
        read_only=True),
    numbers_per_joint('uncertainty.friction_deviation', 0.0, 1e9, (
        'Standard deviation [N·m] or [N] of friction about the model at rest, which decreases to '
        '0 at uncertainty.friction_velocity'), (
        '. If empty, 0.'), read_only=True),
    numbers('uncertainty.friction_velocity', 0.0, 1e6, (
        'Speed [rad/s] or [m/s] at which uncertainty.friction_deviation has decreased to 0. It is '
        'required if uncertainty.friction_deviation is set.'), read_only=True),
    numbers('uncertainty.largest_velocity', 0.0, 1e6, (
        'Largest speed [rad/s] or [m/s] of the recordings of the identification. The viscous '
        'friction of faster motion is uncertain by half of its increase. If empty, at no speed.'),
        read_only=True),
)

_BOUND = (
    f'; its magnitude is {LEAST_SCALE:g} to {LARGEST_SCALE:g}, and negative for an opposite sign')
DRIVE_SPECS = (
    numbers_per_joint('effort.limit', 0.0, LARGEST_VALUE, (
        'Effort limit [N·m] or [N] of the drives, in place of that of the URDF'), (
        '. If empty, that of the URDF. An arm with a joint that has no limit is not commanded.'),
        read_only=True),
    numbers_per_joint('effort.command_scale', -LARGEST_SCALE, LARGEST_SCALE, (
        'Torque at the joint per unit of commanded effort' + _BOUND), (
        '. If empty, 1. dynamics converts the command with it; simulated_arm has such drives.'),
        read_only=True),
    numbers_per_joint('effort.command_offset', -LARGEST_VALUE, LARGEST_VALUE, (
        'Commanded effort [N·m] or [N] at zero torque at the joint, at most 20 % of the effort '
        'limit of the URDF'), ('. If empty, 0.'), read_only=True),
    numbers_per_joint('effort.report_scale', -LARGEST_SCALE, LARGEST_SCALE, (
        'Torque at the joint per unit of measured effort' + _BOUND), (
        '. If empty, 1. dynamics converts the measured effort with it; simulated_arm reports such '
        'efforts.'), read_only=True),
    numbers_per_joint('effort.report_offset', -LARGEST_VALUE, LARGEST_VALUE, (
        'Measured effort [N·m] or [N] at zero torque at the joint, at most 20 % of the effort '
        'limit of the URDF'), ('. If empty, 0.'), read_only=True),
)
REPORT_COVARIANCE_SPEC = numbers('effort.report_covariance', -1e12, 1e12, (
    'Covariance of effort.report_scale of all joints, then effort.report_offset of all joints: '
    'the lower triangle of the matrix, row by row. calibrate_gravity writes it. The deviations of '
    'estimate_payload contain it. If empty, scale and offset count as exact.'), read_only=True)


def check_joint_count(arm: ArmModel) -> None:
    """Raise ModelError if an arm has too many joints for a node."""
    if arm.joint_count > MOST_JOINTS:
        raise ModelError(
            f'robot_description: robot {arm.name!r} has {arm.joint_count} joints that move, '
            f'expected at most {MOST_JOINTS}, or those to use named in the parameter joints')


def description_from_parameters(values: Values) -> str | None:
    """
    Return the URDF that the parameters define, None if they define none.

    Raises InvalidInputError or ModelError if they define two, or a file that cannot be read.
    """
    xml, file = values['robot_description'], values['robot_description_file']
    if xml and file:
        raise InvalidInputError(
            f'robot_description_file is {file!r} and robot_description is given too, '
            'expected one of them')
    return read_description_file(file, 'robot_description_file') if file else xml or None
