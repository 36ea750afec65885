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

"""The parameters of `dynamics`, and what they make of its control law."""

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
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.control.supervisor import FAULT_ACTIONS, SafetyOptions
from robot_dynamics.joints.effort_convention import MEASURED_EFFORTS, ROBOT_COMPENSATIONS
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import check_order_is_given, convention_from_parameters
from robot_dynamics.ros.declared_parameters import ParameterSpec, Type, Values
from robot_dynamics.ros.dynamics.live_estimates import ESTIMATE_SPECS
from robot_dynamics.ros.dynamics.model_check_log import IGNORE_CHECKS_SPEC
from robot_dynamics.ros.payloads import PAYLOAD_SPEC
from robot_dynamics.ros.robot_description import ACTUATOR_SPECS, DESCRIPTION_SPECS, FRICTION_SPECS

FULL_EFFORT_TIME = 0.1
"""[s] in which the command may change by the effort limit of a joint, by default."""
DEFAULT_EFFORT_RATE = 1000.0
"""[N·m/s] or [N/s], likewise, of a joint without an effort limit."""
REFERENCE_LOSS = ('hold', 'gravity_compensation')
INFEASIBLE_TRAJECTORY = ('reject', 'slow_down', 'clip')

SAFETY_SPECS = (
    ParameterSpec(
        'fault_action', Type.STRING, FAULT_ACTIONS[0],
        'What a fault does to effort_command: hold_gravity_then_ramp (hold for hold_time, then '
        'ramp to zero), ramp_to_zero, or stop_publishing at once.', choices=FAULT_ACTIONS),
    ParameterSpec(
        'hold_time', Type.DOUBLE, 1.0,
        'How long hold_gravity_then_ramp holds the arm [s].', minimum=0.0, maximum=3600.0),
    ParameterSpec(
        'ramp_time', Type.DOUBLE, 0.5,
        'How long efforts take to ramp to zero, after a fault, at deactivation and at the end '
        '[s]; longer where effort_rate_limit asks for it.', minimum=0.0, maximum=60.0),
    ParameterSpec(
        'state_timeout', Type.DOUBLE, 0.05,
        'Time without a valid joint state that is a fault, on the steady clock [s].',
        minimum=0.001, maximum=60.0),
    ParameterSpec(
        'state_max_age', Type.DOUBLE, 0.2,
        'How far the stamp of a joint state may be from the clock of this computer [s]; 0 for '
        'any. Stamps that are more than an hour off at first are of another clock: then this '
        'limits how far that clock may run ahead of or behind its first offset. Stamps before '
        '2001 are simulated time, which may run slowly.',
        minimum=0.0, maximum=60.0),
    ParameterSpec(
        'reference_timeout', Type.DOUBLE, 0.1,
        'Pause of a stream of set-points after which reference_loss takes effect [s].',
        minimum=0.001, maximum=60.0),
    ParameterSpec(
        'reference_loss', Type.STRING, REFERENCE_LOSS[0],
        'Reaction to a reference that ends early (fault, paused stream, restart of the joint '
        'states): hold (stop within the limits and hold the position) or gravity_compensation '
        '(no feedback, for hand guiding).', choices=REFERENCE_LOSS),
    ParameterSpec(
        'condition_references', Type.BOOL, True,
        'Follow every reference within velocity, acceleration and jerk limits that the arm can '
        'follow; without, a step of the reference is a step of the effort.'),
    ParameterSpec(
        'infeasible_trajectory', Type.STRING, INFEASIBLE_TRAJECTORY[0],
        'Reaction to a trajectory that exceeds a limit of the arm: it is rejected (reject), its '
        'velocities are lowered (slow_down), or its positions are clipped to the position limits '
        'as well (clip). Paths without velocities are always slowed down as needed.',
        choices=INFEASIBLE_TRAJECTORY),
    ParameterSpec(
        'following_error_limit', Type.DOUBLE_ARRAY, [],
        'Distance [rad] or [m] between position and reference that is a fault, one for all '
        'joints or one per joint, 0 for none; empty for 0.3 s at the velocity limit.',
        minimum=0.0, maximum=1e9),
    ParameterSpec(
        'overspeed_factor', Type.DOUBLE, 1.2,
        'Multiple of a velocity limit of the URDF that is a fault, 0 for none.',
        minimum=0.0, maximum=1e9),
    ParameterSpec(
        'external_effort_limit', Type.DOUBLE_ARRAY, [],
        'External effort [N m] or [N] that is a fault, one for all joints or one per joint, 0 or '
        'empty for none; see ~/external_effort.', minimum=0.0, maximum=1e9),
    ParameterSpec(
        'effort_rate_limit', Type.DOUBLE, 0.0,
        'Largest rate of change of effort_command [N m/s] or [N/s] of every joint; 0 for the '
        'effort limit of each joint in 0.1 s.', minimum=0.0, maximum=1e9),
    ParameterSpec(
        'position_margin', Type.DOUBLE, 0.01,
        'Distance before a position limit [rad] or [m] from which no effort pushes on toward it.',
        minimum=0.0, maximum=10.0),
    ParameterSpec(
        'position_fault_margin', Type.DOUBLE, 0.0087,
        'Distance past a position limit [rad] or [m] that is a fault.',
        minimum=0.0, maximum=1e9),
)

