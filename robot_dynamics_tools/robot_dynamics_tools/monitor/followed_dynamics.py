# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The description, parameters and payloads that the running node `dynamics` uses, and their changes.

Parameters are requested when the node appears or restarts, which a new publisher of `~/payload`
shows, after each description, and when /parameter_events names the node.
"""

from collections.abc import Callable, Sequence
import time
from typing import Any

from geometry_msgs.msg import Inertia, InertiaStamped
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import qos_profile_parameter_events
from robot_dynamics.model.payload import Payload
from robot_dynamics.ros.dynamics.model_source import LATCHED
from robot_dynamics.ros.dynamics.payloads import ALL_PAYLOADS
from robot_dynamics.ros.middleware.conversions import payload_from_ros
from robot_dynamics.ros.middleware.diagnostics import ERROR, OK, Status, WARN
from robot_dynamics.ros.middleware.pausing_timer import PausingTimer
from robot_dynamics.ros.parameters.declared_parameters import Values
from robot_dynamics.urdf.document import LARGEST_DESCRIPTION
from std_msgs.msg import String

PERIOD = 0.5
"""[s] between two checks whether the node is there."""
PATIENCE = 5.0
"""[s] for an answer of the node."""
SETTLE = 0.05
"""[s] after which all messages of `~/payload` with one stamp have arrived."""


class FollowedDynamics:
    """Reports what `dynamics` uses; all calls are in the executor."""

    def __init__(
        self, node: Node, name: str, names: Sequence[str],
        take_model: Callable[[str, Values], None],
        take_payloads: Callable[[tuple[Payload, ...]], None],
    ) -> None:
        """
        Follow the node with a full `name`.

        `take_model` is called with the URDF and the values of the parameters `names`,
        `take_payloads` with all active payloads, each at the start and after a change.
        """
        self.name, self._node, self._names = name, node, list(names)
        self._take_model, self._take_payloads = take_model, take_payloads
        self._description = ''
        self._publishers: frozenset[bytes] = frozenset()
        self._is_due = self._has_values = False
        self._request: Any = None
        self._requested_at = 0.0
        self._obstacle = ''
        self._stamp: Any = None
        self._payloads: list[Payload] = []
        self._known: dict[str, tuple[Inertia, Payload | None]] = {}
        """Payloads by link, so that one that has not changed remains the same object."""
        self._client = node.create_client(GetParameters, f'{name}/get_parameters')
        node.create_subscription(
            ParameterEvent, '/parameter_events', self._on_event, qos_profile_parameter_events)
        node.create_subscription(InertiaStamped, f'{name}/payload', self._on_payload, ALL_PAYLOADS)
        node.create_subscription(
            String, f'{name}/robot_description', self._on_description, LATCHED,
            largest=LARGEST_DESCRIPTION)
        self._settle = PausingTimer(node, SETTLE, self._use_payloads)
        node.create_timer(PERIOD, self._look)
        node.get_logger().info(f'Waiting for the parameters of the node {name}.')

    def status(self) -> Status:
        """Return whether the node is there, for the diagnostics."""
        if not self._publishers:
            others = sorted(
                name.removesuffix('/payload')
                for name, kinds in self._node.get_topic_names_and_types()
                if name.endswith('/payload') and 'geometry_msgs/msg/InertiaStamped' in kinds
                and self._node.count_publishers(name))
            return Status('dynamics', WARN, (
                f'no node {self.name} (parameter dynamics), those that run: '
                f'{", ".join(others) or "none"}' + (
                    '; its last parameters are used' if self._has_values else '')), {})
        if self._obstacle:
            return Status('dynamics', ERROR, self._obstacle, {})
        if not self._has_values:
            return Status('dynamics', WARN, f'waiting for the parameters of {self.name}', {})
        return Status('dynamics', OK, f'follows {self.name}', {})

    # ------------------------------------------------------------------ description, parameters

    def _on_description(self, message: String) -> None:
        self._description, self._is_due = message.data, True
        self._ask()

    def _look(self) -> None:
        found = frozenset(
            bytes(end.endpoint_gid)
            for end in self._node.get_publishers_info_by_topic(f'{self.name}/payload'))
        self._is_due = self._is_due or bool(found - self._publishers)
        self._publishers = found
        if self._request is not None and time.monotonic() - self._requested_at > PATIENCE:
            self._client.remove_pending_request(self._request)
            self._request, self._is_due = None, True
        self._ask()

    def _on_event(self, event: ParameterEvent) -> None:
        if event.node == self.name and any(
                one.name in self._names for one in event.changed_parameters):
            self._is_due = True
            self._ask()

    def _ask(self) -> None:
        if self._is_due and self._request is None and self._client.service_is_ready():
            self._is_due, self._requested_at = False, time.monotonic()
            self._request = self._client.call_async(GetParameters.Request(names=self._names))
            self._request.add_done_callback(self._on_answer)

    def _on_answer(self, request: Any) -> None:
        if request is not self._request:  # answered too late
            return
        self._request = None
        found = dict(zip(self._names, map(parameter_value_to_python, request.result().values)))
        missing = [name for name in self._names if found.get(name) is None]
        self._obstacle = (
            f'{self.name} has no parameters {missing}, expected a node dynamics of the version '
            'of this node') if missing else ''
        self._has_values = self._has_values or not missing
        if not missing and self._description:
            self._take_model(self._description, {
                name: value if isinstance(value, (bool, int, float, str)) else tuple(value)
                for name, value in found.items()})
        self._ask()

    # ------------------------------------------------------------------ payloads

    def _on_payload(self, message: InertiaStamped) -> None:
        """Collect the messages of one stamp: one per payload, m = 0 without a payload."""
        if message.header.stamp != self._stamp:
            self._stamp, self._payloads = message.header.stamp, []
        link, inertia = message.header.frame_id, message.inertia
        known, payload = self._known.get(link, (None, None))
        if inertia != known:
            payload = payload_from_ros(None, message)
            self._known[link] = inertia, payload
        if payload is not None:
            self._payloads.append(payload)
        self._settle.run(False)
        self._settle.run(True)

    def _use_payloads(self) -> None:
        self._settle.run(False)
        self._take_payloads(tuple(self._payloads))
