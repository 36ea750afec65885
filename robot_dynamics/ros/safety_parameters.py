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

"""The parameters of `dynamics` that say what may go out, and what happens when it may not."""

from robot_dynamics.arm_model import ArmModel
from robot_dynamics.command_supervisor import FAULT_ACTIONS, SafetyOptions
from robot_dynamics.effort_guard import GuardLimits
from robot_dynamics.ros.parameters import ParameterSpec, Type, Values

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
        'any. Stamps more than an hour off are of another clock, and not judged.',
        minimum=0.0, maximum=60.0),
    ParameterSpec(
        'reference_timeout', Type.DOUBLE, 0.1,
        'Pause of a stream of set-points after which there is no reference [s].',
        minimum=0.001, maximum=60.0),
    ParameterSpec(
        'effort_rate_limit', Type.DOUBLE, 1000.0,
        'Fastest change of effort_command [N m/s] or [N/s].', minimum=1e-3, maximum=1e9),
    ParameterSpec(
        'position_margin', Type.DOUBLE, 0.01,
        'Distance before a position limit [rad] or [m] from which no effort pushes on toward it.',
        minimum=0.0, maximum=10.0),
    ParameterSpec(
        'position_fault_margin', Type.DOUBLE, 0.0087,
        'Distance past a position limit [rad] or [m] that is a fault.',
        minimum=0.0, maximum=1e9),
)


def guard_limits(values: Values, arm: ArmModel) -> GuardLimits:
    """Return the limits of this arm's efforts."""
    limits = arm.limits
    return GuardLimits(
        limits.lower, limits.upper, limits.velocity, values['position_margin'],
        values['effort_rate_limit'])


def safety_options(values: Values) -> SafetyOptions:
    """Return what the supervisor goes by."""
    return SafetyOptions(
        values['state_timeout'], values['fault_action'], values['hold_time'],
        values['ramp_time'], values['position_fault_margin'])
