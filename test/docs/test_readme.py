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

"""The README's tables name exactly what the running nodes have; its files and tests exist."""

from collections.abc import Iterator
from html import unescape
from pathlib import Path
import re

import pytest
from rcl_interfaces.srv import ListParameters
from ros_harness import DYNAMICS, NodeProcess, RosClient, SIMULATED_ARM, wait_until

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / 'README.md').read_text(encoding='utf-8')
MODULES = {'dynamics': DYNAMICS, 'simulated_arm': SIMULATED_ARM}

# What every rclpy node has, and no reader of the README asks for.
OF_RCLPY = re.compile(
    r'/(rosout|parameter_events)$|/(get|set|list|describe)_parameter|/set_parameters_atomically$|'
    r'/get_parameter_types$|/get_type_description$')
PARAMETERS_OF_RCLPY = {'use_sim_time', 'start_type_description_service'}
TYPES = {1: 'bool', 2: 'int', 3: 'double', 4: 'string', 8: 'double[]', 9: 'string[]'}


def table(section: str, node: str) -> list[list[str]]:
    """Return the cells of the rows under `## section` / `### node`, code marks removed."""
    chapter = README.split(f'\n## {section}\n')[1].split('\n## ')[0]
    lines = chapter.split(f'\n### `{node}`\n')[1].split('\n### ')[0].splitlines()
    rows = [line for line in lines if line.startswith('|')][2:]
    return [
        [unescape(cell.strip().strip('`')) for cell in row.strip('|').split('|')] for row in rows]


def absolute(name: str, node: str) -> str:
    return name if name.startswith('/') else f'/{name}'.replace('/~', f'/{node}')


@pytest.fixture(scope='module', autouse=True)
def nodes() -> Iterator[None]:
    with NodeProcess(DYNAMICS, patient=False), NodeProcess(SIMULATED_ARM, {'publish_clock': True}):
        yield


@pytest.mark.parametrize('node', MODULES)
def test_topics(client: RosClient, node: str) -> None:
    expected = {
        (absolute(name, node), kind, direction)
        for name, kind, direction, _ in table('Topics', node)}

    def running() -> set[tuple[str, str, str]]:
        try:
            out = client.node.get_publisher_names_and_types_by_node(node, '/')
            incoming = client.node.get_subscriber_names_and_types_by_node(node, '/')
        except RuntimeError:  # not discovered yet
            return set()
        return {
            (name, kind, direction)
            for names, direction in ((out, 'out'), (incoming, 'in'))
            for name, kinds in names for kind in kinds if not OF_RCLPY.search(name)}

    wait_until(lambda: len(running()) >= len(expected), f'{len(expected)} topics of {node}')
    assert running() == expected


@pytest.mark.parametrize('node', MODULES)
def test_services(client: RosClient, node: str) -> None:
    expected = {(absolute(name, node), kind) for name, kind, _ in table('Services', node)}

    def running() -> set[tuple[str, str]]:
        try:
            services = client.node.get_service_names_and_types_by_node(node, '/')
        except RuntimeError:
            return set()
        return {
            (name, kind) for name, kinds in services for kind in kinds
            if not OF_RCLPY.search(name)}

    wait_until(lambda: len(running()) >= len(expected), f'{len(expected)} services of {node}')
    assert running() == expected


@pytest.mark.parametrize('node', MODULES)
def test_parameters(client: RosClient, node: str) -> None:
    rows = {name: rest for name, *rest in table('Parameters', node)}
    listed = client.call(ListParameters, f'/{node}/list_parameters').result.names
    assert set(listed) - PARAMETERS_OF_RCLPY == set(rows)
    for name, descriptor in client.describe_parameters(f'/{node}', list(rows)).items():
        kind, default, may_change, meaning = rows[name]
        value = client.get_parameter(f'/{node}', name)
        if name == 'publish_clock':  # set by this test, to see /clock
            value = not value
        shown = str(value).lower() if isinstance(value, bool) else (
            repr(value if isinstance(value, (str, int, float)) else list(value)))
        assert (kind, default, may_change, meaning) == (
            TYPES[descriptor.type], shown, 'no' if descriptor.read_only else 'yes',
            descriptor.description), name


def test_links_lead_to_files() -> None:
    pages = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *(ROOT / 'docs').glob('*.md')]
    for page in pages:
        for target in re.findall(r'\]\(([^)#]+)', page.read_text(encoding='utf-8')):
            if not target.startswith('http'):
                assert (page.parent / target).exists(), f'{page.name}: {target}'
