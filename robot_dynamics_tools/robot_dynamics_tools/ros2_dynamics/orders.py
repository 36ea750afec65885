# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics status`, `stop`, `command`, `reset`, `payload` and `estimate_payload`."""

from argparse import Namespace
from collections.abc import Iterable, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from lifecycle_msgs.srv import GetState
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.ros.middleware import diagnostics
from robot_dynamics_interfaces.srv import EstimatePayload, SetPayload
from robot_dynamics_tools.reporting.text_table import json_numbers, quantity_table, text_table
from robot_dynamics_tools.ros2_dynamics.answers import Answer, warning_lines
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError
from std_srvs.srv import Trigger

EFFECTS = {
    'none': 'a moving arm stops first; then the command ends',
    'gravity_compensation': 'the arm can be moved by hand, and is not held',
    'computed_torque': 'the arm stops and is held',
    'hand_guiding': 'the arm can be moved by hand, and friction holds it',
    'joint_impedance': 'the arm stops, and springs hold it',
    'cartesian_impedance': 'the arm stops, and springs hold its frame'}
"""What a node does after the change to a law of this package."""
LEVELS = {
    DiagnosticStatus.OK: 'ok', DiagnosticStatus.WARN: 'warning', DiagnosticStatus.ERROR: 'ERROR',
    DiagnosticStatus.STALE: 'stale'}
AT_REST = (
    'At rest: stiffness of the feedback [N·m/rad, N/m], and position error [rad, m] up to which '
    'the\nknown dry friction can hold a joint')
TENSOR = 'ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz'


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


# ------------------------------------------------------------------------------ status

def values_per_joint(values: Iterable[KeyValue], beginning: str) -> dict[str, float]:
    """Return the values per joint whose keys have this beginning (`joint_key`)."""
    return {
        pair.key.removeprefix(f'{beginning} ').rpartition(' [')[0]: float(pair.value)
        for pair in values if pair.key.startswith(f'{beginning} ')}


def values_at_rest(node: str, statuses: Iterable[DiagnosticStatus]) -> dict[str, dict[str, float]]:
    """Return stiffness and error by joint in the diagnostics, and the stiffness of drives."""
    pairs = [pair for status in statuses if status.name == f'{node}: reference'
             for pair in status.values]
    drives = values_per_joint(pairs, diagnostics.DRIVE_STIFFNESS)
    return {'stiffness': values_per_joint(pairs, diagnostics.STIFFNESS),
            'friction_error': values_per_joint(pairs, diagnostics.FRICTION_ERROR),
            **({'drive_stiffness': drives} if drives else {})}


