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

"""Faults of the network: qualities of service that do not fit, and a link that breaks."""

from collections.abc import Iterator
import json
import subprocess
import sys
from typing import Any

import children
from fault_bench import Driver, fault_bench, FaultBench
from fault_table import fault
import partition_scenario
import pytest
from rclpy.duration import Duration, Infinite
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from ros_harness import LATCHED, RosClient, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import String

GROUP = 'Networks and qualities of service'
SECOND = Duration(seconds=1)
VISIBLE = ('the log says which policy does not fit, /diagnostics warns and counts; others get '
           'efforts as ever')
PROMISING = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE,
    deadline=SECOND, liveliness=LivelinessPolicy.AUTOMATIC,
    liveliness_lease_duration=SECOND)


@pytest.fixture(scope='module')
def bench(client: RosClient) -> Iterator[FaultBench]:
    """Return a node that commands gravity compensation."""
    with fault_bench(client, '/faults_network') as one:
        yield one


# --- subscribers that ask for more than is offered ----------------------------------------------

@pytest.mark.parametrize(('policy', 'qos'), [
    pytest.param(policy, qos, marks=fault(GROUP, f'a subscriber of {words}', VISIBLE))
    for policy, qos, words in (
        ('DURABILITY', LATCHED, '`effort_command` that asks for transient local'),
        ('DEADLINE', QoSProfile(depth=1, deadline=SECOND),
         '`effort_command` that asks for a deadline'))])
def test_a_subscriber_that_asks_for_too_much(
    bench: FaultBench, policy: str, qos: QoSProfile,
) -> None:
    bench.check_alive()
    key = 'incompatible subscribers of effort_command'
    before = bench.figure('command', key)
    node, got = bench.client.node, []
    subscription = node.create_subscription(
        JointState, f'{bench.namespace}/effort_command', got.append, qos)
    try:
        line = bench.node.wait_for_log(f'A subscriber of effort_command gets nothing.*{policy}')
        assert '[WARN]' in line
        status = bench.wait_status('command', lambda status: any(
            value.key == key and int(value.value) > before for value in status.values))
        assert status.message == 'a subscriber asks for a QoS that is not offered'
        bench.check_alive()
        assert not got
    finally:
        node.destroy_subscription(subscription)


# --- publishers ----------------------------------------------------------------------------------

@fault(GROUP, 'a publisher of `robot_description` that is volatile',
       'the log says which policy does not fit; the model in use stays')
def test_a_volatile_description(bench: FaultBench) -> None:
    bench.check_alive()
    publisher = bench.client.node.create_publisher(
        String, f'{bench.namespace}/robot_description', 1)
    try:
        line = bench.node.wait_for_log('offering incompatible QoS.*DURABILITY')
        assert '[WARN]' in line
        assert 'robot_description' in line
        bench.check_alive()
    finally:
        bench.client.node.destroy_publisher(publisher)


@pytest.mark.parametrize('qos', [
    pytest.param(qos, marks=fault(
        GROUP, f'a publisher of `joint_states` that is {words}', 'its states are answered'))
    for qos, words in (
        (QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT), 'best effort'),
        (QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE), 'reliable'),
        (LATCHED, 'reliable and transient local'),
        (PROMISING, 'best effort, with a deadline and a lease'))])
def test_any_publisher_of_states(bench: FaultBench, qos: QoSProfile) -> None:
    """The node requests nothing that a publisher might not offer, so that none is unheard."""
    bench.check_alive()
    topic = f'{bench.namespace}/joint_states'
    requested = bench.client.node.get_subscriptions_info_by_topic(topic)[0].qos_profile
    assert requested.reliability is ReliabilityPolicy.BEST_EFFORT
    assert requested.durability is DurabilityPolicy.VOLATILE
    assert requested.deadline == requested.liveliness_lease_duration == Infinite
    bench.driver.be_quiet()
    bench.wait_state_timeout()
    other = Driver(bench.client, topic, qos=qos).start()
    try:
        bench.wait_running()
    finally:
        other.close()
    wait_until(lambda: bench.client.node.count_publishers(topic) == 1, 'the end of the other')
    bench.check_alive()


# --- partition -----------------------------------------------------------------------------------

@fault(GROUP, 'a network partition and its healing, between driver and node in two network '
       'namespaces: until efforts have ended, and until each has forgotten the other',
       'the fault action begins after `state_timeout`, and is told; back by itself')
def test_a_partition(seen: Any) -> None:
    command, reason = partition_scenario.own_network()
    if reason:
        pytest.skip(reason)
    done = children.run(
        [*command, sys.executable, partition_scenario.__file__], text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300.0)
    assert done.returncode == 0, done.stdout
    for times in json.loads(done.stdout.splitlines()[-1]):
        seen(f'told {times["told"]:.2f} s after the link broke; back {times["back"]:.2f} s after '
             f'it healed, {times["broken"]:.1f} s later')