SPECS = (
    *DESCRIPTION_SPECS,
    *FRICTION_SPECS,
    *ACTUATOR_SPECS,
    IGNORE_CHECKS_SPEC,
    PAYLOAD_SPEC,
    ParameterSpec(
        'command', Type.STRING, 'computed_torque',
        'What effort_command carries; computed_torque falls back to gravity_compensation '
        'without a reference.', choices=command_modes()),
    ParameterSpec(
        'gains.natural_frequency', Type.DOUBLE_ARRAY, [DEFAULT_NATURAL_FREQUENCY],
        'Natural frequency of the tracking error [rad/s], one for all joints or one a joint: '
        'K_p is its square.', minimum=0.0, maximum=1e4),
    ParameterSpec(
        'gains.damping_ratio', Type.DOUBLE_ARRAY, [DEFAULT_DAMPING_RATIO],
        'Damping ratio of the tracking error, one for all joints or one a joint: K_d is twice '
        'this times the natural frequency.', minimum=0.0, maximum=1e4),
    ParameterSpec(
        'gains.kp', Type.DOUBLE_ARRAY, [],
        'K_p [1/s^2] instead, one for all joints or one a joint.', minimum=0.0, maximum=1e8),
    ParameterSpec(
        'gains.kd', Type.DOUBLE_ARRAY, [],
        'K_d [1/s] instead, one for all joints or one a joint.', minimum=0.0, maximum=1e8),
    ParameterSpec(
        'soften_gains', Type.BOOL, True,
        'Scale the gains down to what the rate of the joint states allows, and for large errors '
        'to what effort_rate_limit allows; without, a disturbance can make the arm oscillate.'),
    ParameterSpec(
        'friction_compensation', Type.STRING, 'reference',
        'The velocity at which computed torque compensates friction: reference (that of the '
        'reference, corrected by the error: robust), measured (exact linearisation, for strong '
        'gears read without delay), or none.', choices=FRICTION_MODES),
    ParameterSpec(
        'effort_scale', Type.DOUBLE, 1.0,
        'Share of the URDF effort limits to which effort_command is clamped.',
        minimum=0.0, maximum=1.0),
    ParameterSpec(
        'measured_effort', Type.STRING, 'joint_torque',
        'What effort in joint_states is: joint_torque, joint_torque_without_gravity, '
        'motor_torque [N m] or motor_current [A] (both need actuators), or none.',
        read_only=True, choices=MEASURED_EFFORTS),
    ParameterSpec(
        'robot_compensates', Type.STRING_ARRAY, [],
        'What the robot adds by itself to the effort that it is commanded, and effort_command '
        'so leaves out: gravity, friction.', read_only=True, choices=ROBOT_COMPENSATIONS),
    ParameterSpec(
        'require_measured_velocities', Type.BOOL, False,
        'Follow references only if the joint states contain velocities. By default, velocities '
        'that are missing or NaN are estimated from the positions, 5 ms late or half a period '
        'of the states, and the gains are lowered accordingly.'),
    ParameterSpec(
        'joint_sample_max_age', Type.DOUBLE, 0.0,
        'Largest difference [s] between the stamps of the samples of a state, if the joints of '
        'the arm are spread over several messages. 0 for half a period of these messages.',
        minimum=0.0, maximum=10.0),
    ParameterSpec(
        'effort_check', Type.BOOL, True,
        'Compare measured effort, command and g(q) once in a static hold, and warn where gravity '
        'is compensated twice, or not as declared.', read_only=True),
    *ESTIMATE_SPECS,
    *SAFETY_SPECS,
    ParameterSpec(
        'autostart', Type.BOOL, True,
        'Configure and activate at the start; without, wait for ~/change_state.',
        read_only=True),
    ParameterSpec(
        'state_thread', Type.BOOL, True,
        'Take joint states in a thread of their own (little delay) instead of in the executor.',
        read_only=True),
)
GAINS = ('gains.natural_frequency', 'gains.damping_ratio', 'gains.kp', 'gains.kd')


def options_from(values: Values, arm: ArmModel) -> ControllerOptions:
    """Return checked options; raise InvalidInputError where the parameters do not fit the arm."""
    for name in (*GAINS, 'following_error_limit', 'external_effort_limit'):
        check_order_is_given(values, name, arm)
    optional_limits('external_effort_limit', values, arm)
    gains = make_gains(arm.joint_names, *(values[name] for name in GAINS))
    return ControllerOptions(
        gains, values['command'], values['effort_scale'], values['friction_compensation'],
        effort_rates(values, arm), convention_from_parameters(values), values['soften_gains'],
        values['condition_references'], values['infeasible_trajectory'] != 'reject',
        values['reference_loss'] == 'hold',
        optional_limits('following_error_limit', values, arm), values['reference_timeout'],
        not values['require_measured_velocities'], checks_goals=True,
        clips_positions=values['infeasible_trajectory'] == 'clip')


def optional_limits(name: str, values: Values, arm: ArmModel) -> FloatArray | None:
    """Return a limit per joint (n,), None where the parameter is empty."""
    return per_joint(name, values[name], arm.joint_names) if values[name] else None


def effort_rates(values: Values, arm: ArmModel) -> FloatArray:
    """Return the largest rates of change of the command, (n,) [N·m/s] or [N/s]."""
    rate = values['effort_rate_limit']
    if rate > 0.0:
        return np.full(arm.joint_count, rate)
    limit = arm.limits.effort
    return np.where(np.isfinite(limit), limit / FULL_EFFORT_TIME, DEFAULT_EFFORT_RATE)


def guard_limits(values: Values, arm: ArmModel) -> EffortLimits:
    """Return the limits of this arm's efforts."""
    limits = arm.limits
    return EffortLimits(
        limits.lower, limits.upper, limits.velocity, values['position_margin'],
        effort_rates(values, arm))


def safety_options(values: Values) -> SafetyOptions:
    """Return what the supervisor goes by."""
    return SafetyOptions(
        values['state_timeout'], values['fault_action'], values['hold_time'],
        values['ramp_time'], values['position_fault_margin'],
        values['overspeed_factor'] or math.inf)
