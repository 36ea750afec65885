# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Descriptions of the topics, services and diagnostics of both nodes, by node and by name.

The reference in docs/reference is made from these texts. A test compares the names with those of
the running nodes.
"""

from collections.abc import Mapping
from typing import NamedTuple


class StatusDescription(NamedTuple):
    """Description of a status: its meaning, when its level is not OK, and keys of its values."""

    meaning: str
    problem: str
    keys: str
    """As Markdown; each key is marked as code."""


Descriptions = Mapping[str, Mapping[str, str]]
"""Text by node and by name; `~` is the name of the node."""

TOPICS: Descriptions = {
    'dynamics': {
        'joint_states': 'Measured state, matched by joint name. The newest message of each '
                        'publisher is used.',
        'robot_description': 'URDF of the arm, used if no parameter gives one.',
        '~/joint_trajectory': 'Reference: a trajectory, or a set-point if it has one point '
                              '([trajectories](../trajectories.md)).',
        'effort_command': 'Command of the selected control law, without the terms in '
                          '`robot_compensates`, within the limits, as effort of the driver '
                          '(`effort.scale`, `effort.offset`). It has the stamp of the joint state '
                          'from which it is computed.',
        '~/commands': 'The values of `effort_command` in the order of `joints`, as the '
                      'controllers of ros2_control expect them.',
        '~/gravity_compensation': 'Gravity-compensation torque g(q) at the joints; not a command '
                                  'for a driver ([effort semantics](../effort_semantics.md)).',
        '~/computed_torque': 'Computed torque M(q̈_ref + K_d ė + K_p e) + C q̇ + g + friction at '
                             'the joints, while there is a reference; not a command for a driver.',
        '~/terms': 'Command before its limits, split by term, and the energies. The term '
                   '`inertial` contains the feedback of position and velocity errors. Torques at '
                   'the joints. Published while there are subscribers.',
        '~/reference': 'Position and velocity of the reference at the stamp of the joint state, '
                       'while there is a reference and a subscriber.',
        '~/external_effort': 'External joint torque Jᵀf, estimated by the momentum observer '
                             '([external torque](../external_effort.md)). Published while there '
                             'are subscribers.',
        '~/external_effort_deviation': 'Expected standard deviation of `~/external_effort`. '
                                       'Published while there are subscribers, if the '
                                       'parameters `uncertainty.*` are set.',
        '~/residual_deviation': 'Expected standard deviation of `~/residual`. Published while '
                                'there are subscribers, if the parameters `uncertainty.*` are '
                                'set.',
        '~/residual': 'Measured minus modelled effort, filtered. Published while there are '
                      'subscribers.',
        '~/markers': 'Markers for RViz: efforts at the joints, external torque and force, '
                     'payload. Published at 30 Hz while there are subscribers.',
        '~/payload': 'Active payloads. After each change, one message per loaded link, all with '
                     'the same stamp, the changed link last; m = 0 if there is no payload. A '
                     'late subscriber also receives older messages: use those with the newest '
                     'stamp.',
        '/diagnostics': 'Statuses of the node, once per second and whenever a level changes '
                        '([diagnostics](diagnostics.md)).',
        '~/transition_event': 'Transitions of the lifecycle.',
    },
    'simulated_arm': {
        'effort_command': 'Effort at each joint, clipped to the effort limits of the URDF '
                          '(`clip_efforts`); the terms in `robot_compensates` are added. It acts '
                          'until the next message, at most for `command_timeout`.',
        '~/external_wrench': 'Wrench on the link `frame_id`, in the frame of this link. It acts '
                             'until the next message; zeros remove it.',
        'joint_states': 'Position, velocity, and effort as `measured_effort` defines it.',
        '~/motor_states': 'Motor position and velocity divided by the gear ratio; they differ '
                          'from the joint values by the backlash. The effort is that of '
                          '`joint_states`.',
        '/clock': 'Simulated time, with `publish_clock` or `lock_step`.',
    },
    'mujoco_arm': {
        'effort_command': 'Effort at each driven joint, clipped to the limits of the MJCF '
                          '(`clip_efforts`). It acts until the next message, at most for '
                          '`command_timeout`.',
        '~/external_wrench': 'Wrench on the body `frame_id` of the MJCF, in the frame of this '
                             'body. It acts until the next message; zeros remove it.',
        'joint_states': 'Position, velocity and effort of the driven joints.',
        '~/motor_states': 'The same as `joint_states`, because these drives have no backlash.',
        '/clock': 'Simulated time, with `publish_clock` or `lock_step`.',
    },
}
"""Meaning of each topic."""

_SEE_PAYLOADS = '([payloads](../command.md#payloads))'
SERVICES: Descriptions = {
    'dynamics': {
        '~/inverse_dynamics': 'Returns the efforts of a motion, split by term, with optional '
                              'external wrenches.',
        '~/inverse_dynamics_batch': 'Returns the efforts of many samples in one call.',
        '~/inverse_dynamics_trajectory': 'Returns the efforts at the points of a trajectory, and '
                                         'whether arm and motors can deliver the efforts of the '
                                         'whole motion.',
        '~/forward_dynamics': 'Returns the joint accelerations that efforts cause.',
        '~/manipulator_equation': 'Returns M, C, g, N, friction, the Christoffel symbols and the '
                                  'energies.',
        '~/set_payload': 'Sets the payload of a link, on request gradually. m = 0 removes it, '
                         'and with an empty `frame_id` all payloads. A payload that the arm '
                         f'cannot carry is rejected {_SEE_PAYLOADS}.',
        '~/estimate_payload': 'Estimates what is attached to a link from measured efforts: starts '
                              'an estimation, returns the estimate so far, and applies it on '
                              'request ([payload estimation](../payload_estimation.md)).',
        '~/stop': 'Stops each joint as early as its limits permit, and then holds the position. '
                  'Available in every state of the node, also during long requests.',
        '~/reset_fault': 'Resets a latched fault and re-enables commands. Returns `success` '
                         'false and the reason while the cause persists.',
        '~/change_state': 'Lifecycle: configures, activates, deactivates, cleans up or shuts '
                          'down the node (`ros2 lifecycle set`).',
        '~/get_state': 'Lifecycle: returns the current state.',
        '~/get_available_states': 'Lifecycle: returns all states.',
        '~/get_available_transitions': 'Lifecycle: returns the transitions from the current '
                                       'state.',
        '~/get_transition_graph': 'Lifecycle: returns all transitions.',
    },
    'simulated_arm': {
        '~/reset': 'Returns the arm to its initial pose and engages the brakes.',
        '~/set_payload': 'Sets the payload of a link of the simulated arm. The controller is not '
                         'informed.',
    },
    'mujoco_arm': {
        '~/reset': 'Returns the arm and all other bodies to the start, and engages the brakes.',
    },
}
"""Effect of each service."""

STATUSES: dict[str, dict[str, StatusDescription]] = {
    'dynamics': {
        'joint states': StatusDescription(
            'Whether joint states arrive, are complete and agree with each other. The message '
            'for a dropped state contains the reason and the remedy.',
            'no states; a replayed recording; velocities that contradict the positions, or a '
            'frozen joint; a state dropped in the last second (error)',
            '`answered`, `not new (stamp repeated)`, `parts of a state`, `velocities`, '
            '`dropped: REASON` and `restarted: REASON`'),
        'timing': StatusDescription(
            'Rate, jitter and longest interval of the joint states in the last second. `late '
            'states` counts those later than 1.5 usual intervals, since the start.',
            'an interval above half of `state_timeout`',
            '`rate [Hz]`, `jitter, standard deviation [ms]`, `longest interval [ms]`, '
            '`late states`'),
        'reference': StatusDescription(
            'Whether a reference is followed, which may be a stop or a held position; why the '
            'latest one ended early or was rejected, until the next one. `slowed down by` is the '
            'factor of the last trajectory. With computed torque, per joint: the stiffness '
            'M_jj K_p of the feedback with scaled gains, and the position error at rest up to '
            'which the known dry friction can hold the joint against feedback and compensation.',
            'the latest rejected; the last one ended early',
            '`refused`, `refusal of the latest`, `streams that paused`, `slowed down by`, '
            '`share of the gains that the state rate allows`, `stiffness of JOINT`, '
            '`error that known dry friction can hold at JOINT`'),
        'command': StatusDescription(
            'Mode of the command; name and description of an active fault; counters of published '
            'and limited commands, such as `held back by scaled gains`.',
            'a fault (error); not running; an active limit in the last second; incompatible '
            'quality of service of a subscriber',
            '`published`, `held back by …`, `faults: …`, `incompatible subscribers of …`'),
        'estimates': StatusDescription(
            'Whether `~/external_effort` and `~/residual` are estimated; restarts of the '
            'estimators ([external torque](../external_effort.md)). Without estimates, neither '
            'topic is published.',
            'subscribers of `~/external_effort` or `~/residual`, but states without effort or '
            'velocity',
            '`reset: REASON`'),
        'other nodes': StatusDescription(
            'Other publishers of the command topics, and other nodes of the same name. Checked '
            'once per second; the result is also logged.',
            'another publisher of `effort_command` or `~/commands`; another node with the same '
            'full name',
            '`nodes of this name`, `publishers of effort_command`, `publishers of ~/commands`'),
        'payload': StatusDescription(
            'Active payloads by link, their number and their total mass [kg].',
            'the newest model cannot carry the payloads (error)',
            '`payloads`, `mass`'),
        'gravity': StatusDescription(
            'Gravity in the base frame [m/s^2] and its source: the parameter, or the IMU of the '
            'base. Counter and reason of rejected messages of the IMU.',
            'no valid message of the IMU',
            '`gravity`, `refused`, `refusal of the latest`'),
        'model': StatusDescription(
            'Name of the arm, the control law, and whether a new description is waiting.',
            'no model',
            '`command`, `a new one waits`, `callbacks that failed`'),
        'effort check': StatusDescription(
            'Result of the comparison of measured effort, command and g(q) in a static hold '
            '([effort semantics](../effort_semantics.md)).',
            'gravity is compensated twice, or not as declared',
            '`k`, `expected k`, `tolerance`'),
    },
}
"""Each status on /diagnostics, which is named `NODE: STATUS`."""
