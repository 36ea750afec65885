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
What the viewer hears and says on ROS: the newest of each topic, and requests that do not wait.

Everything happens in the thread that calls `receive`. Topics are read a few times a second, and
keep only their newest message, so that states of any rate cost the same.
"""

from collections.abc import Callable
from dataclasses import dataclass
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
"""Messages and answers that are taken at a time."""
DESCRIBING = ('robot_description', 'robot_description_file', 'joints')


@dataclass
class Received:
    """The newest message of each topic that arrived since the last look; None where none did."""

    state: JointState | None = None
    terms: DynamicsTerms | None = None
    reference: JointState | None = None
    markers: MarkerArray | None = None
    trajectory: JointTrajectory | None = None
    payload: InertiaStamped | None = None
    diagnostics: DiagnosticArray | None = None
    description: String | None = None


@dataclass(frozen=True)
class Described:
    """The parameters of `dynamics` that say which arm it is."""

    xml: str
    file: str
    joints: tuple[str, ...]


class ViewerNode:
    """The node `viewer`, beside a `dynamics` and a `simulated_arm` node of these names."""

    def __init__(self, node: Node, dynamics: str, simulated_arm: str) -> None:
        self.node = node
        self._received = Received()
        self._turned = False
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        for field, kind, topic, qos in (
                ('state', JointState, 'joint_states', NEWEST_STATE),
                ('terms', DynamicsTerms, f'{dynamics}/terms', NEWEST),
                ('reference', JointState, f'{dynamics}/reference', NEWEST),
                ('markers', MarkerArray, f'{dynamics}/markers', NEWEST),
                ('trajectory', JointTrajectory, f'{dynamics}/joint_trajectory', NEWEST),
                ('payload', InertiaStamped, f'{dynamics}/payload', LATCHED),
                ('diagnostics', DiagnosticArray, '/diagnostics', QoSProfile(depth=10)),
                ('description', String, 'robot_description', LATCHED)):
            node.create_subscription(kind, topic, self._keep(field), qos)
        self._trajectory = node.create_publisher(
            JointTrajectory, f'{dynamics}/joint_trajectory', NEWEST)
        self._wrench = node.create_publisher(
            WrenchStamped, f'{simulated_arm}/external_wrench', NEWEST)
        self._parameters = node.create_client(GetParameters, f'{dynamics}/get_parameters')
        self._payloads = {
            name: node.create_client(SetPayload, f'{name}/set_payload')
            for name in (dynamics, simulated_arm)}
        self._reset = node.create_client(Trigger, f'{simulated_arm}/reset')
        self.dynamics, self.simulated_arm = dynamics, simulated_arm

    def _keep(self, field: str) -> Callable[[Any], None]:
        def keep(message: Any) -> None:
            self._turned = True
            if field == 'diagnostics' and not self._is_of_dynamics(message):
                return  # of another node
            setattr(self._received, field, message)

        return keep

    def _is_of_dynamics(self, message: DiagnosticArray) -> bool:
        service = self.node.resolve_service_name(f'{self.dynamics}/get_parameters')
        full_name = service.rpartition('/')[0]
        return any(status.name.startswith(f'{full_name}: ') for status in message.status)

    def receive(self) -> Received:
        """Return what has arrived; answers of services are handed on meanwhile."""
        for _ in range(MOST_TURNS):
            self._turned = False
            self._executor.spin_once(timeout_sec=0.0)
            if not self._turned:
                break
        received, self._received = self._received, Received()
        return received

    def close(self) -> None:
        """Leave ROS."""
        self._executor.shutdown()
        self.node.destroy_node()

    # ------------------------------------------------------------------ what is there

    @property
    def has_dynamics(self) -> bool:
        """Tell whether a `dynamics` node answers."""
        return bool(self._parameters.service_is_ready())

    @property
    def has_simulated_arm(self) -> bool:
        """Tell whether a `simulated_arm` listens, which can be pushed."""
        return bool(self._wrench.get_subscription_count())

    @property
    def has_states(self) -> bool:
        """Tell whether anybody publishes joint states."""
        return bool(self.node.count_publishers('joint_states'))

    # ------------------------------------------------------------------ requests

    def ask_description(self, report: Callable[[Described], None]) -> None:
        """Ask `dynamics` for its arm; `report` is called in a later `receive`."""
        def answered(values: dict[str, Any]) -> None:
            joints = values.get('joints') or ()
            report(Described(
                str(values.get('robot_description') or ''),
                str(values.get('robot_description_file') or ''), tuple(joints)))

        future = self._parameters.call_async(GetParameters.Request(names=list(DESCRIBING)))
        future.add_done_callback(lambda done: self._hand_on(done, lambda response: answered({
            name: parameter_value_to_python(value)
            for name, value in zip(DESCRIBING, response.values)})))

    def set_payload(
        self, name: str, payload: InertiaStamped, seconds: float, report: Callable[[str], None],
    ) -> None:
        """Put a load on the arm of node `name`, or of m = 0 take it off; `report` the answer."""
        client = self._payloads[name]
        if not client.service_is_ready():
            report(f'{name} is not there')
            return
        future = client.call_async(
            SetPayload.Request(payload=payload, transition_time=seconds))
        future.add_done_callback(lambda done: self._hand_on(
            done, lambda response: report(f'{name}: {response.message or "done"}')))

    def reset_simulated_arm(self, report: Callable[[str], None]) -> None:
        """Put the simulated arm back to where it began; `report` the answer."""
        if not self._reset.service_is_ready():
            report(f'{self.simulated_arm} is not there')
            return
        self._reset.call_async(Trigger.Request()).add_done_callback(
            lambda done: self._hand_on(done, lambda response: report(
                f'{self.simulated_arm}: {response.message or "done"}')))

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
