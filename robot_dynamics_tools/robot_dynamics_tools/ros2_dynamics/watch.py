# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics watch`: a table of the joints of the node that is printed again and again."""

from argparse import Namespace
from collections.abc import Sequence
import json
import math
import shutil
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import qos_profile_sensor_data
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from robot_dynamics.validation import check_scalar
from robot_dynamics_tools.reporting.text_table import folded_table, json_numbers, percent
from robot_dynamics_tools.ros2_dynamics.answers import Units
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, MONITOR, NoAnswerError
from robot_dynamics_tools.ros2_dynamics.orders import values_at_rest
from sensor_msgs.msg import JointState

COMMAND_TIME = 1.5
"""[s] that the first table waits for a command, external efforts, and diagnostics (1 Hz)."""
STALE_TIME = 1.0
"""[s] without joint states after which the table reports their age."""


class JointTable:
    """The newest values of the joints of a node."""

    def __init__(self, client: DynamicsClient) -> None:
        """Ask the node for its joints."""
        self._client = client
        self._names = client.joint_names()
        joints = client.joints()
        self._units = Units.of(self._names, {name: j.kind for name, j in joints.items()})
        self._limits = [
            joints[name].effort_limit if name in joints else math.inf for name in self._names]
        self._values: dict[str, dict[str, float]] = {field: {} for field in (
            'position', 'velocity', 'effort_command', 'effort', 'gravity', 'external_effort')}
        self._has_torques = client.parameters(['measured_effort'])['measured_effort'] == (
            'joint_torque')
        self._at_rest: dict[str, dict[str, float]] = {}
        self.stamp_ns: int | None = None
        """Stamp [ns] of the newest joint state, None before the first."""
        self._received = time.monotonic()

    def topics(self) -> list[Any]:
        """Return the topics to subscribe to, with their callbacks."""
        client = self._client
        return [
            (DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)] + [
            (JointState, topic, take, qos_profile_sensor_data) for topic, take in (
                (client.joint_state_topic(), self._on_state),
                (client.resolve('effort_command'), lambda m: self._keep(m, 'effort_command')),
                (client.resolve('~/gravity_compensation'), lambda m: self._keep(m, 'gravity')),
                (client.resolve(f'{MONITOR}/external_effort'),
                 lambda m: self._keep(m, 'external_effort')))]

    def _on_state(self, message: JointState) -> None:
        self._received = time.monotonic()
        self.stamp_ns = stamp_from_ros(message.header.stamp)
        self._values['position'] |= zip(message.name, message.position)
        self._values['velocity'] |= zip(message.name, message.velocity)
        if self._has_torques:
            self._keep(message, 'effort')

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        name = self._client.name
        if any(status.name.startswith(f'{name}: ') for status in message.status):
            self._at_rest = values_at_rest(name, message.status)

    def _keep(self, message: JointState, field: str) -> None:
        self._values[field] |= zip(message.name, message.effort)

    def is_complete(self) -> bool:
        """Return whether all topics have arrived."""
        return all(self._values.values()) and bool(self._at_rest)

    def data(self) -> dict[str, Any]:
        """Return the values in the order of the node, null for those that did not arrive."""
        columns = {
            field: json_numbers(values.get(name, math.nan) for name in self._names)
            for field, values in self._values.items()}
        at_rest = {
            field: [values.get(name) for name in self._names]
            for field, values in self._at_rest.items() if values}
        difference = [
            None if measured is None or g is None else measured - g
            for measured, g in zip(columns['effort'], columns['gravity'])]
        shares = [
            None if effort is None or not math.isfinite(limit) else abs(effort) / limit
            for effort, limit in zip(columns['effort_command'], self._limits)]
        return {
            'node': self._client.name, 'stamp': 1e-9 * (self.stamp_ns or 0),
            'joint_names': self._names, **columns, 'effort_share': shares,
            'effort_minus_gravity': difference, **at_rest}

    def text(self, width: int | None = None) -> str:
        """Return the table, of a `width` [characters], below a line with the age of the values."""
        data, units = self.data(), self._units
        per_second = ', '.join(f'{unit}/s' for unit in units.position.split(', '))
        columns: dict[str, Sequence[float | None]] = {
            f'position [{units.position}]': data['position'],
            f'velocity [{per_second}]': data['velocity'],
            f'command [{units.effort}]': data['effort_command'],
            'share of limit': data['effort_share']}
        if self._values['effort']:
            columns |= {
                f'measured [{units.effort}]': data['effort'], 'g(q)': data['gravity'],
                'measured - g(q)': data['effort_minus_gravity']}
        if self._values['external_effort']:
            columns[f'external [{units.effort}]'] = data['external_effort']
        if 'stiffness' in data:
            pairs = zip(units.effort.split(', '), units.position.split(', '))
            columns[f'stiffness [{", ".join(map("/".join, pairs))}]'] = data['stiffness']
        if 'friction_error' in data:
            columns[f'error held by friction [{units.position}]'] = data['friction_error']
        age = time.monotonic() - self._received
        state = f'stamp {data["stamp"]:.3f} s' + (
            f', no joint states for {age:.1f} s' if age > STALE_TIME else '')
        cells = {heading: [_cell(value, heading) for value in values]
                 for heading, values in columns.items()}
        table = units.table(self._names, cells) if width is None else folded_table(
            {'joint': self._names, **units.kind_column(self._names)}, cells, width)
        return f'{self._client.name}: {state}'[:width] + f'\n{table}'


def _cell(value: float | None, heading: str) -> str:
    if heading == 'share of limit':
        return percent(math.nan if value is None else value)
    return '-' if value is None else f'{round(value, 4) + 0.0:.4f}'  # no -0.0000


def answer_watch(client: DynamicsClient, arguments: Namespace) -> None:
    """Print tables until Ctrl-C, or as many as requested."""
    period = 1.0 / check_scalar('--rate', arguments.rate, 0.0, exclusive_minimum=True)
    count = math.inf if arguments.count is None else check_scalar('--count', arguments.count, 1)
    table = JointTable(client)
    topics = table.topics()
    try:
        with client.subscribed(*topics):
            if not client.wait(lambda: table.stamp_ns is not None):
                raise NoAnswerError(f'no joint states on {topics[1][1]} in {client.timeout:g} s')
            client.wait(table.is_complete, COMMAND_TIME)
            if not client.has_monitor:
                print('no external efforts: no node dynamics_monitor; start it with: '
                      f'{client.start_of_monitor}', file=sys.stderr)
            rewrites, lines, printed = sys.stdout.isatty() and not arguments.json, 0, 0
            while True:
                width = shutil.get_terminal_size().columns if rewrites else None
                text = json.dumps(table.data()) if arguments.json else table.text(width)
                if rewrites and lines:
                    print(f'\x1b[{lines}F\x1b[J', end='')  # up to the first line, erase below
                elif lines and not arguments.json:
                    print()
                print(text, flush=True)
                lines, printed = text.count('\n') + 1, printed + 1
                if printed >= count:
                    return
                client.wait(lambda: False, period)
    except KeyboardInterrupt:
        print(file=sys.stderr)
