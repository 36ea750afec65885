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

"""
The only module that uses members of rclpy beyond its documented interface.

Each function and class names the member, why the documented interface is not enough, and what is
used instead if an update of rclpy has no such member. The choice is made once, at construction.
`test/ros/test_rclpy_internals.py` reports the members that an update changes.
"""

from collections import deque
from collections.abc import Callable, Sequence
import functools
import importlib
import threading
from typing import Any

import rclpy
from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.guard_condition import GuardCondition
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.service import Service
from rclpy.subscription import Subscription

IMPLEMENTATION = 'rclpy.impl.implementation_singleton'
"""Module that has `rclpy_implementation`, the classes of rclpy that are written in C++."""
HANDLE = 'handle'
"""Property of publishers, subscriptions, services and contexts: the object in C++."""
PUBLISH_RAW = 'publish_raw'
SUBSCRIPTION_COUNT = 'get_subscription_count'
TAKE_MESSAGE = 'take_message'
TAKE_REQUEST = 'service_take_request'
WAIT_SET = 'WaitSet'
PARAMETER_OVERRIDES = '_parameter_overrides'
SEND_RESPONSE = 'send_response'
REQUEST_ID = 'request_id'

Taken = tuple[bytes, Any]
"""A serialized message, and the dictionary of its `received_timestamp` and further properties."""
_ABSENT = (AttributeError, ImportError, TypeError)
"""Errors of a member that is absent, or is constructed with other arguments."""


def _implementation(name: str) -> Any:
    """Return a class of `rclpy_implementation`; raise one of _ABSENT if there is none."""
    return getattr(importlib.import_module(IMPLEMENTATION).rclpy_implementation, name)


def _handle(entity: Any) -> Any:
    return getattr(entity, HANDLE)


def error_type(name: str) -> type[Exception]:
    """
    Return an exception class of `rclpy_implementation`.

    rclpy raises it, but exports it nowhere else. Fallback: RuntimeError, its base class.
    """
    try:
        found: type[Exception] = _implementation(name)
    except _ABSENT:
        return RuntimeError
    return found


RclError = error_type('RCLError')
"""A call of the C library has failed; the message has a trace through C files."""
UnknownArgumentsError = error_type('UnknownROSArgsError')
"""There are unknown arguments after `--ros-args`."""


# ---------------------------------------------------------------------- publishers

def raw_publish(publisher: Publisher) -> Callable[[bytes], None]:
    """
    Return a function that publishes a serialized message.

    It is `Publisher.handle.publish_raw`: the checks of `Publisher.publish` take as long as the
    call itself. Fallback: `Publisher.publish`, which takes bytes, too.
    """
    try:
        publish: Callable[[bytes], None] = getattr(_handle(publisher), PUBLISH_RAW)
    except _ABSENT:
        publish = publisher.publish
    return publish


def subscription_count(publisher: Publisher) -> Callable[[], int]:
    """
    Return a function that returns the number of subscribers of a publisher.

    It is `Publisher.handle.get_subscription_count`: the documented method of that name takes four
    times as long. Fallback: that method.
    """
    try:
        count: Callable[[], int] = getattr(_handle(publisher), SUBSCRIPTION_COUNT)
    except _ABSENT:
        count = publisher.get_subscription_count
    return count


# ---------------------------------------------------------------------- subscriptions

