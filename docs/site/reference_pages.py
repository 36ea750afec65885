# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Write the reference in docs/reference from the code: topics, services, parameters, executables.

    scripts/reference

The nodes are constructed, and asked for their topics, services and parameters. The descriptions
of topics, services and diagnostics come from `interface_descriptions.yaml`, those of parameters
from their specifications, options from --help. A test compares the files with the code.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from html import escape
from importlib import import_module
import io
import os
from pathlib import Path
import re
import sys
from typing import Any

import rclpy
from rclpy.node import Node
from robot_dynamics.ros.dynamics.node import DynamicsNode
from robot_dynamics.ros.dynamics.parameters import SPECS as DYNAMICS_SPECS
from robot_dynamics.ros.parameters.declared_parameters import ParameterSpec
from robot_dynamics.ros.simulated_arm.node import SimulatedArmNode
from robot_dynamics.ros.simulated_arm.node import SPECS as SIMULATED_ARM_SPECS
from robot_dynamics_tools.monitor.node import DynamicsMonitor
from robot_dynamics_tools.monitor.parameters import SPECS as MONITOR_SPECS
from robot_dynamics_tools.mujoco.mujoco_arm import MujocoArmNode
from robot_dynamics_tools.mujoco.mujoco_arm import SPECS as MUJOCO_ARM_SPECS
from robot_dynamics_tools.ros2_dynamics.verbs import VERBS
import yaml

ROOT = Path(__file__).resolve().parents[2]
DESCRIPTIONS = yaml.safe_load(
    Path(__file__).with_name('interface_descriptions.yaml').read_text(encoding='utf-8'))
REFERENCE = ROOT / 'docs' / 'reference'
PACKAGES = 'robot_dynamics', 'robot_dynamics_tools'
NODE_MODULES = (
    'robot_dynamics.ros.entry_points', 'robot_dynamics_tools.monitor.entry_points',
    'robot_dynamics_tools.mujoco.entry_point')
INTERFACES = 'robot_dynamics_interfaces'
NODES = {
    'dynamics': (DynamicsNode, DYNAMICS_SPECS, ()),
    'dynamics_monitor': (DynamicsMonitor, MONITOR_SPECS, ()),
    'simulated_arm': (SimulatedArmNode, SIMULATED_ARM_SPECS, ('-p', 'publish_clock:=true')),
    'mujoco_arm': (MujocoArmNode, MUJOCO_ARM_SPECS, ('-p', 'publish_clock:=true')),
}
OF_RCLPY = re.compile(
    r'/(rosout|parameter_events)$|/\w+_parameters?(_types|_atomically)?$|/get_type_description$|'
    r'/_action/')
"""Topics and services that every rclpy node has, and those of which an action consists."""
WIDTH = '88'
"""Columns of the text of --help."""
NOTE = '<!-- Written by scripts/reference from the code. -->\n\n'
EXIT_STATUSES = (
    ('0', 'The executable did its work; a node ended after SIGINT, SIGTERM, SIGHUP or a '
          'shutdown.'),
    ('1', 'The arguments are valid, but the work failed: a check found errors, a motion was not '
          'tracked, or a node could not start.'),
    ('2', 'An argument, a parameter or a file is invalid. One line on stderr names it.'),
    ('130', 'An interrupt (Ctrl-C) ended a tool. Partial results are kept and named.'))

Row = Sequence[str]


def reference_pages() -> dict[str, str]:
    """Return the pages by file name."""
    return {name: NOTE + text for name, text in (
        ('topics.md', _topics_page()), ('parameters.md', _parameters_page()),
        ('messages.md', _messages_page()), ('diagnostics.md', _diagnostics_page()),
        ('executables.md', _executables_page()))}


# ------------------------------------------------------------------ topics and services

@contextmanager
def _node(name: str) -> Iterator[Node]:
    make, _, arguments = NODES[name]
    rclpy.init(args=['--ros-args', '--log-level', 'error', *arguments])
    try:
        node = make()
        try:
            yield node
        finally:
            node.destroy_node()
    finally:
        rclpy.try_shutdown()


