# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Members of rclpy beyond its documented interface that this package uses, and their fallbacks.

A test of a member fails if an update of rclpy has changed it; its message names what is affected.
A test of a fallback gives the adapter a name that rclpy does not have, and asks real nodes.
Only one module of the package uses members of rclpy that are not documented.
"""

import ast
from collections.abc import Callable, Iterator
import functools
import inspect
from pathlib import Path
import re
import time
from typing import Any

from own_process import own_process, OwnProcess, stamps_of
import pytest
from rcl_interfaces.srv import ListParameters
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
import robot_dynamics
from robot_dynamics.ros.dynamics.node import DynamicsNode
from robot_dynamics.ros.middleware import rclpy_internals
from robot_dynamics.ros.middleware.answer_delivery import is_discovered
from robot_dynamics.ros.middleware.guarded_callbacks import GuardedCallbacks
from robot_dynamics.ros.simulated_arm.node import SimulatedArmNode
from ros_harness import RosClient, TIMEOUT, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

SECOND = 1_000_000_000
ATTRIBUTES = ('PARAMETER_OVERRIDES', 'SEND_RESPONSE', 'CALLBACK', 'REQUEST_ID')


@pytest.fixture
def process() -> Iterator[OwnProcess]:
    with own_process() as process:
        yield process


def is_bound_to(function: Any, entity: Any, name: str) -> bool:
    """Tell whether this is the method of that name of the C++ object of an entity."""
    function = getattr(function, 'func', function)  # of a partial
    return function.__name__ == name and function.__self__ is entity.handle


def repeat_until(act: Callable[[], object], is_done: Callable[[], bool]) -> None:
    """Repeat an action every 50 ms until it has had an effect; fail in the end."""
    deadline = time.monotonic() + TIMEOUT
    while not is_done():
        assert time.monotonic() < deadline, f'no effect in {TIMEOUT:g} s'
        act()
        time.sleep(0.05)


# ---------------------------------------------------------------------- members

def test_publish_raw_and_get_subscription_count(client):
    publisher = client.node.create_publisher(String, 'raw_publish', 1)
    publish = rclpy_internals.raw_publish(publisher)
    count = rclpy_internals.subscription_count(publisher)
    assert is_bound_to(publish, publisher, 'publish_raw'), (
        'rclpy has no Publisher.handle.publish_raw any more: commands are published by '
        'Publisher.publish, which takes longer')
    assert is_bound_to(count, publisher, 'get_subscription_count'), (
        'rclpy has no Publisher.handle.get_subscription_count any more: the control path counts '
        'subscribers by Publisher.get_subscription_count, which takes four times as long')
    assert count() == 0
    with client.collect(String, 'raw_publish') as received:
        message = serialize_message(String(data='bytes'))
        repeat_until(lambda: publish(message), lambda: bool(received.messages))
        assert count() == 1
        assert received.messages[0].data == 'bytes', (
            'Publisher.handle.publish_raw does not publish bytes as they are any more')


def test_wait_set_and_take_message(client):
    inbox = rclpy_internals.message_inbox(client.node, String, 'wait_set', QoSProfile(depth=5))
    assert type(inbox) is rclpy_internals.MessageInbox, (
        'rclpy_implementation.WaitSet, Subscription.handle.take_message or Context.handle is '
        'gone, or takes other arguments: joint states go through an executor of rclpy')
    exchange_messages(client, inbox)
    inbox.close()


def exchange_messages(client: RosClient, inbox: rclpy_internals.MessageInbox) -> None:
    """Send three messages to an inbox, and take them."""
    publisher = client.publisher(String, inbox.subscription.topic_name)
    assert inbox.take() is None
    inbox.wait(0)
    assert inbox.take() is None
    found: dict[str, None] = {}

    def take_all() -> bool:
        inbox.wait(SECOND // 10)
        while (taken := inbox.take()) is not None:
            data, info = taken
            found[deserialize_message(data, String).data] = None
            assert info['received_timestamp'] > 0
            assert 'publication_sequence_number' in info
        return word in found

    for word in ('one', 'two', 'three'):
        repeat_until(
            lambda: publisher.publish(String(data=word)),  # noqa: B023 (called in this turn)
            take_all)
    assert list(found) == ['one', 'two', 'three']


@pytest.mark.parametrize('executor', [SingleThreadedExecutor, MultiThreadedExecutor])
def test_executors_ask_callback_groups(client, process, executor):
    node, stolen, seen = process.other('asking'), list[Any](), list[Any]()
    topic = f'{process.namespace}/topic'
    node.create_subscription(
        String, topic, stolen.append, 5, callback_group=rclpy_internals.LEFT_TO_A_THREAD)
    node.create_subscription(String, topic, seen.append, 5)
    with process.spun(executor):
        publisher = client.publisher(String, topic, subscribers=2)
        repeat_until(lambda: publisher.publish(String()), lambda: len(seen) >= 3)
    assert not stolen, (
        f'{executor.__name__} does not ask CallbackGroup.can_execute any more: it takes the '
        'messages that a thread of this package waits for')


def test_service_take_request_and_send_response(client, process):
    name = f'{process.namespace}/service'
    requests = rclpy_internals.service_with_inbox(
        process.other('server'), Trigger, name, lambda *_: None)
    assert requests is not None, (
        'rclpy_implementation.WaitSet, Service.handle.service_take_request or Context.handle is '
        'gone: ~/stop waits until the executor is free')
    trigger = client.node.create_client(Trigger, name)
    assert trigger.wait_for_service(60.0)
    future = trigger.call_async(Trigger.Request())
    requests.wait(60 * SECOND)
    request, header = requests.take()
    assert isinstance(request, Trigger.Request)
    assert rclpy_internals.request_number(header) == 1, (
        'the header of a request has no request_id.sequence_number any more: every response '
        'asks the graph whether its client is discovered')
    wait_until(
        lambda: is_discovered(process.nodes[0], requests.service), 'the reader of the response')
    rclpy_internals.send_response(requests.service, Trigger.Response(message='taken'), header)
    wait_until(future.done, 'the response')
    assert future.result().message == 'taken'
    assert requests.take() == (None, None)


def test_executors_call_the_replaced_send_response(client, process):
    name, sent = f'{process.namespace}/replaced', list[Any]()
    service = process.other('server').create_service(Trigger, name, lambda _, answer: answer)

    def send(message: Any, header: Any) -> None:
        sent.append(rclpy_internals.request_number(header))
        rclpy_internals.send_response(service, message, header)

    rclpy_internals.replace_send_response(service, send)
    with process.spun(SingleThreadedExecutor):
        client.call(Trigger, name)
    assert sent == [1], (
        'executors do not call the attribute send_response of a service any more: responses to '
        'clients that are not discovered yet are lost')


def test_executors_call_the_replaced_callback(client, process):
    node, replaced = process.other('wrapped'), list[str]()

    def wrap(srv_type: Any, name: str, callback: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(callback)
        def call(request: Any, response: Any) -> Any:
            replaced.append(name)
            return callback(request, response)

        return call

    assert all(rclpy_internals.replace_callback(service, wrap) for service in node.services), (
        'services of rclpy have no attribute callback any more: an error in a service of the '
        'lifecycle ends the node')
    assert not any(rclpy_internals.replace_callback(service, wrap) for service in node.services)
    with process.spun(SingleThreadedExecutor):
        name = f'{process.namespace}/wrapped/list_parameters'
        assert client.call(ListParameters, name).result.names
    assert [name.split('/')[-1] for name in replaced] == ['list_parameters'], (
        'executors do not call the attribute callback any more')


def test_parameter_overrides(process):
    node = Node('overridden', context=process.context, parameter_overrides=[
        Parameter('unknown', value=1)])
    assert rclpy_internals.parameter_overrides(process.add(node)) == ['unknown'], (
        'rclpy has no Node._parameter_overrides any more: no warning names a parameter that is '
        'set, but not declared')


@pytest.mark.parametrize('name', ['RCLError', 'UnknownROSArgsError'])
def test_errors(name):
    assert rclpy_internals.error_type(name).__name__ == name, (
        f'rclpy_implementation.{name} is gone: any RuntimeError at the start is handled as one')
    assert issubclass(rclpy_internals.error_type(name), RuntimeError)
    assert rclpy_internals.error_type('NoSuchError') is RuntimeError


# ---------------------------------------------------------------------- fallbacks

@pytest.mark.parametrize(('name', 'value'), [
    ('IMPLEMENTATION', 'no_such_module'), ('HANDLE', 'no_such_member'),
    ('MEMBERS', {'WaitSet': ('no_such_member',)}),
    ('MEMBERS', {'NoSuchClass': ('take_message',)})])
def test_without_members_joint_states_are_answered(client, process, monkeypatch, name, value):
    monkeypatch.setattr(rclpy_internals, name, value)
    for attribute in ATTRIBUTES:
        monkeypatch.setattr(rclpy_internals, attribute, 'no_such_member')
    process.simulated_arm(lock_step=True, real_time_factor=0.1)  # a step for each effort taken
    name = process.dynamics(lock_step=True).get_fully_qualified_name()
    with process.spun(SingleThreadedExecutor):
        with client.collect(JointState, f'{name}/gravity_compensation') as answers:
            wait_until(lambda: len(set(stamps_of(answers))) >= 20, 'answers to 20 joint states')
        assert client.call(Trigger, f'{name}/stop').success
        assert client.call(ListParameters, f'{name}/list_parameters').result.names


PACKAGE = Path(robot_dynamics.__file__).parent
IMPLEMENTATION_MODULE = re.compile(r'rclpy\.(impl\b|_)')
PRIVATE = re.compile('_[a-z]')
UNDOCUMENTED = {
    'handle', 'publish_raw', 'take_message', 'service_take_request', 'take_response',
    'send_response', 'callback', 'srv_type', 'request_id', 'get_ready_entities',
    'rclpy_implementation'}


def undocumented(tree: ast.Module) -> list[str]:
    """Return the uses of members of rclpy that are not documented."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and IMPLEMENTATION_MODULE.match(node.module or ''):
            found.append(f'line {node.lineno}: from {node.module}')
        elif isinstance(node, ast.Import):
            found += [f'line {node.lineno}: import {name.name}' for name in node.names
                      if IMPLEMENTATION_MODULE.match(name.name)]
        elif isinstance(node, ast.Attribute) and (
                node.attr in UNDOCUMENTED
                or PRIVATE.match(node.attr) and not is_own(node.value)):
            found.append(f'line {node.lineno}: .{node.attr}')
    return found


def is_own(value: ast.expr) -> bool:
    return isinstance(value, ast.Name) and value.id in ('self', 'cls')


def test_no_other_module_uses_undocumented_members():
    modules = [path for path in sorted(PACKAGE.rglob('*.py')) if path.name != 'rclpy_internals.py'
               and re.search(r'^\s*(import|from) rclpy\b', path.read_text('utf-8'), re.MULTILINE)]
    assert len(modules) > 20
    uses = {str(path.relative_to(PACKAGE)): undocumented(ast.parse(path.read_text('utf-8')))
            for path in modules}
    assert {path: found for path, found in uses.items() if found} == {}, (
        'move these to ros/middleware/rclpy_internals.py, with a fallback and a test')


def test_nodes_name_none_of_their_attributes_as_rclpy_does():
    with own_process() as process:
        bare = process.add(LifecycleNode('bare', context=process.context))
        of_rclpy = {name for name in dir(bare) if PRIVATE.match(name)}
    own = set()
    for kind in (DynamicsNode, SimulatedArmNode, GuardedCallbacks):
        own |= set(re.findall(r'self\.(_[a-z]\w*)', inspect.getsource(kind)))
    assert len(own) > 20
    assert own & of_rclpy == set()
