# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The only module that uses members of rclpy beyond its documented interface.

Each function and class names the member, why the documented interface is not enough, and what is
used instead if an update of rclpy has no such member. All members of classes in C++ are used, or
none of them. `test/ros/test_rclpy_internals.py` reports the members that an update changes.
"""

from collections.abc import Callable, Sequence
import functools
import importlib
from typing import Any

from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from rclpy.context import Context
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.service import Service
from rclpy.subscription import Subscription
from robot_dynamics.ros.middleware.spun_inbox import SpunInbox, Taken

IMPLEMENTATION = 'rclpy.impl.implementation_singleton'
"""Module that has `rclpy_implementation`, the classes of rclpy that are written in C++."""
MEMBERS = {
    'Publisher': ('publish_raw', 'get_subscription_count'),
    'Service': ('service_take_request',),
    'Subscription': ('take_message',),
    'WaitSet': ('add_service', 'add_subscription', 'clear_entities', 'wait'),
}
"""The members that are used of these classes."""
HANDLE = 'handle'
"""Property of publishers, subscriptions, services and contexts: the object in C++."""
PARAMETER_OVERRIDES = '_parameter_overrides'
SEND_RESPONSE = 'send_response'
CALLBACK = 'callback'
REQUEST_ID = 'request_id'


def implementation() -> Any:
    """Return `rclpy_implementation`, None if it lacks one of MEMBERS, or a class lacks HANDLE."""
    try:
        for kind in (Context, Publisher, Service, Subscription):
            getattr(kind, HANDLE)
        found = importlib.import_module(IMPLEMENTATION).rclpy_implementation
        for name, members in MEMBERS.items():
            for member in members:
                getattr(getattr(found, name), member)
    except (AttributeError, ImportError):
        return None
    return found


def error_type(name: str) -> type[Exception]:
    """
    Return an exception class of `rclpy_implementation`.

    rclpy raises it, but exports it nowhere else. Fallback: RuntimeError, its base class.
    """
    found: type[Exception] = getattr(implementation(), name, RuntimeError)
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
    publish: Callable[[bytes], None] = (
        publisher.handle.publish_raw if implementation() else publisher.publish)
    return publish


def subscription_count(publisher: Publisher) -> Callable[[], int]:
    """
    Return a function that returns the number of subscribers of a publisher.

    It is `Publisher.handle.get_subscription_count`: the documented method of that name takes four
    times as long. Fallback: that method.
    """
    count: Callable[[], int] = (
        publisher.handle if implementation() else publisher).get_subscription_count
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

    def __init__(self, node: Node, message_type: type, topic: str, qos: QoSProfile) -> None:
        """Subscribe to a topic."""
        self._node = node
        self.subscription: Subscription = node.create_subscription(
            message_type, topic, lambda _: None, qos, raw=True, callback_group=LEFT_TO_A_THREAD)
        """For its topic name and its number of publishers."""
        handle = self.subscription.handle
        self.take: Callable[[], Taken | None] = functools.partial(
            handle.take_message, message_type, True)
        """Returns the next message and its properties, or None."""
        wait_set = implementation().WaitSet(1, 0, 0, 0, 0, 0, node.context.handle)
        clear, add, wait_ns = wait_set.clear_entities, wait_set.add_subscription, wait_set.wait

        def wait(nanoseconds: int) -> None:
            clear()
            add(handle)
            wait_ns(nanoseconds)

        self.wait: Callable[[int], None] = wait  # its names are not looked up for each message
        """Waits at most so long [ns] for a message."""

    def close(self) -> None:
        """End the subscription; no thread may wait any more."""
        self._node.destroy_subscription(self.subscription)


def message_inbox(
    node: Node, message_type: type, topic: str, qos: QoSProfile,
) -> MessageInbox | SpunInbox:
    """Subscribe to a topic; return what a thread takes its messages from. Fallback: SpunInbox."""
    inbox = MessageInbox if implementation() else SpunInbox
    return inbox(node, message_type, topic, qos)


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
        """Create a service."""
        self.service: Service = node.create_service(
            srv_type, name, callback, callback_group=LEFT_TO_A_THREAD)
        self._handle = self.service.handle
        self.take: Callable[[], tuple[Any, Any]] = functools.partial(
            self._handle.service_take_request, srv_type.Request)
        """Returns a request and its header, or (None, None)."""
        self.answer: Callable[[Any, Any], Any] = getattr(self.service, CALLBACK, callback)
        """Returns the response to a request; its second argument is a response to fill."""
        self._wait_set = implementation().WaitSet(0, 0, 0, 0, 1, 0, node.context.handle)

    def wait(self, nanoseconds: int) -> None:
        """Wait at most so long for a request."""
        self._wait_set.clear_entities()
        self._wait_set.add_service(self._handle)
        self._wait_set.wait(nanoseconds)


def service_with_inbox(
    node: Node, srv_type: Any, name: str, callback: Callable[[Any, Any], Any],
) -> RequestInbox | None:
    """
    Create a service; return what a thread takes its requests from.

    Fallback: a service that the executor calls back, in a separate group, and None.
    """
    if implementation():
        return RequestInbox(node, srv_type, name, callback)
    group = MutuallyExclusiveCallbackGroup()
    node.create_service(srv_type, name, callback, callback_group=group)
    return None


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