def _topics_page() -> str:
    text = [
        '# Topics and services\n',
        'Names are relative to the namespace of the node; `~` stands for the name of the node. '
        'The column "quality of service" lists what the publisher offers or the subscriber '
        'requests.\n',
        'Arrays in services are in the order of `joint_names`, or in the order of the node if '
        '`joint_names` is empty. [Conventions](../concepts.md#conventions) describes omitted '
        'names and mimic joints.\n']
    for name in NODES:
        with _node(name) as node:
            out = node.get_publisher_names_and_types_by_node(name, '/')
            incoming = node.get_subscriber_names_and_types_by_node(name, '/')
            services = node.get_service_names_and_types_by_node(name, '/')
            rows = [
                *_rows(incoming, name, 'in', node.get_subscriptions_info_by_topic),
                *_rows(out, name, 'out', node.get_publishers_info_by_topic)]
            text += [
                f'## Topics of `{name}`\n',
                _table(('topic', 'type', 'direction', 'quality of service', 'meaning'),
                       _with_meaning(rows, DESCRIPTIONS['topics'][name], name)),
                f'## Services of `{name}`\n',
                _table(('service', 'type', 'effect'),
                       _with_meaning(
                    _rows(services, name), DESCRIPTIONS['services'][name], name))]
        actions = DESCRIPTIONS['actions'].get(name, {})
        if actions:
            text += [f'## Actions of `{name}`\n', _table(('action', 'type', 'effect'), [
                [f'`{action}`', f'`{of["type"]}`', of['effect']]
                for action, of in actions.items()])]
    return '\n'.join(text)


def _rows(
    found: Sequence[tuple[str, Sequence[str]]], node: str, direction: str = '', info: Any = None,
) -> list[Row]:
    rows = []
    for name, kinds in sorted(found):
        if OF_RCLPY.search(name):
            continue
        shown = [f'`{_relative(name, node)}`', ', '.join(map(_type_link, kinds))]
        if info is not None:
            (qos,) = {_qos(end.qos_profile) for end in info(name) if end.node_name == node}
            shown += [direction, qos]
        rows.append(shown)
    return rows


def _relative(name: str, node: str) -> str:
    if name in ('/clock', '/diagnostics'):  # global names in the code too
        return name
    own = f'/{node}/'
    return f'~/{name.removeprefix(own)}' if name.startswith(own) else name.removeprefix('/')


def _qos(profile: Any) -> str:
    words = [profile.reliability.name.lower().replace('_', ' ')]
    if profile.durability.name == 'TRANSIENT_LOCAL':
        words.append('transient local')
    return ', '.join(words)


def _type_link(kind: str) -> str:
    if kind.startswith(f'{INTERFACES}/'):
        return f'[`{kind}`](messages.md#{kind.rpartition("/")[2].lower()})'
    return f'`{kind}`'


def _with_meaning(rows: Sequence[Row], texts: Mapping[str, str], node: str) -> list[Row]:
    """Add the description of each row; raise ValueError for names without one, and vice versa."""
    names = [row[0].strip('`') for row in rows]
    different = set(names) ^ set(texts)
    if different:
        raise ValueError(f'interface_descriptions.yaml and {node} differ in {sorted(different)}')
    return [[*row, texts[name]] for row, name in zip(rows, names)]


# ------------------------------------------------------------------ parameters

def _parameters_page() -> str:
    text = [
        '# Parameters\n',
        'Arrays with one value per joint are in the order of `joints`, which must then be set. '
        'An invalid value is rejected with a reason, at start and at run time. The files in '
        '[config](../../config/default_arm.yaml) show parameters with comments. Their key `/**` '
        'applies to both nodes in any namespace and under any name; a key such as `/dynamics` '
        'applies only to the node with exactly this full name. A node warns of sections that it '
        'ignores.\n']
    for name, (_, specs, _) in NODES.items():
        text += [f'## `{name}`\n', _table(
            ('parameter', 'type', 'default', 'values', 'run time', 'meaning'),
            [_parameter_row(spec) for spec in specs])]
    return '\n'.join(text)


def _parameter_row(spec: ParameterSpec) -> Row:
    kind = spec.kind.name.lower().removesuffix('_array')
    kind = {'integer': 'int'}.get(kind, kind) + (
        '[]' if spec.kind.name.endswith('_ARRAY') else '')
    values = ', '.join(f'`{choice}`' for choice in spec.choices)
    if spec.minimum is not None or spec.maximum is not None:
        low = f'{spec.minimum:g}' if spec.minimum is not None else '−∞'
        high = f'{spec.maximum:g}' if spec.maximum is not None else '∞'
        values = f'{low} to {high}'
    default = str(spec.default).lower() if isinstance(spec.default, bool) else repr(spec.default)
    return (f'`{spec.name}`', kind, f'`{default}`', values, 'no' if spec.read_only else 'yes',
            escape(spec.description, quote=False).replace('|', '\\|'))


# ------------------------------------------------------------------ messages and executables

