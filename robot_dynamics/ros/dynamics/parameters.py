# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of `dynamics`, and the options of the control law from them."""

import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.computed_torque import FRICTION_MODES
from robot_dynamics.control.control_law import (
    DEFAULT_DAMPING_RATIO,
    DEFAULT_NATURAL_FREQUENCY,
    make_gains,
    per_joint,
)
from robot_dynamics.control.controller import command_modes
from robot_dynamics.control.effort_limiter import EffortLimits
from robot_dynamics.control.options import (
    ControllerOptions,
    default_effort_rates,
    DEFAULT_STATE_MAX_AGE,
    POSITION_MARGIN,
)
from robot_dynamics.control.supervisor import FAULT_ACTIONS, SafetyOptions
from robot_dynamics.joints.effort_convention import MEASURED_EFFORTS, ROBOT_COMPENSATIONS
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import check_order_is_given, convention_from_parameters
from robot_dynamics.model_check.finding import CHECKS
from robot_dynamics.ros.dynamics.base_gravity import GRAVITY_SPECS
from robot_dynamics.ros.dynamics.live_estimates import ESTIMATE_SPECS
from robot_dynamics.ros.parameters.declared_parameters import ParameterSpec, Type, Values
from robot_dynamics.ros.parameters.payloads import PAYLOAD_SPEC
from robot_dynamics.ros.parameters.robot_description import (
    ACTUATOR_SPECS,
    DESCRIPTION_SPECS,
    DRIVE_SPECS,
    FRICTION_SPECS,
    ROBOT_GRAVITY_SPEC,
    UNCERTAINTY_SPECS,
)

INFEASIBLE_TRAJECTORY = ('reject', 'slow_down', 'clip')

SAFETY_SPECS = (
    ParameterSpec(
        'fault_action', Type.STRING, FAULT_ACTIONS[0],
        'Reaction of effort_command to a fault: hold_gravity_then_ramp compensates gravity '
        'for hold_time and then ramps to zero, ramp_to_zero ramps at once, stop_publishing '
        'publishes no further command.', choices=FAULT_ACTIONS),
    ParameterSpec(
        'hold_time', Type.DOUBLE, 1.0,
        'Time [s] for which hold_gravity_then_ramp compensates gravity before the ramp.',
        minimum=0.0, maximum=3600.0),
    ParameterSpec(
        'ramp_time', Type.DOUBLE, 0.5,
        'Duration [s] of the ramp of the efforts to zero after a fault and, once the arm has '
        'stopped, at deactivation and at shutdown. The ramp takes longer if effort_rate_limit '
        'requires it.',
        minimum=0.0, maximum=60.0),
    ParameterSpec(
        'state_timeout', Type.DOUBLE, 0.05,
        'Longest time [s] without a valid joint state, measured on the steady clock. A longer '
        'gap is a fault.',
        minimum=0.001, maximum=60.0),
    ParameterSpec(
        'state_max_age', Type.DOUBLE, DEFAULT_STATE_MAX_AGE,
        'Largest difference [s] between the stamp of a joint state and the clock of this '
        'computer; 0 accepts any stamp. If the first stamp is more than an hour off, the '
        'stamps come from another clock; the limit then applies to the change of its offset. '
        'Stamps before 2001 are simulated time, which may run slowly.',
        minimum=0.0, maximum=60.0),
    ParameterSpec(
        'reference_timeout', Type.DOUBLE, 0.1,
        'Longest pause [s] of a stream of moving set-points. After a longer pause the arm stops '
        'and holds its position.',
        minimum=0.001, maximum=60.0),
    ParameterSpec(
        'condition_references', Type.BOOL, True,
        'Limit every reference to velocities, accelerations and jerks that the arm can '
        'follow. If false, a step of the reference causes a step of the effort.'),
    ParameterSpec(
        'infeasible_trajectory', Type.STRING, INFEASIBLE_TRAJECTORY[0],
        'Reaction to a trajectory that exceeds a limit of the arm: reject rejects it, '
        'slow_down lowers its velocities, clip also clips its positions to the position '
        'limits. Paths without velocities are always slowed down as needed.',
        choices=INFEASIBLE_TRAJECTORY),
    ParameterSpec(
        'following_error_limit', Type.DOUBLE_ARRAY, [],
        'Distance [rad] or [m] between position and reference above which a fault occurs; one '
        'value for all joints or one per joint, 0 for no limit. If empty, the limit is the '
        'distance at the velocity limit in 0.3 s.',
        minimum=0.0, maximum=1e9),
    ParameterSpec(
        'overspeed_factor', Type.DOUBLE, 1.2,
        'Multiple of a URDF velocity limit above which a fault occurs; 0 disables this check.',
        minimum=0.0, maximum=1e9),
    ParameterSpec(
        'external_effort_limit', Type.DOUBLE_ARRAY, [],
        'Estimated external effort [N m] or [N] above which a fault occurs; one value for all '
        'joints or one per joint. 0 or an empty array disables this check. The estimate is '
        'published on ~/external_effort.', minimum=0.0, maximum=1e9),
    ParameterSpec(
        'effort_rate_limit', Type.DOUBLE, 0.0,
        'Largest rate of change [N m/s] or [N/s] of effort_command for every joint; 0 for the '
        'effort limit of each joint per 0.1 s.', minimum=0.0, maximum=1e9),
    ParameterSpec(
        'position_margin', Type.DOUBLE, POSITION_MARGIN,
        'Distance [rad] or [m] before a position limit from which no effort may accelerate '
        'the joint toward the limit.',
        minimum=0.0, maximum=10.0),
    ParameterSpec(
        'position_fault_margin', Type.DOUBLE, 0.0087,
        'Distance [rad] or [m] beyond a position limit at which a fault occurs.',
        minimum=0.0, maximum=1e9),
)

