# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The topics and services of the viewer: newest messages, asynchronous requests, and the arm.

All callbacks run in the thread that calls `receive`. Topics are read a few times per second, and
only their newest message is kept, so that the load does not depend on the rate of the states.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
import time
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import InertiaStamped, WrenchStamped
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.urdf.description_file import description_path, read_description
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
ASK_PERIOD = 1.0
"""[s] between two requests for the arm."""
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
            node.create_subscription(kind, topic, partial(self._keep, field), qos)
        self._received: dict[str, Any] = {}
        self.send_trajectory = node.create_publisher(
            JointTrajectory, f'{dynamics}/joint_trajectory', NEWEST).publish
        self._wrench = node.create_publisher(
            WrenchStamped, f'{simulated_arm}/external_wrench', NEWEST)
        self.push = self._wrench.publish
        self._parameters = node.create_client(GetParameters, f'{dynamics}/get_parameters')
        self._payloads = {
            name: node.create_client(SetPayload, f'{name}/set_payload')
            for name in (dynamics, simulated_arm)}
        self._reset = node.create_client(Trigger, f'{simulated_arm}/reset')
        self.dynamics, self.simulated_arm, self.monitor = dynamics, simulated_arm, monitor

    def _keep(self, field: str, message: Any) -> None:
        self._turned = True
        service = self.node.resolve_service_name(f'{self.dynamics}/get_parameters')
        if field == 'diagnostics' and not any(status.name.startswith(
                f'{service.rpartition("/")[0]}: ') for status in message.status):
            return  # from another node
        self._received[field] = message

    def receive(self) -> dict[str, Any]:
        """
        Return the newest message of each topic with a message since the last call.

        The keys are `state`, `command`, `terms`, `reference`, `markers`, `trajectory`,
        `payload`, `diagnostics` and `description`. Passes on the responses of services, too.
        """
        for _ in range(MOST_TURNS):
            self._turned = False
            self._executor.spin_once(timeout_sec=0.0)
            if not self._turned:
                break
        received, self._received = self._received, {}
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


class Description(NamedTuple):
    """A URDF, the directory of its file (None: from a topic), and the actuated joints."""

    xml: str
    directory: Path | None
    joints: tuple[str, ...]


class ArmSource:
    """Finds the arm, and detects a new one."""

    def __init__(self, node: ViewerNode, robot: str | None) -> None:
        """`robot` is the file of a URDF, or None; raise ModelError if it is unreadable."""
        self._node, self._robot = node, robot
        self._described: dict[str, Any] | None = None
        self._topic_xml = ''
        self._asked_time = -ASK_PERIOD
        self._last: Description | None = None
        self._found = None if robot is None else _of_file(robot, '--robot')
        self.problem = ''
        """Reason why the arm of `dynamics` cannot be shown."""

    def take_topic(self, xml: str) -> None:
        """Store a URDF from the topic robot_description."""
        self._topic_xml = xml
        if self._described is not None:
            self._take(self._described)

    def news(self) -> Description | None:
        """Return the arm if it is a new one, else None; request it from `dynamics`."""
        if not self._node.has_dynamics:
            self._described, self.problem = None, ''  # the node may restart with another arm
            if self._topic_xml and self._robot is None:
                self._found = Description(self._topic_xml, None, ())
        elif self._described is None and time.monotonic() - self._asked_time >= ASK_PERIOD:
            self._asked_time = time.monotonic()
            self._node.ask_description(self._take)
        if self._found == self._last:
            return None
        self._last = self._found
        return self._found

    def _take(self, described: dict[str, Any]) -> None:
        """Store the arm from the parameters of `dynamics`."""
        self._described, self.problem = described, ''
        xml, file, joints = (described.get(name) for name in DESCRIBING)
        joints = tuple(joints or ())
        if self._found is not None and self._robot is not None:
            self._found = self._found._replace(joints=joints)
            return
        if file:
            try:
                self._found = _of_file(file, 'robot_description_file', joints)
                return
            except RobotDynamicsError as error:  # a file on another computer
                if not self._topic_xml:
                    self.problem = (
                        f'{error}; expected the file also here, or on the topic robot_description')
                    return
        self._found = Description(xml or self._topic_xml or default_arm_urdf(), None, joints)


def _of_file(file: str, field: str, joints: tuple[str, ...] = ()) -> Description:
    path = description_path(file, field)
    return Description(read_description(path, field), path.parent, joints)


def worst_words(message: DiagnosticArray) -> list[str]:
    """Return a line for each status that is not OK."""
    return [
        f'{status.name.rpartition(":")[2].strip()}: {status.message}'
        for status in message.status if status.level != DiagnosticStatus.OK]


def drive_words(message: DiagnosticArray) -> list[str]:
    """Return a line for the drive check if it is OK."""
    return [f'drive: {status.message}' for status in message.status
            if status.level == DiagnosticStatus.OK and status.name.endswith(': drive')]
