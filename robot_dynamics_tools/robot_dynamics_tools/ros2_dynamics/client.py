# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A client that finds a `dynamics` node, calls its services and subscribes to its topics."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import os
import time
from typing import Any, TYPE_CHECKING, TypeVar

from geometry_msgs.msg import InertiaStamped
from rcl_interfaces.srv import GetParameters, SetParameters
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.ros.dynamics.silence import domain
from robot_dynamics_interfaces.srv import InverseDynamicsBatch
from robot_dynamics_tools.recordings.interrupts import uninterrupted
from std_msgs.msg import String

if TYPE_CHECKING:
    from robot_dynamics.urdf.parser import UrdfJoint
    from robot_dynamics_tools.recorder import Recorder

TIMEOUT = 5.0
"""[s] that a node is looked for, and that an answer may take."""
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_TURN = 0.02
"""[s] between two looks."""
_SETTLE = 0.5
"""[s] after the first node in which others may be found too, as long as ros2cli takes."""
_GLANCE = 0.2
"""[s] in which a publisher is found that has been there before the node was found."""
MONITOR = 'dynamics_monitor'
_OFFERED = '/inverse_dynamics'
_SERVICE = 'robot_dynamics_interfaces/srv/InverseDynamics'
_OFFERED_BY_MONITOR = '/estimate_payload'
Answer = TypeVar('Answer')
Client = TypeVar('Client', bound='DynamicsClient')


class NoAnswerError(RobotDynamicsError, TimeoutError):
    """There is no such node, or it does not answer."""


class RefusedError(RobotDynamicsError, ValueError):
    """The node answered that it cannot."""


