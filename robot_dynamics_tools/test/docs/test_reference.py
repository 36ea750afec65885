# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""docs/reference is the output of scripts/reference, and matches the running nodes."""

from collections.abc import Iterator
from html import unescape
import os
from pathlib import Path
import re
import subprocess
import sys
from typing import Any

import children
from diagnostic_msgs.msg import DiagnosticArray
import pytest
from rcl_interfaces.srv import ListParameters
from ros_harness import (
    DYNAMICS,
    MONITOR,
    MUJOCO_ARM,
    NodeProcess,
    running,
    SIMULATED_ARM,
    wait_until,
)

ROOT = Path(__file__).resolve().parents[3]
REFERENCE = ROOT / 'docs' / 'reference'
MODULES = {
    'dynamics': DYNAMICS, 'dynamics_monitor': MONITOR, 'simulated_arm': SIMULATED_ARM,
    'mujoco_arm': MUJOCO_ARM}

# Topics and services that every rclpy node has, and those of which an action consists.
OF_RCLPY = re.compile(
    r'/(rosout|parameter_events)$|/(get|set|list|describe)_parameter|/set_parameters_atomically$|'
    r'/get_parameter_types$|/get_type_description$|/_action/')
PARAMETERS_OF_RCLPY = {'use_sim_time', 'start_type_description_service'}
OF_ARMS = {'publish_clock': True, 'rate': 20.0}
"""So that /clock exists, and takes little time."""
TYPES = {1: 'bool', 2: 'int', 3: 'double', 4: 'string', 8: 'double[]', 9: 'string[]'}


def table(page: str, heading: str) -> list[list[str]]:
    """Return the cells of the rows under `## heading`, code marks and links removed."""
    text = (REFERENCE / f'{page}.md').read_text(encoding='utf-8')
    lines = text.split(f'\n## {heading}\n')[1].split('\n## ')[0].splitlines()
    rows = [line for line in lines if line.startswith('|')][2:]
    return [[unescape(re.sub(r'^\[?`([^`]*)`.*', r'\1', cell.strip()))
             for cell in row.strip('|').split(' | ')] for row in rows]


def absolute(name: str, node: str) -> str:
    return name if name.startswith('/') else f'/{name}'.replace('/~', f'/{node}')


# --- the files -----------------------------------------------------------------------------------

@pytest.fixture(scope='module')
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the directory of the pages that the generator writes now."""
    directory = tmp_path_factory.mktemp('reference')
    done = children.run(
        [sys.executable, str(ROOT / 'docs' / 'site' / 'reference_pages.py'), str(directory)],
        env={**os.environ, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'OFF'},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0, done.stdout
    return directory


@pytest.mark.parametrize('page', [
    'topics', 'parameters', 'messages', 'diagnostics', 'executables'])
def test_a_page_is_what_scripts_reference_writes(written, page):
    new, old = ((directory / f'{page}.md').read_text(encoding='utf-8')
                for directory in (written, REFERENCE))
    if page == 'executables' and sys.version_info >= (3, 13):  # argparse prints options otherwise
        new, old = (' '.join(sorted(set(re.findall(r'--?[a-z][\w-]*', text))))
                    for text in (new, old))
    assert new == old, 'docs/reference is old: run scripts/reference'


def test_the_readme_is_short():
    assert (ROOT / 'README.md').read_text(encoding='utf-8').count('\n') <= 160


# --- the running nodes ---------------------------------------------------------------------------

@pytest.fixture(scope='module', autouse=True)
def nodes() -> Iterator[None]:
    pytest.importorskip('mujoco')
    with running(NodeProcess(DYNAMICS), NodeProcess(MONITOR), *(
            NodeProcess(arm, OF_ARMS) for arm in (SIMULATED_ARM, MUJOCO_ARM))):
        yield


@pytest.mark.parametrize('node', MODULES)
def test_topics_and_services(client, node):
    expected = {
        (absolute(name, node), kind, direction)
        for name, kind, direction, *_ in table('topics', f'Topics of `{node}`')}
    expected |= {(absolute(name, node), kind, 'service')
                 for name, kind, _ in table('topics', f'Services of `{node}`')}
    ask = {'out': client.node.get_publisher_names_and_types_by_node,
           'in': client.node.get_subscriber_names_and_types_by_node,
           'service': client.node.get_service_names_and_types_by_node}

    def running() -> set[tuple[str, str, str]]:
        try:
            return {
                (name, kind, direction) for direction, names in ask.items()
                for name, kinds in names(node, '/') for kind in kinds if not OF_RCLPY.search(name)}
        except RuntimeError:  # not discovered yet
            return set()

    wait_until(lambda: len(running()) >= len(expected), f'{len(expected)} topics of {node}')
    assert running() == expected


@pytest.mark.parametrize('node', MODULES)
def test_parameters(client, node):
    rows = {name: rest for name, *rest in table('parameters', f'`{node}`')}
    listed = client.call(ListParameters, f'/{node}/list_parameters').result.names
    assert set(listed) - PARAMETERS_OF_RCLPY == set(rows)
    for name, descriptor in client.describe_parameters(f'/{node}', list(rows)).items():
        kind, default, _, may_change, meaning = rows[name]
        value = client.get_parameter(f'/{node}', name)
        if name in OF_ARMS and node.endswith('_arm'):  # set by this test
            value = {'publish_clock': False, 'rate': 500.0}[name]
        shown = str(value).lower() if isinstance(value, bool) else (
            repr(value if isinstance(value, (str, int, float)) else list(value)))
        assert (kind, default, may_change, meaning) == (
            TYPES[descriptor.type], shown, 'no' if descriptor.read_only else 'yes',
            descriptor.description), name


@pytest.mark.parametrize('node', ['dynamics', 'dynamics_monitor'])
def test_statuses_and_their_values(client, node):
    text = (REFERENCE / 'diagnostics.md').read_text(encoding='utf-8')
    text = text.split(f'## `{node}`')[1].split('\n## ')[0]
    documented = {
        name: re.sub('JOINT|REASON|…', '.+', '|'.join(
            map(re.escape, re.findall('`([^`]*)`', values))))
        for name, values in re.findall(
            r'^\| `([^`]*)` \|.*\|(.*)\|$', text, re.MULTILINE)}

    def shown(message: DiagnosticArray) -> dict[str, Any]:
        prefix = f'/{node}: '
        return {one.name.removeprefix(prefix): one.values for one in message.status
                if one.name.startswith(prefix)}

    with client.collect(DiagnosticArray, '/diagnostics') as reports:
        found = shown(reports.wait_for(lambda message: len(shown(message)) > 3))
    assert set(found) == set(documented)
    for name, values in found.items():
        for value in values:
            assert re.fullmatch(documented[name], value.key), f'{name}: {value.key}'
