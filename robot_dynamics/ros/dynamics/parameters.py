# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of `dynamics`, and the options of the control law from them."""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.computed_torque import FRICTION_MODES
from robot_dynamics.control.laws.control_law import LawParameter
from robot_dynamics.control.laws.error_feedback import (
    DEFAULT_DAMPING_RATIO,
    DEFAULT_NATURAL_FREQUENCY,
    LEAST_DAMPING,
    make_gains,
    per_joint,
)
from robot_dynamics.control.laws.law_table import all_laws, command_modes, declared, NO_COMMAND
from robot_dynamics.control.options import (
    ControllerOptions,
    default_effort_rates,
    DEFAULT_STATE_MAX_AGE,
)
from robot_dynamics.control.safety.effort_limiter import EffortLimits
from robot_dynamics.control.safety.fault_action import END_ACTIONS, FAULT_ACTIONS, SafetyOptions
from robot_dynamics.control.trajectory_goal import (
    default_tolerances,
    Tolerances,
)
from robot_dynamics.joints.effort_convention import ROBOT_COMPENSATIONS
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import check_order_is_given, convention_from_parameters
from robot_dynamics.ros.dynamics.base_gravity import IMU_SPEC
from robot_dynamics.ros.dynamics.command_status import command_obstacle
from robot_dynamics.ros.dynamics.external_effort_fault import (
    contact_levels,
    CONTACT_SPECS,
    OBSERVER_SPECS,
)
from robot_dynamics.ros.parameters import robot_description
from robot_dynamics.ros.parameters.declared_parameters import (
    flag,
    number,
    numbers,
    numbers_per_joint,
    ParameterSpec,
    text,
    texts,
    Values,
)
from robot_dynamics.ros.parameters.payloads import PAYLOAD_SPECS

GOAL_SPEC = numbers_per_joint('goal.tolerance', 0.0, 1e9, (
    'Distance [rad] or [m] at which a goal of ~/follow_joint_trajectory that gives no tolerance '
    'is reached'), (
    ', 0 for any distance. If empty, 0.01.'))
LOCK_STEP_TIMEOUT = 60.0
"""[s] that a simulation in lock-step may compute: its arm does not move before the next effort."""
INFEASIBLE_TRAJECTORY = ('reject', 'slow_down', 'clip')

SAFETY_SPECS = (
    text('fault_action', FAULT_ACTIONS[0], (
        'Reaction of effort_command to a fault: hold_gravity_then_ramp compensates gravity for '
        'hold_time and then ramps to zero, ramp_to_zero ramps at once, stop_publishing publishes '
        'no further command.'), choices=FAULT_ACTIONS),
    text('end_action', END_ACTIONS[0], (
        'What follows when the command ends in order (deactivation, command: none, a signal) and '
        'the arm has stopped: hold_then_silence publishes no command after the one that holds the '
        'arm, so that brakes or the watchdog of the drive act as after a crash; ramp_to_zero is '
        'for receivers that keep the last command, such as effort_controllers of ros2_control.'),
        choices=END_ACTIONS),
    number('hold_time', 1.0, 0.0, 3600.0, (
        'Time [s] for which hold_gravity_then_ramp compensates gravity before the ramp.')),
    number('ramp_time', 0.5, 0.0, 60.0, (
        'Duration [s] of the ramp of the efforts to zero after a fault, and of that of '
        'end_action. The ramp takes longer if effort_rate_limit requires it.')),
    number('state_timeout', 0.05, 0.001, 60.0, (
        'Longest time [s] without a valid joint state, measured on the steady clock. A longer gap '
        'is a fault.')),
    flag('lock_step', False, (
        'The joint states come from a simulation that waits for the command of each state, such '
        'as simulated_arm with lock_step: state_timeout is 60 s. Never with a robot.')),
    number('state_max_age', DEFAULT_STATE_MAX_AGE, 0.0, 60.0, (
        'Largest difference [s] between the stamp of a joint state and the clock of this '
        'computer; 0 accepts any stamp. If the first stamp is more than an hour off, the stamps '
        'come from another clock; the limit then applies to the change of its offset. Stamps '
        'before 2001 are simulated time, which may run slowly.')),
    number('reference_timeout', 0.1, 0.001, 60.0, (
        'Longest pause [s] of a stream of moving set-points. After a longer pause the arm stops '
        'and holds its position.')),
    text('infeasible_trajectory', INFEASIBLE_TRAJECTORY[0], (
        'Reaction to a trajectory that exceeds a limit of the arm: reject rejects it, slow_down '
        'lowers its velocities, clip also clips its positions to the position limits. Paths '
        'without velocities are always slowed down as needed.'), choices=INFEASIBLE_TRAJECTORY),
    numbers_per_joint('following_error_limit', 0.0, 1e9, (
        'Distance [rad] or [m] between position and reference above which a fault occurs'), (
        ', 0 for no limit. If empty, the limit is the distance at the velocity limit in 0.3 s.')),
    *OBSERVER_SPECS,
    *CONTACT_SPECS,
    number('effort_rate_limit', 0.0, 0.0, 1e9, (
        'Largest rate of change [N·m/s] or [N/s] of effort_command for every joint; 0 for the '
        'effort limit of each joint per 0.1 s.')),
)


def _law_spec(one: LawParameter) -> ParameterSpec:
    """Return the specification of a parameter that a law declares."""
    if isinstance(one.default, str):
        return text(one.name, one.default, one.description)
    if isinstance(one.default, tuple):
        return numbers(one.name, one.minimum, one.maximum, one.description, one.default)
    return number(one.name, float(one.default), one.minimum, one.maximum, one.description)