SPECS = (
    *DESCRIPTION_SPECS,
    *FRICTION_SPECS,
    *ACTUATOR_SPECS,
    *DRIVE_SPECS,
    *UNCERTAINTY_SPECS,
    ParameterSpec(
        'ignore_checks', Type.STRING_ARRAY, [],
        'Names of model checks whose errors are logged as warnings instead of rejecting the '
        'model.',
        read_only=True, choices=tuple(CHECKS)),
    PAYLOAD_SPEC,
    ParameterSpec(
        'command', Type.STRING, 'computed_torque',
        'Control law whose efforts effort_command contains; none publishes no command. '
        'computed_torque stops the arm from the first joint state and holds it; '
        'gravity_compensation does not hold it. Other packages may add laws.',
        choices=command_modes()),
    ParameterSpec(
        'gains.natural_frequency', Type.DOUBLE_ARRAY, [DEFAULT_NATURAL_FREQUENCY],
        'Natural frequency [rad/s] of the tracking error; one value for all joints or one per '
        'joint. K_p is its square.', minimum=0.0, maximum=1e4),
    ParameterSpec(
        'gains.damping_ratio', Type.DOUBLE_ARRAY, [DEFAULT_DAMPING_RATIO],
        'Damping ratio of the tracking error; one value for all joints or one per joint. K_d '
        'is 2 times this ratio times the natural frequency.', minimum=0.0, maximum=1e4),
    ParameterSpec(
        'gains.kp', Type.DOUBLE_ARRAY, [],
        'Proportional gain K_p [1/s^2], which replaces gains.natural_frequency; one value for '
        'all joints or one per joint.', minimum=0.0, maximum=1e8),
    ParameterSpec(
        'gains.kd', Type.DOUBLE_ARRAY, [],
        'Derivative gain K_d [1/s], which replaces gains.damping_ratio; one value for all '
        'joints or one per joint.', minimum=0.0, maximum=1e8),
    ParameterSpec(
        'soften_gains', Type.BOOL, True,
        'Scale the gains down to the values that rate and noise of the joint states allow. If '
        'false, the arm can oscillate.'),
    ParameterSpec(
        'friction_compensation', Type.STRING, 'reference',
        'Velocity at which computed torque compensates friction: reference uses the velocity '
        'of the reference, corrected by the tracking error (robust); measured uses the '
        'measured velocity (exact linearisation, for stiff gears without delay); none '
        'disables the compensation.', choices=FRICTION_MODES),
    ParameterSpec(
        'effort_scale', Type.DOUBLE, 1.0,
        'Fraction of the URDF effort limits to which effort_command is clamped.',
        minimum=0.0, maximum=1.0),
    ParameterSpec(
        'measured_effort', Type.STRING, 'joint_torque',
        'Meaning of the field effort in joint_states: joint_torque, '
        'joint_torque_without_gravity, motor_torque [N m] or motor_current [A] (the last two '
        'require actuator parameters), or none.',
        read_only=True, choices=MEASURED_EFFORTS),
    ParameterSpec(
        'robot_compensates', Type.STRING_ARRAY, [],
        'Terms that the robot adds automatically to the commanded effort, and that '
        'effort_command therefore omits: gravity, friction.',
        read_only=True, choices=ROBOT_COMPENSATIONS),
    ROBOT_GRAVITY_SPEC,
    *GRAVITY_SPECS,
    ParameterSpec(
        'require_measured_velocities', Type.BOOL, False,
        'Follow references only if the joint states contain velocities. By default, '
        'velocities that are missing or NaN are estimated from the positions with a delay of '
        '5 ms or half a period of the states, and the gains are lowered accordingly.'),
    ParameterSpec(
        'joint_sample_max_age', Type.DOUBLE, 0.0,
        'Largest difference [s] between the stamps of the samples of one state, if the joints '
        'of the arm are spread over several messages; 0 for half a period of these messages.',
        minimum=0.0, maximum=10.0),
    ParameterSpec(
        'effort_check', Type.BOOL, True,
        'Compare measured effort, command and g(q) once while the arm holds still, and log a '
        'warning if gravity is compensated twice or not as declared.', read_only=True),
    *ESTIMATE_SPECS,
    *SAFETY_SPECS,
    ParameterSpec(
        'autostart', Type.BOOL, True,
        'Configure and activate the node at start. If false, the node waits for '
        '~/change_state.',
        read_only=True),
    ParameterSpec(
        'state_thread', Type.BOOL, True,
        'Receive joint states in a separate thread, with little delay, instead of in the '
        'executor.',
        read_only=True),
)
GAINS = ('gains.natural_frequency', 'gains.damping_ratio', 'gains.kp', 'gains.kd')


