# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The only module that uses members of rclpy beyond its documented interface.

Each function and class names the member, why the documented interface is not enough, and what is
used instead if an update of rclpy has no such member. The choice is made once, at construction.
`test/ros/test_rclpy_internals.py` reports the members that an update changes.
"""

from collections.abc import Callable, Sequence
import functools
import importlib
from typing import Any

from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from rclpy.context import Context
from rclpy.guard_condition import GuardCondition
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.service import Service
from rclpy.subscription import Subscription
from robot_dynamics.ros.middleware.spun_inbox import SpunInbox, Taken

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
CALLBACK = 'callback'
REQUEST_ID = 'request_id'

_ABSENT = (AttributeError, ImportError, TypeError)
"""Errors of a member that is absent, or is constructed with other arguments."""


def _implementation(name: str) -> Any:
    """Return a class of `rclpy_implementation`; raise one of _ABSENT if it is absent."""
    return getattr(importlib.import_module(IMPLEMENTATION).rclpy_implementation, name)


def _handle(entity: Any) -> Any:
    return getattr(entity, HANDLE)


def _wait_set(context: Context, entity: str, method: str, *counts: int) -> Any:
    """
    Return a wait set; raise one of _ABSENT without it, or if the class `entity` lacks a method.

    It comes before the entity: other processes may keep an entity that is destroyed at once.
    """
    getattr(_implementation(entity), method)
    return _implementation(WAIT_SET)(*counts, _handle(context))


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
"""The group of entities that only a thread of this package waits on."""


class MessageInbox:
    """
    The messages of one topic, as bytes, for a thread that waits for them and takes them.

    It uses `WaitSet` of `rclpy_implementation`, `Subscription.handle.take_message` and
    `Context.handle`, as rclpy.wait_for_message does: an executor rebuilds its wait set from all
    entities of its nodes for each message, and runs a callback only after those before it.
    """

    def __init__(
        self, node: Node, message_type: type, topic: str, qos: QoSProfile, can_wake: bool = False,
    ) -> None:
        """Subscribe; raise one of _ABSENT if rclpy lacks a member."""
        self._node = node
        self._wait_set = _wait_set(
            node.context, 'Subscription', TAKE_MESSAGE, 1, int(can_wake), 0, 0, 0, 0)
        self._wake = GuardCondition(lambda: None, None, context=node.context) if can_wake else None
        self.subscription: Subscription = node.create_subscription(
            message_type, topic, lambda _: None, qos, raw=True, callback_group=LEFT_TO_A_THREAD)
        """For its topic name and its number of publishers."""
        handle = _handle(self.subscription)
        self.take: Callable[[], Taken | None] = functools.partial(
            getattr(handle, TAKE_MESSAGE), message_type, True)
        """Returns the next message and its properties, or None."""
        self.wait = _wait_for(self._wait_set, handle, self._wake)
        """Waits at most so long [ns] for a message or `wake`."""

    def is_ready(self) -> bool:
        """Return whether the last wait ended with a message."""
        return bool(self._wait_set.get_ready_entities('subscription'))

    def wake(self) -> None:
        """End a wait, from another thread; needs `can_wake`."""
        if self._wake is not None:
            self._wake.trigger()

    def close(self) -> None:
        """End the subscription; no thread may wait any more."""
        self._node.destroy_subscription(self.subscription)


def _wait_for(
    wait_set: Any, subscription: Any, wake: GuardCondition | None,
) -> Callable[[int], None]:
    """Return a function that waits; its names are looked up here, and not for each message."""
    clear, add_subscription, wait_ns = (
        wait_set.clear_entities, wait_set.add_subscription, wait_set.wait)

    def wait(nanoseconds: int) -> None:
        clear()
        add_subscription(subscription)
        wait_ns(nanoseconds)

    if wake is None:
        return wait
    guard, add_guard = _handle(wake), wait_set.add_guard_condition

    def wait_or_wake(nanoseconds: int) -> None:
        clear()
        add_subscription(subscription)
        add_guard(guard)
        wait_ns(nanoseconds)

    return wait_or_wake


def message_inbox(
    node: Node, message_type: type, topic: str, qos: QoSProfile, can_wake: bool = False,
) -> MessageInbox | SpunInbox:
    """Subscribe to a topic; return what a thread takes its messages from. Fallback: SpunInbox."""
    try:
        return MessageInbox(node, message_type, topic, qos, can_wake)
    except _ABSENT:
        return SpunInbox(node, message_type, topic, qos)


# ---------------------------------------------------------------------- services

class RequestInbox:
    """
    The requests of a service, for a thread that waits for them and takes them.

    It uses `WaitSet`, `Service.handle.service_take_request`, `Service.callback` and
    `Context.handle`: an executor takes a request only after the callbacks before it.
    """

    def __init__(
        self, node: Node, srv_type: Any, name: str, callback: Callable[[Any, Any], Any],
    ) -> None:
        """Create a service; raise one of _ABSENT if rclpy lacks a member."""
        self._wait_set = _wait_set(node.context, 'Service', TAKE_REQUEST, 0, 0, 0, 0, 1, 0)
        self.service: Service = node.create_service(
            srv_type, name, callback, callback_group=LEFT_TO_A_THREAD)
        self._handle = _handle(self.service)
        self.take: Callable[[], tuple[Any, Any]] = functools.partial(
            getattr(self._handle, TAKE_REQUEST), srv_type.Request)
        """Returns a request and its header, or (None, None)."""
        self.answer: Callable[[Any, Any], Any] = getattr(self.service, CALLBACK, callback)
        """Returns the response to a request; its second argument is a response to fill."""

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

    Fallback: a service that the executor calls back, in a separate group, and None.
    """
    try:
        requests = RequestInbox(node, srv_type, name, callback)
    except _ABSENT:
        group = MutuallyExclusiveCallbackGroup()
        return node.create_service(srv_type, name, callback, callback_group=group), None
    return requests.service, requests


