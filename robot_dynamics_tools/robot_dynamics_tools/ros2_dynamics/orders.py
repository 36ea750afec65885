# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics stop`, `command` and `reset`: what a person at the arm orders."""

from argparse import Namespace

from robot_dynamics_tools.ros2_dynamics.answers import Answer
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient
from std_srvs.srv import Trigger

EFFECTS = {
    'none': 'a moving arm stops first; then the command ends',
    'gravity_compensation': 'the arm can be moved by hand, and is not held',
    'computed_torque': 'the arm stops and is held',
    'hand_guiding': 'the arm can be moved by hand, and friction holds it',
    'joint_impedance': 'the arm stops, and springs hold it',
    'cartesian_impedance': 'the arm stops, and springs hold its frame'}
"""What a node does after the change to a law of this package."""


def answer_stop(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Stop the arm, and hold it."""
    return _trigger(client, 'stop')


def answer_reset(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Reset a latched fault."""
    return _trigger(client, 'reset_fault')


def _trigger(client: DynamicsClient, service: str) -> Answer:
    message = client.call(Trigger, service, Trigger.Request()).message
    return Answer({'node': client.name, 'message': message}, f'{client.name}: {message}')


def answer_command(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Return the control law of the node, which a mode replaces."""
    before = client.parameters(['command'])['command']
    mode = arguments.mode or before
    if mode != before:
        client.set_parameter('command', mode)
    data = {'node': client.name, 'command': mode, 'before': before}
    text = f'{client.name}: command is {mode!r}'
    if mode != before:
        text += f', it was {before!r}' + (f': {EFFECTS[mode]}' if mode in EFFECTS else '')
    return Answer(data, text)