def options_from(values: Values, arm: ArmModel) -> ControllerOptions:
    """Return checked options; raise InvalidInputError if they do not match the arm."""
    for name in (*GAINS, 'following_error_limit', 'external_effort_limit'):
        check_order_is_given(values, name, arm)
    optional_limits('external_effort_limit', values, arm)
    gains = make_gains(arm.joint_names, *(values[name] for name in GAINS))
    return ControllerOptions(
        gains, values['command'], values['effort_scale'], values['friction_compensation'],
        torque_rates(values, arm), convention_from_parameters(values), values['soften_gains'],
        values['condition_references'], values['infeasible_trajectory'] != 'reject', True,
        optional_limits('following_error_limit', values, arm), values['reference_timeout'],
        not values['require_measured_velocities'], checks_goals=True,
        clips_positions=values['infeasible_trajectory'] == 'clip')


def optional_limits(name: str, values: Values, arm: ArmModel) -> FloatArray | None:
    """Return a limit per joint (n,), None if the parameter is empty."""
    return per_joint(name, values[name], arm.joint_names) if values[name] else None


def effort_rates(values: Values, arm: ArmModel) -> FloatArray:
    """Return the largest rates of change of the command, (n,) [N·m/s] or [N/s]."""
    rate = values['effort_rate_limit']
    return np.full(arm.joint_count, rate) if rate > 0.0 else default_effort_rates(arm)


def torque_rates(values: Values, arm: ArmModel) -> FloatArray:
    """Return the rates (n,) [N·m/s] or [N/s] of the torque at the largest rates of the command."""
    rates = effort_rates(values, arm)
    return rates if arm.drive is None else arm.drive.scale * rates


def guard_limits(values: Values, arm: ArmModel) -> EffortLimits:
    """Return the effort limits of this arm."""
    limits = arm.limits
    return EffortLimits(
        limits.lower, limits.upper, limits.velocity, values['position_margin'],
        effort_rates(values, arm), arm.given_drive.limit)


def safety_options(values: Values) -> SafetyOptions:
    """Return the options of the supervisor."""
    return SafetyOptions(
        values['state_timeout'], values['fault_action'], values['hold_time'],
        values['ramp_time'], values['position_fault_margin'],
        values['overspeed_factor'] or math.inf)
