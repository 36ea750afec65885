# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The check of the joint order: changing subscribers of `~/commands`, on real nodes."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, ExitStack

import pytest
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.ros.dynamics.controller_order import ControllerOrder
from ros_harness import RosClient, wait_until
from silent_clients import NodelessReader
from std_msgs.msg import Float64MultiArray

NAMES = ['joint1', 'joint2']


class Commander:
    """A node that publishes commands, and checks its subscribers."""

    def __init__(self, client: RosClient, topic: str) -> None:
        self.faults: list[Fault] = []
        self.names = NAMES
        self.topic = topic
        self.publisher = client.node.create_publisher(Float64MultiArray, topic, 1)
        self.order = ControllerOrder(
            client.node, self.publisher, lambda: self.names, self.faults.append)

    @contextmanager
    def subscriber(self, name: str, joints: Sequence[str]) -> Iterator[None]:
        """Run a controller with the parameter `joints` until the context ends."""
        before = self.publisher.get_subscription_count()
        with RosClient(name, has_parameters=True) as controller:
            controller.node.declare_parameter('joints', list(joints))
            with controller.collect(Float64MultiArray, self.topic):
                wait_until(
                    lambda: self.publisher.get_subscription_count() > before, 'a subscriber')
                yield


@pytest.fixture
def commander(request: pytest.FixtureRequest) -> Iterator[Commander]:
    with RosClient('commander') as client:
        yield Commander(client, f'/{request.node.name}/commands')


def test_no_subscriber_or_the_same_order_opens_the_topic(commander):
    assert commander.order.allows()
    with commander.subscriber('controller', NAMES):
        wait_until(commander.order.allows, 'an order that is the same')
    assert commander.order.fault is None
    assert not commander.faults


def test_readers_without_joint_names_open_the_topic_and_let_controllers_be_checked(commander):
    with NodelessReader() as reader, RosClient('bridge') as bridge, \
            bridge.collect(Float64MultiArray, commander.topic):
        reader.subscribe(commander.topic)
        wait_until(lambda: commander.publisher.get_subscription_count() == 2, 'both readers')
        wait_until(commander.order.allows, 'the check of both readers')
        with commander.subscriber('controller', NAMES[::-1]):
            wait_until(lambda: bool(commander.faults), 'a fault')
            assert not commander.order.allows()
        wait_until(commander.order.allows, 'the end of the fault')
        with commander.subscriber('controller', []):
            wait_until(lambda: commander.order.allows() and all(
                one.is_checked for one in commander.order._subscribers.values()), 'its check')
    assert len(commander.faults) == 1


def test_another_order_closes_the_topic_until_its_subscriber_leaves(commander):
    with commander.subscriber('controller', NAMES[::-1]):
        wait_until(lambda: bool(commander.faults), 'a fault')
        assert not commander.order.allows()
        fault, = commander.faults
        assert (fault.name, fault.latched) == ('controller_order', True)
    wait_until(lambda: commander.order.fault is None, 'the end of the fault')
    assert commander.order.allows()


def test_a_newcomer_does_not_interrupt_a_command_and_is_checked(commander):
    with ExitStack() as stack:
        stack.enter_context(commander.subscriber('controller', NAMES))
        wait_until(lambda: commander.order.allows() and any(  # a reader without a name opens, too
            one.joints == NAMES for one in commander.order._subscribers.values()), 'its order')
        stack.enter_context(commander.subscriber('another', NAMES[::-1]))
        assert commander.order.allows()
        wait_until(lambda: bool(commander.faults), 'a fault')
        assert commander.faults[0].message.startswith('/another applies ')
        assert commander.order.allows()


def test_a_model_with_another_order_is_compared_with_known_controllers(commander):
    with commander.subscriber('controller', NAMES):
        wait_until(commander.order.allows, 'an order that is the same')
        commander.names = NAMES[::-1]
        assert not commander.order.allows()
        wait_until(lambda: bool(commander.faults), 'a fault')
        assert not commander.order.allows()
