# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Comparison of the joint order of effort controllers with that of the command.

`~/commands` has no joint names: a ros2_control controller applies the values in the order of its
parameter `joints`. The check runs in the executor. Nothing is published on `~/commands` until one
subscriber has the right order or all have been checked, nor while one has another order, unless
another has the right one. A subscriber that joins later interrupts no command, unless it has a
parameter service and no other one has the right order: it is checked meanwhile. A subscriber
without joint names, such as a DDS reader that is no node, is none of a controller.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
import time
from typing import Any

from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.publisher import Publisher
from rclpy.topic_endpoint_info import TopicEndpointInfo
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.ros.middleware.graph_watch import full_name
from robot_dynamics.ros.middleware.pausing_timer import PausingTimer
from robot_dynamics.ros.middleware.rclpy_internals import RclError, subscription_count

LOOK_PERIOD = 0.1
"""[s] between two checks while a subscriber is unchecked."""
RECHECK_PERIOD = 1.0
"""[s] between two searches for subscribers; the next command notices a new one, too."""
GRACE = 0.5
"""
[s] for the parameter service of a subscriber to be discovered.

A node creates that service before its subscriptions, so it is usually discovered before them.
"""
PATIENCE = 5.0
"""[s] for a parameter service that was discovered to answer."""
NO_NODE = ('_NODE_NAME_UNKNOWN_', '_CREATED_BY_BARE_DDS_APP_')
"""Names that the middleware gives to the node of a DDS reader that is not known, or is none."""


class _Subscriber:
    """One subscriber of `~/commands`, and the parameter `joints` of its node."""

    def __init__(self, node: Node, info: TopicEndpointInfo) -> None:
        self._node, self._of = node, (info.node_name, info.node_namespace)
        self._is_node = info.node_name not in NO_NODE
        self.name = full_name(*self._of) if self._is_node else 'a DDS reader that is no node'
        self.is_checked = self.has_service = False
        self.joints: list[str] | None = None
        self._service, self._since = f'{self.name}/get_parameters', time.monotonic()
        self._client: Any = None
        self._future: Any = None
        if self._is_node:
            with suppress(RclError):  # a ROS 2 security policy may not allow it
                self._client = node.create_client(GetParameters, self._service)

    def continue_check(self) -> str:
        """Continue the request; return why the order cannot be checked, empty if it can."""
        if self._future is None and self._client is not None and self._client.service_is_ready():
            self._future = self._client.call_async(GetParameters.Request(names=['joints']))
        if self._future is not None and self._future.done():
            values = self._future.result().values
            self.close()
            if not values or values[0].type != ParameterType.PARAMETER_STRING_ARRAY or (
                    not values[0].string_array_value):
                return 'it has no parameter `joints`'
            self.joints = list(values[0].string_array_value)
            return ''
        self.has_service = self._future is not None or self._has_service()
        if time.monotonic() - self._since < (PATIENCE if self.has_service else GRACE):
            return ''
        self.close()
        return 'its parameter service does not answer' if self.has_service else (
            'it has no parameter service')

    def _has_service(self) -> bool:
        with suppress(NodeNameNonExistentError, RclError):
            return self._is_node and any(
                name == self._service
                for name, _ in self._node.get_service_names_and_types_by_node(*self._of))
        return False

    def close(self) -> None:
        """End the request and the check."""
        self.is_checked = True
        if self._client is not None:
            self._node.destroy_client(self._client)
            self._client = self._future = None


class ControllerOrder:
    """Checks the subscribers of `~/commands`; `check` runs in the executor."""

    def __init__(
        self, node: Node, commands: Publisher, joint_names: Callable[[], Sequence[str]],
        when_wrong: Callable[[Fault], None],
    ) -> None:
        """`joint_names` returns the commanded joints; `when_wrong` gets each new difference."""
        self.fault: Fault | None = None
        """The difference, as long as it exists."""
        self._node, self._commands, self._joint_names = node, commands, joint_names
        self._when_wrong = when_wrong
        self._count = subscription_count(commands)
        self._subscribers: dict[tuple[bytes, str], _Subscriber] = {}
        self._open_for: list[str] | None = None
        self._seen = 0
        """Number of subscribers at the last command."""
        self._reported: set[str] = set()
        node.create_timer(RECHECK_PERIOD, self.check)
        self._timer = PausingTimer(node, LOOK_PERIOD, self.check)
        """Runs while a subscriber is unchecked."""
        self.look_now = node.create_guard_condition(self.check).trigger
        """Check at once; may be called in any thread."""

    def allows(self) -> bool:
        """Tell whether a command may be published; called by the control path."""
        count = self._count()
        if count != self._seen:
            self._seen = count
            self.look_now()
        return count == 0 or self._open_for == self._joint_names()

    def check(self) -> None:
        """Find the subscribers, continue their checks, and compare the orders."""
        names = list(self._joint_names())
        self._find()
        for subscriber in self._subscribers.values():
            if not subscriber.is_checked:
                self._report(subscriber.name, subscriber.continue_check())
        checked = [one for one in self._subscribers.values() if one.is_checked]
        self._compare(checked, names)
        self._open_for = names if self._has_order(names) else None
        self._timer.run(len(checked) < max(len(self._subscribers), self._count()))

    def _has_order(self, names: list[str]) -> bool:
        """Return whether a subscriber has this order, or none can have another one."""
        subscribers = self._subscribers.values()
        if any(one.joints == names for one in subscribers):
            return True
        is_open = self._open_for == names
        return self.fault is None and bool(subscribers) and all(
            one.is_checked or is_open and not one.has_service for one in subscribers)

    def _find(self) -> None:
        found = {(bytes(info.endpoint_gid), info.node_name): info for info in
                 self._node.get_subscriptions_info_by_topic(self._commands.topic_name)}
        for key in self._subscribers.keys() - found.keys():
            self._subscribers.pop(key).close()
        for key in found.keys() - self._subscribers.keys():
            self._subscribers[key] = _Subscriber(self._node, found[key])

    def _report(self, name: str, reason: str) -> None:
        if reason and name not in self._reported:
            self._reported.add(name)
            self._node.get_logger().warning(
                f'The joint order of {name}, a subscriber of {self._commands.topic_name}, was '
                f'not checked: {reason}. It must be {list(self._joint_names())}.')

    def _compare(self, checked: Sequence[_Subscriber], names: list[str]) -> None:
        wrong = next((one for one in checked if names and one.joints not in (None, names)), None)
        if wrong is None:
            self.fault = None
            return
        words = (
            f'{wrong.name} applies {self._commands.topic_name} to the joints {wrong.joints}, '
            f'expected the order of this node, {names}: set the parameter `joints` of both to '
            'the same order')
        if self.fault is None or self.fault.message != words:
            self.fault = Fault('controller_order', words, latched=True)
            self._when_wrong(self.fault)
