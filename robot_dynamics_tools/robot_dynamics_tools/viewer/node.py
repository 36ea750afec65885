# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The topics and services of the viewer: the newest message per topic, and asynchronous requests.

All callbacks run in the thread that calls `receive`. Topics are read a few times per second, and
only their newest message is kept, so that the load does not depend on the rate of the states.
"""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import InertiaStamped, WrenchStamped
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from robot_dynamics_interfaces.msg import DynamicsTerms
from robot_dynamics_interfaces.srv import SetPayload
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

NEWEST = QoSProfile(depth=1)
NEWEST_STATE = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
MOST_TURNS = 40
"""Messages and responses that are taken in one call."""
DESCRIBING = ('robot_description', 'robot_description_file', 'joints')


class ViewerNode:
    """The node `viewer`, for nodes with these names."""

    def __init__(
        self, node: Node, dynamics: str, simulated_arm: str, monitor: str = 'dynamics_monitor',
    ) -> None:
        self.node = node
        self._turned = False
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        topics = (
            ('state', JointState, 'joint_states', NEWEST_STATE),
            ('command', JointState, 'effort_command', NEWEST_STATE),
            ('terms', DynamicsTerms, f'{dynamics}/terms', NEWEST),
            ('reference', JointState, f'{dynamics}/reference', NEWEST),
            ('markers', MarkerArray, f'{monitor}/markers', NEWEST),
            ('trajectory', JointTrajectory, f'{dynamics}/joint_trajectory', NEWEST),
            ('payload', InertiaStamped, f'{dynamics}/payload', LATCHED),
            ('diagnostics', DiagnosticArray, '/diagnostics', QoSProfile(depth=10)),
            ('description', String, 'robot_description', LATCHED))
        for field, kind, topic, qos in topics:
            node.create_subscription(kind, topic, self._keep(field), qos)
        self._nothing = dict.fromkeys(topic[0] for topic in topics)
        self._received = SimpleNamespace(**self._nothing)
        self._trajectory = node.create_publisher(
            JointTrajectory, f'{dynamics}/joint_trajectory', NEWEST)
        self._wrench = node.create_publisher(
            WrenchStamped, f'{simulated_arm}/external_wrench', NEWEST)
        self._parameters = node.create_client(GetParameters, f'{dynamics}/get_parameters')
        self._payloads = {
            name: node.create_client(SetPayload, f'{name}/set_payload')
            for name in (dynamics, simulated_arm)}
        self._reset = node.create_client(Trigger, f'{simulated_arm}/reset')
        self.dynamics, self.simulated_arm, self.monitor = dynamics, simulated_arm, monitor

    def _keep(self, field: str) -> Callable[[Any], None]:
        def keep(message: Any) -> None:
            self._turned = True
            service = self.node.resolve_service_name(f'{self.dynamics}/get_parameters')
            if field == 'diagnostics' and not any(status.name.startswith(
                    f'{service.rpartition("/")[0]}: ') for status in message.status):
                return  # from another node
            setattr(self._received, field, message)

        return keep

    def receive(self) -> SimpleNamespace:
        """
        Return the newest message of each topic since the last call, None without a message.

        The attributes are `state`, `command`, `terms`, `reference`, `markers`, `trajectory`,
        `payload`, `diagnostics` and `description`. Passes on the responses of services, too.
        """
        for _ in range(MOST_TURNS):
            self._turned = False
            self._executor.spin_once(timeout_sec=0.0)
            if not self._turned:
                break
        received, self._received = self._received, SimpleNamespace(**self._nothing)
        return received

    def close(self) -> None:
        """Leave ROS."""
        self._executor.shutdown()
        self.node.destroy_node()

    # ------------------------------------------------------------------ other nodes

    @property
    def has_dynamics(self) -> bool:
        """Return whether a `dynamics` node is available."""
        return bool(self._parameters.service_is_ready())

    @property
    def has_monitor(self) -> bool:
        """Return whether a `dynamics_monitor` node publishes the efforts to draw."""
        return bool(self.node.count_publishers(f'{self.monitor}/markers'))

    @property
    def has_simulated_arm(self) -> bool:
        """Return whether a `simulated_arm` node, which can be pushed, subscribes."""
        return bool(self._wrench.get_subscription_count())

    @property
    def has_states(self) -> bool:
        """Return whether joint_states has a publisher."""
        return bool(self.node.count_publishers('joint_states'))

    # ------------------------------------------------------------------ requests

    def ask_description(self, report: Callable[[dict[str, Any]], None]) -> None:
        """Request the parameters DESCRIBING of `dynamics`; a later `receive` calls `report`."""
        future = self._parameters.call_async(GetParameters.Request(names=list(DESCRIBING)))
        future.add_done_callback(lambda done: self._hand_on(done, lambda response: report({
            name: parameter_value_to_python(value)
            for name, value in zip(DESCRIBING, response.values)})))

    def set_payload(
        self, name: str, payload: InertiaStamped, seconds: float, report: Callable[[str], None],
    ) -> None:
        """Set the load on the arm of node `name`, m = 0 to remove it; `report` the response."""
        self._ask(name, self._payloads[name], SetPayload.Request(
            payload=payload, transition_time=seconds), report)

    def reset_simulated_arm(self, report: Callable[[str], None]) -> None:
        """Reset the simulated arm to its initial pose; `report` the response."""
        self._ask(self.simulated_arm, self._reset, Trigger.Request(), report)

    def _ask(self, name: str, client: Any, request: Any, report: Callable[[str], None]) -> None:
        if not client.service_is_ready():
            report(f'node {name} not found')
            return
        client.call_async(request).add_done_callback(lambda done: self._hand_on(
            done, lambda response: report(f'{name}: ' + '; '.join(
                [response.message or 'done', *getattr(response, 'warnings', ())]))))

    def _hand_on(self, future: Any, answered: Callable[[Any], None]) -> None:
        self._turned = True
        if future.exception() is None and future.result() is not None:
            answered(future.result())

    def send_trajectory(self, message: JointTrajectory) -> None:
        """Publish a reference."""
        self._trajectory.publish(message)

    def push(self, message: WrenchStamped) -> None:
        """Publish a wrench on a link of the simulated arm."""
        self._wrench.publish(message)


def worst_words(message: DiagnosticArray) -> list[str]:
    """Return a line for each status that is not OK."""
    return [
        f'{status.name.rpartition(":")[2].strip()}: {status.message}'
        for status in message.status if status.level != DiagnosticStatus.OK]


def drive_words(message: DiagnosticArray) -> list[str]:
    """Return a line for the drive check if it is OK."""
    return [f'drive: {status.message}' for status in message.status
            if status.level == DiagnosticStatus.OK and status.name.endswith(': drive')]