class _LeftToAThread(CallbackGroup):
    """Keeps an entity out of the wait set of every executor."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        pass


LEFT_TO_A_THREAD = _LeftToAThread()
"""The group of entities that a thread waits on by itself."""


def raw_take(subscription: Subscription, message_type: type) -> Callable[[], Taken | None]:
    """
    Return a function that takes the next message of a subscription, None if there is none.

    It is `Subscription.handle.take_message`: the documented interface takes one message per
    callback, also those that are outdated by then. Fallback: a function that returns None, so that
    the executor delivers every message.
    """
    try:
        return functools.partial(getattr(_handle(subscription), TAKE_MESSAGE), message_type, True)
    except _ABSENT:
        return lambda: None


class MessageInbox:
    """
    The messages of one topic, as bytes, for a thread that waits for them and takes them.

    It uses `WaitSet` of `rclpy_implementation`, `Subscription.handle.take_message` and
    `Context.handle`, as rclpy.wait_for_message does: an executor rebuilds its wait set from all
    entities of its nodes for each message, and runs a callback only after those before it.
    """

    subscription: Subscription
    """For its topic name and its number of publishers."""
    take: Callable[[], Taken | None]
    """Returns the next message and its properties, or None."""

    def __init__(
        self, node: Node, message_type: type, topic: str, qos: QoSProfile, can_wake: bool = False,
    ) -> None:
        """Subscribe; raise one of _ABSENT if rclpy lacks a member."""
        self._node = node
        self._wake = GuardCondition(lambda: None, None, context=node.context) if can_wake else None
        self.subscription = node.create_subscription(
            message_type, topic, lambda _: None, qos, raw=True, callback_group=LEFT_TO_A_THREAD)
        try:
            self._handle = _handle(self.subscription)
            self.take = functools.partial(getattr(self._handle, TAKE_MESSAGE), message_type, True)
            self._wake_handle = None if self._wake is None else _handle(self._wake)
            self._wait_set = _implementation(WAIT_SET)(
                1, int(can_wake), 0, 0, 0, 0, _handle(node.context))
        except _ABSENT:
            self.close()
            raise

    def wait(self, nanoseconds: int) -> bool:
        """Wait at most so long for a message or `wake`; return whether there is a message."""
        wait_set = self._wait_set
        wait_set.clear_entities()
        wait_set.add_subscription(self._handle)
        if self._wake_handle is not None:
            wait_set.add_guard_condition(self._wake_handle)
        wait_set.wait(nanoseconds)
        return bool(wait_set.get_ready_entities('subscription'))

    def wake(self) -> None:
        """End a wait, from another thread; needs `can_wake`."""
        if self._wake is not None:
            self._wake.trigger()

    def close(self) -> None:
        """End the subscription; no thread may wait any more."""
        self._node.destroy_subscription(self.subscription)


class SpunInbox(MessageInbox):
    """The fallback of `MessageInbox`: a hidden node whose executor runs in a thread."""

    def __init__(
        self, node: Node, message_type: type, topic: str, qos: QoSProfile, can_wake: bool = False,
    ) -> None:
        """Subscribe to what `topic` means to `node`."""
        self._waiting: deque[Taken] = deque(maxlen=qos.depth)
        self._news = threading.Condition()
        self._is_woken = self._ends = False
        self._helper = rclpy.create_node(
            f'_{node.get_name()}_inbox', namespace=node.get_namespace(), context=node.context,
            use_global_arguments=False, start_parameter_services=False, enable_rosout=False)
        self.subscription = self._helper.create_subscription(
            message_type, node.resolve_topic_name(topic), self._keep, qos, raw=True)
        self.take = self._take_kept
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(self._helper)
        self._thread = threading.Thread(target=self._spin, name='inbox', daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        while not self._ends and self._helper.context.ok():
            try:
                self._executor.spin_once(timeout_sec=0.1)
            except ExternalShutdownException:
                return

    def _keep(self, data: bytes, info: Any) -> None:
        with self._news:
            self._waiting.append((data, info))
            self._news.notify()

    def _take_kept(self) -> Taken | None:
        with self._news:
            return self._waiting.popleft() if self._waiting else None

    def wait(self, nanoseconds: int) -> bool:
        with self._news:
            self._news.wait_for(lambda: self._waiting or self._is_woken, 1e-9 * nanoseconds)
            self._is_woken = False
            return bool(self._waiting)

    def wake(self) -> None:
        with self._news:
            self._is_woken = True
            self._news.notify()

    def close(self) -> None:
        """End the subscription and its thread."""
        self._ends = True
        self._thread.join()
        self._executor.shutdown()
        self._helper.destroy_node()


def message_inbox(
    node: Node, message_type: type, topic: str, qos: QoSProfile, can_wake: bool = False,
) -> MessageInbox:
    """Subscribe to a topic; return what a thread takes its messages from."""
    try:
        return MessageInbox(node, message_type, topic, qos, can_wake)
    except _ABSENT:
        return SpunInbox(node, message_type, topic, qos, can_wake)


# ---------------------------------------------------------------------- services

class RequestInbox:
    """
    The requests of a service, for a thread that waits for them and takes them.

    It uses `WaitSet`, `Service.handle.service_take_request` and `Context.handle`: an executor
    takes a request only after the callbacks before it.
    """

    def __init__(self, service: Service, srv_type: Any, context: Context) -> None:
        """Take the requests of a service; raise one of _ABSENT if rclpy lacks a member."""
        self._handle = _handle(service)
        self.take: Callable[[], tuple[Any, Any]] = functools.partial(
            getattr(self._handle, TAKE_REQUEST), srv_type.Request)
        """Returns a request and its header; both are None if there is no request."""
        self._wait_set = _implementation(WAIT_SET)(0, 0, 0, 0, 1, 0, _handle(context))

    def wait(self, nanoseconds: int) -> bool:
        """Wait at most so long; return whether there is a request."""
        wait_set = self._wait_set
        wait_set.clear_entities()
        wait_set.add_service(self._handle)
        wait_set.wait(nanoseconds)
        return bool(wait_set.get_ready_entities('service'))


def service_with_inbox(
    node: Node, srv_type: Any, name: str, callback: Callable[[Any, Any], Any],
) -> tuple[Service, RequestInbox | None]:
    """
    Create a service; return it and what a thread takes its requests from.

    Fallback: a service that the executor calls back, in a group of its own, and None.
    """
    service = node.create_service(srv_type, name, callback, callback_group=LEFT_TO_A_THREAD)
    try:
        return service, RequestInbox(service, srv_type, node.context)
    except _ABSENT:
        node.destroy_service(service)
        group = MutuallyExclusiveCallbackGroup()
        return node.create_service(srv_type, name, callback, callback_group=group), None


def replace_send_response(service: Service, send: Callable[[Any, Any], None]) -> None:
    """
    Let the executor send the responses of a service by `send`, which gets message and header.

    It sets the attribute `send_response` of the service, which executors call: the documented
    interface sends a response as soon as the callback returns, and loses those whose client is
    not discovered yet. Fallback: the executor sends responses itself.
    """
    if hasattr(service, SEND_RESPONSE):
        setattr(service, SEND_RESPONSE, send)


def send_response(service: Service, message: Any, header: Any) -> None:
    """Send a response by the method that `replace_send_response` has replaced."""
    type(service).send_response(service, message, header)


def request_number(header: Any) -> int | None:
    """
    Return the number of a request among those of its client.

    It is `request_id.sequence_number` of the header that executors pass on; the documented
    interface does not name the request. Fallback: None.
    """
    number = getattr(getattr(header, REQUEST_ID, None), 'sequence_number', None)
    return None if number is None else int(number)


# ---------------------------------------------------------------------- parameters

def parameter_overrides(node: Node) -> Sequence[str]:
    """
    Return the names of all parameters that are set at the start.

    They are in `Node._parameter_overrides`; the documented interface names only those that are
    declared. Fallback: none, so that nobody is warned of an unknown name.
    """
    return list(getattr(node, PARAMETER_OVERRIDES, ()))