SPECS = (
    *robot_description.DESCRIPTION_SPECS,
    *robot_description.FRICTION_SPECS,
    *robot_description.ACTUATOR_SPECS,
    *robot_description.DRIVE_SPECS,
    robot_description.DRIVE_STIFFNESS_SPEC,
    *robot_description.UNCERTAINTY_SPECS,
    *PAYLOAD_SPECS,
    text('command', 'computed_torque', (
        'Control law whose efforts effort_command contains; none publishes no command. '
        'computed_torque and the impedances stop the arm from the first joint state and hold it; '
        'gravity_compensation does not hold it, hand_guiding lets it be moved by hand. Other '
        'packages may add laws.'),
        choices=command_modes()),
    numbers_per_joint('gains.natural_frequency', 0.0, 1e4, (
        'Natural frequency [rad/s] of the tracking error'), (
        '. K_p is its square.'), default=[DEFAULT_NATURAL_FREQUENCY]),
    numbers_per_joint('gains.damping_ratio', LEAST_DAMPING, 1e4, (
        'Damping ratio of the tracking error'), (
        '. K_d is 2 times this ratio times the natural frequency.'),
        default=[DEFAULT_DAMPING_RATIO]),
    *(_law_spec(one) for one in declared('PARAMETERS')),
    text('friction_compensation', 'reference', (
        'Velocity at which computed torque compensates friction: reference uses the velocity of '
        'the reference, corrected by the tracking error (robust); measured uses the measured '
        'velocity (exact linearisation, for stiff gears without delay); none disables the '
        'compensation.'), choices=FRICTION_MODES),
    number('effort_limit_fraction', 1.0, 0.0, 1.0, (
        'Fraction of the URDF effort limits to which effort_command is clamped.')),
    robot_description.MEASURED_EFFORT_SPEC,
    texts('robot_compensates', (
        'Terms that the robot adds automatically to the commanded effort, and that effort_command '
        'therefore omits: gravity, friction.'), choices=ROBOT_COMPENSATIONS, read_only=True),
    robot_description.ROBOT_GRAVITY_SPEC,
    IMU_SPEC,
    flag('require_measured_velocities', False, (
        'Drop joint states without velocities. By default, velocities that are missing are those '
        'of the positions, late by 4 ms or half a period of the states.')),
    *SAFETY_SPECS,
    GOAL_SPEC,
    flag('autostart', True, (
        'Configure and activate the node at start. If false, the node waits for '
        '~/change_state.'), read_only=True),
)
GAINS = ('gains.natural_frequency', 'gains.damping_ratio')


def options_from(values: Values, arm: ArmModel) -> ControllerOptions:
    """Return checked options; raise InvalidInputError if they do not match the arm."""
    of_laws = declared('PARAMETERS')
    for name in (
            *GAINS, *(one.name for one in of_laws if one.is_per_joint), 'drive.stiffness',
            'following_error_limit', 'external_effort_limit', 'goal.tolerance'):
        check_order_is_given(values, name, arm)
    optional_values('external_effort_limit', values, arm)
    contact_levels(values, arm)
    goal_tolerances(values, arm)
    gains = make_gains(arm.joint_names, *(values[name] for name in GAINS))
    command = values['command'] if not command_obstacle(arm, values['command']) else NO_COMMAND
    options = ControllerOptions(
        gains, command, values['effort_limit_fraction'], values['friction_compensation'],
        torque_rates(values, arm), convention_from_parameters(values), True, True,
        values['infeasible_trajectory'] != 'reject', True,
        optional_values('following_error_limit', values, arm), values['reference_timeout'],
        checks_goals=True,
        clips_positions=values['infeasible_trajectory'] == 'clip',
        parameters={one.name: values[one.name] for one in of_laws},
        drive_stiffness=optional_values('drive.stiffness', values, arm))
    for law in all_laws().values():
        law.options(arm, options)
    return options


def optional_values(name: str, values: Values, arm: ArmModel) -> FloatArray | None:
    """Return a value per joint (n,), None if the parameter is empty."""
    return per_joint(name, values[name], arm.joint_names) if values[name] else None


def goal_tolerances(values: Values, arm: ArmModel) -> Tolerances:
    """Return the tolerances of a goal that gives none."""
    return default_tolerances(arm.joint_names, optional_values('goal.tolerance', values, arm))


def effort_rates(values: Values, arm: ArmModel) -> FloatArray:
    """Return the largest rates of change of the command, (n,) [N·m/s] or [N/s]."""
    rate = values['effort_rate_limit']
    return np.full(arm.joint_count, rate) if rate > 0.0 else default_effort_rates(arm)


def torque_rates(values: Values, arm: ArmModel) -> FloatArray:
    """Return the rates (n,) [N·m/s] or [N/s] of the torque at the largest rates of the command."""
    rates = effort_rates(values, arm)
    return rates if arm.drive is None else np.abs(arm.drive.scale) * rates


def effort_limits(values: Values, arm: ArmModel) -> EffortLimits:
    """Return the effort limits of this arm."""
    limits = arm.limits
    return EffortLimits(
        limits.lower, limits.upper, limits.velocity, effort_rates(values, arm),
        arm.given_drive.limit, np.sign(arm.given_drive.scale))


def state_timeout(values: Values) -> float:
    """Return the longest time [s] without a valid joint state."""
    return LOCK_STEP_TIMEOUT if values['lock_step'] else float(values['state_timeout'])


def safety_options(values: Values) -> SafetyOptions:
    """Return the options of the supervisor."""
    return SafetyOptions(
        state_timeout(values), values['fault_action'], values['hold_time'],
        values['ramp_time'], values['end_action'], values['lock_step'],
        values['require_measured_velocities'])