class DynamicsClient:
    """Speaks to one `dynamics` node; for use in a `with` statement."""

    def __init__(self, node: str = '', timeout: float = TIMEOUT) -> None:
        """`node` is a name with its namespace; empty for the only one that runs."""
        self._wanted = f'/{node.strip("/")}' if node else ''
        self.timeout = timeout
        self.recorder: Recorder | None = None
        """Records messages while the client waits."""
        self._target = ''
        self._context = Context()
        rclpy.init(args=[], context=self._context)
        self.node: Node = rclpy.create_node(
            f'_ros2cli_dynamics_{os.getpid()}', context=self._context,
            start_parameter_services=False, enable_rosout=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)

    def __enter__(self: Client) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    # ------------------------------------------------------------------ the node

    @property
    def name(self) -> str:
        """The full name of the node, which is looked for at first; raises NoAnswerError."""
        if not self._target:
            self._target = self._found()
        return self._target

    def nodes(self) -> list[str]:
        """Return the full names of all `dynamics` nodes that are found in a moment."""
        if self.wait(self._offering):
            self.wait(lambda: False, _SETTLE)
        return self._offering()

    def _found(self) -> str:
        wanted = self._wanted
        if wanted and self.wait(lambda: wanted in self._offering()):
            return wanted
        nodes = self._offering() if wanted else self.nodes()
        running = f'those that run: {", ".join(nodes)}' if nodes else (
            f'none runs with {domain()}; start one with: ros2 run robot_dynamics dynamics_node')
        if wanted or not nodes:
            name = f' {wanted!r}' if wanted else ''
            raise NoAnswerError(f'no dynamics node{name} in {self.timeout:g} s; {running}')
        if len(nodes) > 1:
            raise NoAnswerError(
                f'there are {len(nodes)} dynamics nodes, expected --node with one of: '
                f'{", ".join(nodes)}')
        return nodes[0]

    def _offering(self) -> list[str]:
        return sorted(
            name.removesuffix(_OFFERED)
            for name, kinds in self.node.get_service_names_and_types()
            if name.endswith(_OFFERED) and _SERVICE in kinds)

    @property
    def monitor(self) -> str:
        """The full name of the `dynamics_monitor` next to the node; raises NoAnswerError."""
        name = self.resolve(MONITOR)
        if not self.wait(lambda: self.has_monitor):
            raise NoAnswerError(
                f'no node {name} in {self.timeout:g} s; start it with: {self.start_of_monitor}')
        return name

    @property
    def has_monitor(self) -> bool:
        """Whether the `dynamics_monitor` of the node is discovered."""
        service = f'{self.resolve(MONITOR)}{_OFFERED_BY_MONITOR}'
        return any(name == service for name, _ in self.node.get_service_names_and_types())

    @property
    def start_of_monitor(self) -> str:
        """The command that starts the `dynamics_monitor` of the node."""
        namespace, _, name = self.name.rpartition('/')
        options = [f'-r __ns:={namespace}'] if namespace else []
        options += [] if name == 'dynamics' else [f'-p dynamics:={name}']
        return ' '.join([
            'ros2 run robot_dynamics_tools dynamics_monitor',
            *(['--ros-args', *options] if options else [])])

    # ------------------------------------------------------------------ services and topics

    def call(self, service_type: type, name: str, request: object) -> Any:
        """
        Return the answer of a service; raise NoAnswerError or RefusedError.

        A `name` without a slash at its start is that of a service of the node.
        """
        full = name if name.startswith('/') else f'{self.name}/{name}'
        service = self.node.create_client(service_type, full)
        try:
            if not self.wait(service.service_is_ready):
                raise NoAnswerError(f'no service {full} in {self.timeout:g} s')
            future = service.call_async(request)
            if not self.wait(future.done):
                raise NoAnswerError(f'no answer of {full} in {self.timeout:g} s')
            response = future.result()
        finally:
            self.node.destroy_client(service)
        if getattr(response, 'success', True) is False:
            raise RefusedError(response.message)
        return response

    def parameters(self, names: Sequence[str], node: str = '') -> dict[str, Any]:
        """Return parameters of the node, or of another one, by name; none if one is missing."""
        response = self.call(GetParameters, f'{node or self.name}/get_parameters',
                             GetParameters.Request(names=list(names)))
        return {name: parameter_value_to_python(value)
                for name, value in zip(names, response.values)}

    def set_parameter(self, name: str, value: object, node: str = '') -> None:
        """Set a parameter of the node, or of another one; raise NoAnswerError or RefusedError."""
        service = f'{node or self.name}/set_parameters'
        response = self.call(SetParameters, service, SetParameters.Request(
            parameters=[Parameter(name, value=value).to_parameter_msg()]))
        result, = response.results
        if not result.successful:
            raise RefusedError(result.reason)

    def receive(
        self, message_type: type, topic: str, qos: QoSProfile | int,
        take: Callable[[Any], Answer | None],
    ) -> Answer | None:
        """Return what `take` makes of the first message that it takes; None after the timeout."""
        taken: list[Answer] = []

        def offer(message: Any) -> None:
            answer = take(message)
            if answer is not None:
                taken.append(answer)

        with self.subscribed((message_type, topic, offer, qos)):
            self.wait(lambda: bool(taken))
        return taken[0] if taken else None

    def payloads(self) -> list[InertiaStamped]:
        """Return the messages of the active payloads: those with the newest stamp."""
        taken: list[InertiaStamped] = []
        qos = QoSProfile(depth=32, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        with self.subscribed((InertiaStamped, self.resolve('~/payload'), taken.append, qos)):
            if self.wait(lambda: bool(taken)):
                self.wait(lambda: False, _GLANCE)
        return [one for one in taken if one.header.stamp == taken[-1].header.stamp]

    @contextmanager
    def subscribed(
        self, *topics: tuple[type, str, Callable[[Any], None], QoSProfile | int],
    ) -> Iterator[None]:
        """Pass the messages of topics (type, name, callback, QoS) to the callbacks in `with`."""
        subscriptions = [self.node.create_subscription(*topic) for topic in topics]
        try:
            yield
        finally:
            for subscription in subscriptions:
                self.node.destroy_subscription(subscription)

    def resolve(self, topic: str) -> str:
        """Return the full name of `/topic`, `topic` or `~/topic` as the node resolves it."""
        if topic.startswith('~/'):
            return f'{self.name}/{topic[2:]}'
        return topic if topic.startswith('/') else f'{self.name.rpartition("/")[0]}/{topic}'

    def topics(self) -> list[str]:
        """Return the names of all topics that are discovered together with the node."""
        self.nodes()
        return [name for name, _ in self.node.get_topic_names_and_types()]

    def joint_state_topic(self) -> str:
        """
        Return the topic of the joint states of the node, which may be remapped.

        Other inputs of this type, such as `~/set_point`, are private unless they are remapped.
        """
        namespace, _, name = self.name.rpartition('/')
        usual = self.resolve('joint_states')

        def topics() -> list[str]:
            try:
                found = self.node.get_subscriber_names_and_types_by_node(name, namespace or '/')
            except NodeNameNonExistentError:  # not discovered yet
                return []
            return [topic for topic, kinds in found if 'sensor_msgs/msg/JointState' in kinds
                    and not topic.startswith(f'{self.name}/')]

        self.wait(topics, _GLANCE)
        found = topics()
        return usual if usual in found else next(iter(found), usual)

    def wait(self, is_so: Callable[[], object], timeout: float | None = None) -> bool:
        """Receive messages until `is_so` or the timeout [s], by default that of the client."""
        deadline = time.monotonic() + (self.timeout if timeout is None else timeout)
        while True:
            self.on_turn()
            if is_so():
                return True
            if time.monotonic() > deadline:
                return False
            with uninterrupted():
                self._executor.spin_once(timeout_sec=_TURN)

    def on_turn(self) -> None:
        """Do what is due again and again during a wait: record the waiting messages."""
        if self.recorder is not None:
            self.recorder.drain()

    # ------------------------------------------------------------------ the arm

    def joint_names(self) -> list[str]:
        """Return the joints in the node's order: a batch without samples is answered with them."""
        return list(self.call(
            InverseDynamicsBatch, 'inverse_dynamics_batch',
            InverseDynamicsBatch.Request()).joint_names)

    def description(self) -> str:
        """
        Return the URDF that the node uses: of its parameters, of the topic, or the embedded one.

        Raises ModelError where it is in a file that is not on this machine.
        """
        from robot_dynamics.planar.urdf import default_arm_urdf
        from robot_dynamics.ros.parameters.robot_description import description_from_parameters
        xml = description_from_parameters(
            self.parameters(['robot_description', 'robot_description_file']))
        if xml is None:
            topic = f'{self.name.rpartition("/")[0]}/robot_description'
            if self.wait(lambda: self.node.count_publishers(topic), _GLANCE):
                xml = self.receive(String, topic, LATCHED, lambda message: str(message.data))
        return default_arm_urdf() if xml is None else xml

    def joints(self) -> dict[str, 'UrdfJoint']:
        """Return the joints of the URDF by name; empty if the URDF is not available."""
        from robot_dynamics.urdf.parser import parse_urdf
        try:
            robot = parse_urdf(self.description())
        except RobotDynamicsError:
            return {}
        return {joint.name: joint for joint in robot.joints}

    def joint_kinds(self) -> dict[str, str]:
        """Return the kinds of joints by name; empty if the URDF is not available."""
        return {name: joint.kind for name, joint in self.joints().items()}