def replace_callback(
    service: Service, wrap: Callable[[Any, str, Callable[..., Any]], Callable[..., Any]],
) -> bool:
    """
    Let the executor call `wrap(type, name, callback)` for a service; return whether it will.

    It sets the attribute `callback` of the service: rclpy creates the services of a lifecycle
    node without `Node.create_service`. A callback that is wrapped already stays. Fallback: the
    callback stays, and an error in it ends the spin of the executor.
    """
    callback = getattr(service, CALLBACK, None)
    if callback is None or hasattr(callback, '__wrapped__'):
        return False
    setattr(service, CALLBACK, wrap(service.srv_type, service.srv_name, callback))
    return True


def replace_send_response(service: Service, send: Callable[[Any, Any], None]) -> None:
    """
    Let the executor send the responses of a service by `send`, which gets message and header.

    It sets the attribute `send_response` of the service, which executors call: the documented
    interface sends a response as soon as the callback returns, and loses those whose client is
    not discovered yet. Fallback: the executor sends responses itself.
    """
    if hasattr(service, SEND_RESPONSE):
        setattr(service, SEND_RESPONSE, send)


def send_response(service: Service, message: object, header: object) -> None:
    """Send a response by the method that `replace_send_response` has replaced."""
    type(service).send_response(service, message, header)


def request_number(header: object) -> int | None:
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
    declared. Fallback: no names, so that the log has no warning of an unknown name.
    """
    return list(getattr(node, PARAMETER_OVERRIDES, ()))


def rename_parameter_override(node: Node, former: str, name: str) -> bool:
    """
    Return whether a parameter is set at the start by a former name, and set it by its name.

    A value that is set by both names is that of `name`. Fallback: no parameter is renamed.
    """
    overrides = getattr(node, PARAMETER_OVERRIDES, {})
    if former not in overrides:
        return False
    given = overrides.pop(former)
    overrides.setdefault(name, Parameter(name, given.type_, given.value))
    return True
