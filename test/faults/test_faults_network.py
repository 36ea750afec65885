# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Network faults: incompatible quality of service."""

from fault_bench import Driver
from fault_table import fault, fault_cases
import pytest
from rclpy.duration import Duration, Infinite
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from ros_harness import LATCHED, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import String

pytestmark = pytest.mark.usefixtures('holding')
GROUP = 'Network and quality of service'
SECOND = Duration(seconds=1)
VISIBLE = ('the log names the incompatible policy, /diagnostics warns and counts; other '
           'subscribers still get commands')
PROMISING = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE,
    deadline=SECOND, liveliness=LivelinessPolicy.AUTOMATIC,
    liveliness_lease_duration=SECOND)


# --- subscribers that request more than is offered ----------------------------------------------

@fault_cases(
    ('policy', 'qos'), GROUP, 'a subscriber to `effort_command` that requests {}', VISIBLE, (
        ('transient local', 'DURABILITY', LATCHED),
        ('a deadline', 'DEADLINE', QoSProfile(depth=1, deadline=SECOND))))
def test_a_subscriber_that_requests_too_much(bench, policy, qos):
    key = 'incompatible subscribers of effort_command'
    before = bench.figure('command', key)
    node, got = bench.client.node, []
    subscription = node.create_subscription(
        JointState, f'{bench.namespace}/effort_command', got.append, qos)
    try:
        line = bench.node.wait_for_log(
            f'Incompatible QoS: a subscriber of effort_command requests a different {policy}')
        assert '[WARN]' in line
        status = bench.wait_figure('command', key, before + 1)
        assert status.message.startswith('a subscriber of ')
        bench.check_alive()
        assert not got
    finally:
        node.destroy_subscription(subscription)


# --- publishers ----------------------------------------------------------------------------------

@fault(GROUP, 'a volatile publisher of `robot_description`',
       'the log names the incompatible policy; the active model stays')
def test_a_volatile_description(bench):
    publisher = bench.client.node.create_publisher(
        String, f'{bench.namespace}/robot_description', 1)
    try:
        line = bench.node.wait_for_log('offering incompatible QoS.*DURABILITY')
        assert '[WARN]' in line
        assert 'robot_description' in line
        bench.check_alive()
    finally:
        bench.client.node.destroy_publisher(publisher)


@fault(GROUP, 'a publisher of `joint_states`: best effort, with a deadline and a lease',
       'its states are answered')
def test_any_publisher_of_states(bench):
    """The node requests no policy that a publisher might not offer, so it receives all."""
    topic = f'{bench.namespace}/joint_states'
    requested = bench.client.node.get_subscriptions_info_by_topic(topic)[0].qos_profile
    assert requested.reliability is ReliabilityPolicy.BEST_EFFORT
    assert requested.durability is DurabilityPolicy.VOLATILE
    assert requested.deadline == requested.liveliness_lease_duration == Infinite
    bench.driver.be_quiet()
    bench.wait_state_timeout()
    other = Driver(bench.client, topic, qos=PROMISING).start()
    try:
        bench.wait_running()
    finally:
        other.close()
    wait_until(lambda: bench.client.node.count_publishers(topic) == 1, 'the end of the other')
