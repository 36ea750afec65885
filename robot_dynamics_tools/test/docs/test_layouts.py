# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The layouts for PlotJuggler and Foxglove show topics that the running nodes publish."""

from collections.abc import Iterator
import json
from pathlib import Path
import re
from typing import Any
from xml.etree import ElementTree

from diagnostic_msgs.msg import DiagnosticArray
import pytest
from robot_dynamics_interfaces.msg import DynamicsTerms
from ros_harness import (
    DYNAMICS,
    MONITOR,
    NodeProcess,
    RosClient,
    running,
    SIMULATED_ARM,
    UNHURRIED,
)
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

CONFIG = Path(__file__).parents[3] / 'config'
PLOTJUGGLER = ElementTree.parse(CONFIG / 'plotjuggler.xml').getroot()
FOXGLOVE = json.loads((CONFIG / 'foxglove.json').read_text(encoding='utf-8'))
SNIPPETS = {snippet.attrib['name']: snippet for snippet in PLOTJUGGLER.iter('snippet')}
"""What PlotJuggler computes of the curves that are published."""
TYPES: dict[str, type] = {
    '/joint_states': JointState, '/effort_command': JointState,
    '/dynamics/gravity_compensation': JointState, '/dynamics/computed_torque': JointState,
    '/dynamics/terms': DynamicsTerms, '/dynamics/reference': JointState,
    '/dynamics_monitor/external_effort': JointState, '/dynamics_monitor/residual': JointState,
    '/diagnostics': DiagnosticArray,
}
NUMBER = r'[-+]?(nan|inf|\d*\.?\d+(e[-+]?\d+)?)'
PATH = re.compile(r'(/[\w/]+)((?:\.\w+(?:\[\$?\w+\])?)+)$')
"""A topic and the fields below it, in Foxglove's grammar of message paths."""


@pytest.fixture(scope='module')
def messages(client: RosClient) -> Iterator[dict[str, Any]]:
    """Return a message of each topic, while the arm follows a reference."""
    with running(
            NodeProcess(DYNAMICS, UNHURRIED), NodeProcess(SIMULATED_ARM, {'rate': 50.0}),
            NodeProcess(MONITOR)):
        collectors = {topic: client.collect(kind, topic) for topic, kind in TYPES.items()}
        collectors['/effort_command'].wait_for()  # nothing is followed before the first state
        client.publisher(JointTrajectory, '/dynamics/joint_trajectory').publish(JointTrajectory(
            joint_names=['joint1', 'joint2'], points=[
                JointTrajectoryPoint(positions=[0.1, 0.2], velocities=[0.0, 0.0])]))
        yield {topic: collector.wait_for(
            lambda m: not isinstance(m, DiagnosticArray) or any(
                'rate' in pair.key and float(pair.value) > 0.0
                for status in m.status for pair in status.values))
            for topic, collector in collectors.items()}
        for collector in collectors.values():
            collector.close()


# --- PlotJuggler ---------------------------------------------------------------------------------

def series(topic: str, message: Any) -> set[str]:
    """Return the names of the curves that PlotJuggler makes from a message."""
    if isinstance(message, JointState):
        return {
            f'{topic}/{name}/{field}' for field in ('position', 'velocity', 'effort')
            for name, _ in zip(message.name, getattr(message, field))}
    if isinstance(message, DiagnosticArray):
        return {
            f'{topic}/{status.hardware_id}/{status.name}/{key}' for status in message.status
            for key in ['level', *(
                pair.key for pair in status.values if re.fullmatch(NUMBER, pair.value))]}
    names = set()
    for field, kind in message.get_fields_and_field_types().items():
        value = getattr(message, field)
        if kind == 'sequence<double>':
            names |= {f'{topic}/{field}[{i}]' for i in range(len(value))}
        elif isinstance(value, float):
            names.add(f'{topic}/{field}')
    return names


def test_every_curve_of_plotjuggler_is_published(messages):
    published = set().union(*(series(topic, message) for topic, message in messages.items()))
    wanted = {curve.attrib['name'] for curve in PLOTJUGGLER.iter('curve')}
    assert wanted - published == set(SNIPPETS)
    chosen, = PLOTJUGGLER.findall(".//plugin[@ID='ROS2 Topic Subscriber']/selected_topics")
    assert set(chosen.attrib['value'].split(';')) == set(TYPES)


# --- Foxglove ------------------------------------------------------------------------------------

PLOTS = {name: panel for name, panel in FOXGLOVE['configById'].items() if 'paths' in panel}


def found(path: str, messages: dict[str, Any]) -> Any:
    """Return the value to which a message path of Foxglove leads."""
    match = PATH.match(path)
    assert match is not None, path
    value = messages[match[1]]
    for name, index in re.findall(r'\.(\w+)(?:\[(.+?)\])?', match[2]):
        value = getattr(value, name)
        if index:
            variable = index.removeprefix('$')
            value = value[int(FOXGLOVE['globalVariables'].get(variable, variable))]
    return value


def test_every_path_of_foxglove_leads_to_a_number_and_its_scene_is_published(client, messages):
    published = {
        name for node in ('dynamics', 'dynamics_monitor')
        for name, _ in client.node.get_publisher_names_and_types_by_node(node, '/')}
    shown = set(FOXGLOVE['configById']['3D!arm']['topics'])
    assert '/dynamics_monitor/markers' in shown
    assert shown - published == {'/robot_description'}  # from robot_state_publisher
    assert len(PLOTS) >= 5
    for name, plot in PLOTS.items():
        for path in plot['paths']:
            assert isinstance(found(path['value'], messages), float), name
            has_header = hasattr(messages[path['value'].split('.')[0]], 'header')
            assert path['timestampMethod'] != 'headerStamp' or has_header