def answer_status(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Return how the node is."""
    name = client.name
    state = client.call(GetState, 'get_state', GetState.Request()).current_state.label
    command = client.parameters(['command'])['command']
    joints = client.joint_names() if state in ('active', 'inactive') else []
    payloads = _payloads(client) if joints else []
    checks = client.receive(DiagnosticArray, '/diagnostics', 10, lambda message: [
        status for status in message.status if status.name.startswith(f'{name}: ')] or None)
    if checks is None:
        raise NoAnswerError(f'{name} sends no /diagnostics')
    rows = [[status.name.partition(': ')[2], LEVELS[status.level], status.message]
            for status in checks]
    facts = {'state': state, 'command': command, 'joints': ', '.join(joints) or 'none yet'}
    facts |= {'payload': _describe(payloads)} if payloads else {}
    blocks = [f'{name}\n' + text_table([], list(facts.items())),
              text_table(['check', 'level', 'message'], rows)]
    at_rest = values_at_rest(name, checks)
    if any(at_rest.values()):
        blocks.insert(1, AT_REST + '\n' + text_table(
            ['joint', *at_rest], [
                [joint, *(f'{values[joint]:.4g}' if joint in values else '-'
                          for values in at_rest.values())]
                for joint in joints]))
    if arguments.verbose:
        blocks += [f'{row[0]}\n' + text_table([], [
            [pair.key, pair.value] for pair in status.values])
            for row, status in zip(rows, checks) if status.values]
    return Answer(
        {'node': name, **facts, 'joints': joints, 'at_rest': at_rest, **_as_data(payloads),
         'checks': [
            {'check': row[0], 'level': row[1].lower(), 'message': row[2],
             'values': {pair.key: pair.value for pair in status.values}}
            for row, status in zip(rows, checks)]},
        '\n\n'.join(blocks),
        1 if any(status.level == DiagnosticStatus.ERROR for status in checks) else 0)


# ------------------------------------------------------------------------------ payloads

def answer_payload(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Return the active payloads, after a change if one is requested."""
    if arguments.clear and arguments.link:
        raise InvalidInputError(
            f'LINK is {arguments.link!r} together with --clear, expected only one')
    if arguments.link and arguments.mass is None:
        raise InvalidInputError(f'LINK is {arguments.link!r} without a MASS, expected both')
    if arguments.link or arguments.clear:
        request = SetPayload.Request(transition_time=arguments.transition)
        if arguments.link:
            request.payload.header.frame_id, inertia = arguments.link, request.payload.inertia
            inertia.m = arguments.mass
            inertia.com.x, inertia.com.y, inertia.com.z = arguments.com
            for name, value in zip(TENSOR, arguments.inertia):
                setattr(inertia, name, value)
        response = client.call(SetPayload, 'set_payload', request)
        data = {'node': client.name, 'message': response.message,
                'transition_time': arguments.transition, 'warnings': list(response.warnings)}
        lines = [f'{client.name}: {response.message}' + (
            f', in {arguments.transition:g} s' if arguments.transition else ''),
            *warning_lines(response.warnings)]
        if arguments.simulated:
            arm = client.resolve('simulated_arm')
            data['simulated'] = client.call(SetPayload, f'{arm}/set_payload', request).message
            lines.append(f'{arm}: {data["simulated"]}')
        return Answer(data, '\n'.join(lines))
    payloads = _payloads(client)
    if not payloads:
        raise NoAnswerError(f'{client.name} does not publish its payloads')
    return Answer(
        {'node': client.name, **_as_data(payloads)}, f'{client.name}: {_describe(payloads)}')


def answer_estimate_payload(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Start an estimation if a link is given, else return the estimate so far."""
    if arguments.link and (arguments.apply or arguments.stop):
        raise InvalidInputError(
            f'LINK is {arguments.link!r} together with --apply or --stop, expected only one')
    request = EstimatePayload.Request(
        start=bool(arguments.link), link=arguments.link or '', apply=arguments.apply,
        stop=arguments.stop, transition_time=arguments.transition)
    monitor = client.monitor
    response = client.call(EstimatePayload, f'{monitor}/estimate_payload', request)
    lists = {name: list(getattr(response, name)) for name in (
        'parameters', 'values', 'verdicts', 'per_percent_of_effort', 'advice', 'remarks',
        'warnings')}
    data = {
        'node': monitor, 'message': response.message, 'link': response.link,
        'duration_s': response.duration, 'holds': response.holds, **lists,
        'deviations': json_numbers(response.deviations)}
    text = f'{monitor}: {response.message}'
    if response.parameters:
        from robot_dynamics_tools.payload_estimation.summary import parameter_rows
        table = quantity_table(parameter_rows(
            response.values, response.deviations, response.per_percent_of_effort,
            response.verdicts))
        text += f'\n{response.duration:.1f} s, {response.holds} holds\n\n{table}\n'
        text += ''.join(f'\n{line}' for line in (
            *response.advice, *response.remarks, *warning_lines(response.warnings)))
    return Answer(data, text)


def _payloads(client: DynamicsClient) -> list[dict[str, Any]]:
    """Return the active payloads, with mass 0 if there is none; empty without a message."""
    return [{
        'link': message.header.frame_id, 'mass': message.inertia.m,
        'com': [getattr(message.inertia.com, axis) for axis in 'xyz'],
        'inertia': [getattr(message.inertia, name) for name in TENSOR]}
        for message in client.payloads()]


def _as_data(payloads: Sequence[dict[str, Any]]) -> dict[str, Any]:
    return {'payload': payloads[-1] if payloads else None,
            'payloads': [payload for payload in payloads if payload['mass'] > 0.0]}


def _describe(payloads: Sequence[dict[str, Any]]) -> str:
    return '; '.join(
        f'{one["mass"]:g} kg on {one["link"]!r}, centre of mass '
        f'({", ".join(f"{value:g}" for value in one["com"])}) m'
        for one in payloads if one['mass'] > 0.0) or 'no payload'