def _diagnostics_page() -> str:
    text = [
        '# Diagnostics\n',
        'Statuses of the nodes on `/diagnostics`, once per second and whenever a level changes. '
        'The name of a status is the full name of the node and the name in the table, such as '
        '`/arm1/dynamics: command`, so that an aggregator separates the statuses of two arms. '
        'The values of a status are counters and figures with their unit in the key. The column '
        '"warning or error" lists when the level is not OK: an error if marked so, otherwise a '
        'warning.\n']
    for name, statuses in DESCRIPTIONS['diagnostics'].items():
        text += [f'## `{name}`\n', _table(
            ('status', 'meaning', 'warning or error', 'values'),
            [(f'`{key}`', *status.values()) for key, status in statuses.items()])]
    return '\n'.join(text)


def _messages_page() -> str:
    text = ['# Messages\n', f'The definitions of `{INTERFACES}`, as they are compiled.\n']
    for file in sorted((ROOT / INTERFACES).glob('*/*.*')):
        if file.suffix in ('.msg', '.srv'):
            definition = file.read_text(encoding='utf-8').rstrip()
            for ascii_unit, unit in (('N m', 'N·m'), ('kg m', 'kg·m'), ('^2', '²')):
                definition = definition.replace(ascii_unit, unit)
            text.append(
                f'## {file.stem}\n\n`{INTERFACES}/{file.parent.name}/{file.stem}`\n\n'
                f'```text\n{definition}\n```\n')
    return '\n'.join(text)


def _executables_page() -> str:
    text = [
        '# Executables\n',
        'Those of `robot_dynamics_tools` are also verbs: `ros2 dynamics NAME`, except for the '
        'nodes `dynamics_monitor` and `mujoco_arm`. Exit statuses:\n',
        _table(('status', 'meaning'), EXIT_STATUSES)]
    for package in PACKAGES:
        text.append(f'## ros2 run {package} NAME\n')
        text += [part for entry in sorted(_entry_points(package))
                 for part in _executable(*entry)]
    return '\n'.join(text)


def _executable(name: str, module: str, function: str) -> list[str]:
    """Return the section of an executable."""
    text = [f'### {name}\n']
    if module in NODE_MODULES:
        doc = getattr(import_module(module), function).__doc__.strip()
        text.append(f'{doc} Its options are `--help` and those of ROS: [topics and services]'
                    '(topics.md), [parameters](parameters.md).'
                    '\n')
    else:
        text.append(f'```text\n{_help(name, module, function)}\n```\n')
    if name == 'dynamics':
        text.append('With ros2cli, `ros2 dynamics VERB` does the same '
                    '([ros2 dynamics](../ros2_dynamics.md)).\n')
        text += [f'#### dynamics {verb}\n\n```text\n{_help(name, module, function, verb)}\n```\n'
                 for verb in VERBS]
    return text


def _entry_points(package: str) -> list[tuple[str, str, str]]:
    """Return name, module and function of the executables, as setup.py has them."""
    directory = ROOT if package == PACKAGES[0] else ROOT / package
    setup = (directory / 'setup.py').read_text(encoding='utf-8')
    block = re.search(r'EXECUTABLES = \{(.*?)\}', setup, re.DOTALL)
    found = re.findall(r"'(\w+)': '([\w.]+):(\w+)'", block[1] if block else '')
    if not found:
        raise ValueError(f'setup.py of {package} names no executables')
    return [(name, module if module.startswith(package) else f'{package}.{module}', function)
            for name, module, function in found]


def _help(name: str, module: str, function: str, *verb: str) -> str:
    """Return what an executable, or a verb of it, prints with --help."""
    os.environ['COLUMNS'] = WIDTH
    printed, sys.argv = io.StringIO(), [name, *verb, '--help']
    with redirect_stdout(printed):
        try:
            getattr(import_module(module), function)()
        except SystemExit as end:
            if end.code not in (0, None):
                raise ValueError(f'{module} --help ends with status {end.code}') from None
    if not printed.getvalue():
        raise ValueError(f'{module} --help prints nothing')
    return printed.getvalue().rstrip()


def _table(head: Row, rows: Sequence[Row]) -> str:
    lines = [head, ['---'] * len(head), *rows]
    return '\n'.join(f'| {" | ".join(cells)} |' for cells in lines) + '\n'


def main() -> int:
    """Write the pages to docs/reference, or to the directory that is given."""
    directory = Path(*sys.argv[1:]) if sys.argv[1:] else REFERENCE
    directory.mkdir(exist_ok=True)
    for name, text in reference_pages().items():
        (directory / name).write_text(text, encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
