# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The policy in config/security matches the running nodes; without keys no node starts."""

from collections.abc import Iterator
from pathlib import Path
import re
from typing import Any
from xml.etree import ElementTree

import pytest
from ros_harness import (
    DYNAMICS,
    log_of_failed_start,
    MONITOR,
    NodeProcess,
    SIMULATED_ARM,
    wait_until,
)

ROOT = Path(__file__).parents[3]
POLICY = ROOT / 'config' / 'security' / 'robot_dynamics.policy.xml'
NODES = {'dynamics': DYNAMICS, 'dynamics_monitor': MONITOR, 'simulated_arm': SIMULATED_ARM}
FILES = ('identity_ca.cert.pem', 'cert.pem', 'key.pem', 'permissions_ca.cert.pem',
         'governance.p7s', 'permissions.p7s')
"""What a complete enclave consists of."""
WITH_DRIVES = {'/dynamics/feed_forward'}
"""Subscribed by simulated_arm instead of effort_command."""
WITH_MARKERS = {'/effort_command'}
"""Subscribed by dynamics_monitor while there are subscribers of markers."""


def allowed(node: str, kind: str) -> set[str]:
    """Return the full names that the policy allows a node to publish, subscribe or reply to."""
    profile = ElementTree.parse(POLICY).find(
        f".//enclave[@path='/robot_dynamics/{node}']/profiles/profile")
    assert profile.attrib == {'ns': '/', 'node': node}
    names = [entry.text or '' for group in profile for entry in group
             if group.attrib == {kind: 'ALLOW'}]
    assert len(names) == len(set(names))
    return {name if name.startswith('/') else f'/{name}'.replace('/~', f'/{node}')
            for name in names}


@pytest.fixture(scope='module', autouse=True)
def nodes() -> Iterator[None]:
    """Run the nodes with all topics that parameters can add."""
    with NodeProcess(DYNAMICS, {'use_sim_time': True}), \
            NodeProcess(MONITOR, {'use_sim_time': True}), \
            NodeProcess(SIMULATED_ARM, {'publish_clock': True}):
        yield


@pytest.mark.parametrize('kind', ['publish', 'subscribe', 'reply', 'request'])
@pytest.mark.parametrize('node', NODES)
def test_the_policy_is_that_of_the_running_node(client, node, kind):
    ask: Any = {
        'publish': client.node.get_publisher_names_and_types_by_node,
        'subscribe': client.node.get_subscriber_names_and_types_by_node,
        'reply': client.node.get_service_names_and_types_by_node,
        'request': client.node.get_client_names_and_types_by_node}[kind]
    expected = allowed(node, kind)
    if (node, kind) == ('simulated_arm', 'subscribe'):
        expected -= WITH_DRIVES
    if (node, kind) == ('dynamics_monitor', 'subscribe'):
        expected -= WITH_MARKERS

    def running() -> set[str]:
        try:
            return {name for name, _ in ask(node, '/') if '/_action/' not in name}
        except RuntimeError:  # not discovered yet
            return set()

    wait_until(lambda: len(running()) >= len(expected), f'all that {node} has to {kind}')
    assert running() == expected


def test_the_policy_allows_the_action_of_the_running_node(client):
    (expected,) = allowed('dynamics', 'execute')
    ask = client.node.get_service_names_and_types_by_node
    wait_until(lambda: f'{expected}/_action/send_goal' in dict(ask('dynamics', '/')), 'the action')


def test_the_policy_allows_drives_no_other_nodes_and_one_controller():
    assert allowed('simulated_arm', 'subscribe') > WITH_DRIVES
    profiles = ElementTree.parse(POLICY).findall('.//profile')
    assert [node for node in (profile.get('node') for profile in profiles)
            if node != '_dynamics_monitor_requests'] == list(NODES)
    assert [node for node in NODES if '/effort_command' in allowed(node, 'publish')] == [
        'dynamics']


def test_the_page_lists_what_moves_the_arm():
    page = (ROOT / 'docs' / 'security.md').read_text(encoding='utf-8').partition('## Limits')[0]
    harmless = re.compile('.*/(get|describe|list|inverse|forward|manipulator|retime|task)_.*')
    names = [name for kind in ('subscribe', 'reply', 'execute')
             for name in allowed('dynamics', kind) if not harmless.match(name)]
    assert len(names) == 15
    for name in names:
        name = name.replace('/dynamics/', '~/') if name != '/clock' else name
        assert f'`{name.removeprefix("/")}`' in page or f'`{name}`' in page, name


@pytest.mark.parametrize('files', [(), FILES], ids=['missing', 'invalid'])
def test_a_node_without_the_required_security_ends(tmp_path, files):
    """No node starts unprotected: a node ends if keys are missing or invalid."""
    enclave = tmp_path / 'enclaves' / 'arm'
    enclave.mkdir(parents=True)
    for name in files:
        (enclave / name).touch()
    log = log_of_failed_start(
        DYNAMICS, arguments=('--ros-args', '--enclave', '/arm'), environment={
            'ROS_SECURITY_ENABLE': 'true', 'ROS_SECURITY_STRATEGY': 'Enforce',
            'ROS_SECURITY_KEYSTORE': str(tmp_path)})
    assert re.search('SECURITY|security', log), log
