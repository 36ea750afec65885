# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Who publishes joint states and the pose of the base, receives efforts, and commands them."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import qos_profile_sensor_data
from rclpy.topic_endpoint_info import TopicEndpointInfo
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.ros.dynamics.base_gravity import gravity_from_imu
from robot_dynamics.ros.middleware.graph_watch import full_name
from robot_dynamics_tools.connect.checks import BAD, Checklist, GOOD, UNKNOWN
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError
from sensor_msgs.msg import Imu

JOINT_STATE, NUMBERS = 'sensor_msgs/msg/JointState', 'std_msgs/msg/Float64MultiArray'
IMU = 'sensor_msgs/msg/Imu'
COMMANDS = '/commands'
"""End of the topics of ros2_control controllers."""
ASKED = 'joints', 'interface_name', 'command_timeout'
"""Parameters of a receiver: of controllers of ros2_control, and of `simulated_arm`."""


class Receiver(NamedTuple):
    """
    A topic of efforts, and the node that subscribes to it.

    `joints` and `interface` are those of a controller of ros2_control, `timeout` [s] the
    `command_timeout` of `simulated_arm`; empty and None if the node does not state them.
    """

    topic: str
    node: str
    joints: Sequence[str]
    interface: str
    timeout: float | None

    @property
    def is_controller(self) -> bool:
        return self.topic.endswith(COMMANDS)

    @property
    def remap(self) -> str:
        """The remapping of `dynamics_node` to this topic."""
        return f'{"~/commands" if self.is_controller else "effort_command"}:={self.topic}'

    def __str__(self) -> str:
        claimed = ', '.join(f'{joint}/{self.interface}' for joint in self.joints)
        return f'{self.topic} to {self.node}' + (f', for {claimed}' if claimed else '')


def names_of(ends: Sequence[TopicEndpointInfo]) -> list[str]:
    """Return the full names of the nodes of publishers or subscriptions."""
    return sorted(full_name(end.node_name, end.node_namespace) for end in ends)


def publishers(client: DynamicsClient, topic: str) -> str:
    """Return the full names of the nodes that publish a topic."""
    return ', '.join(names_of(client.node.get_publishers_info_by_topic(topic)))


def topic_of_states(client: DynamicsClient, given: str | None) -> str:
    """Return the topic of the joint states; raise NoAnswerError or InvalidInputError."""
    def published() -> list[str]:
        return [name for name, kinds in client.node.get_topic_names_and_types()
                if JOINT_STATE in kinds and client.node.count_publishers(name)]

    def found() -> list[str]:
        return [name for name in published()
                if (name == given if given else name.endswith('joint_states'))]

    if client.wait(found):
        client.wait(lambda: False, 0.5)  # others may be discovered later
    topics = found()
    if not topics:
        raise NoAnswerError(
            f'no joint states on {given or "a topic .../joint_states"} in {client.timeout:g} s; '
            f'published topics of this type: {", ".join(published()) or "none"}. Start the '
            'driver, name the topic with --topic, or set the ROS_DOMAIN_ID of the robot')
    if len(topics) > 1 and '/joint_states' not in topics:
        raise InvalidInputError(
            f'there are joint states on {", ".join(topics)}, expected --topic with one of them')
    return topics[0] if len(topics) == 1 else '/joint_states'


def check_publishers(
    client: DynamicsClient, topic: str, layouts: Sequence[tuple[str, ...]], checks: Checklist,
) -> None:
    """Check that each joint of the joint states has one publisher."""
    count = client.node.count_publishers(topic)
    checks.add(
        'joint states', BAD if count > 1 and len(layouts) < count else True,
        f'{topic} of {publishers(client, topic)}', 'one publisher per joint',
        'end all but one of them')


def find_receiver(
    client: DynamicsClient, given: str | None, namespace: str, is_needed: bool, checks: Checklist,
) -> Receiver | None:
    """Return who receives efforts, None without a receiver; `given` is a topic."""
    usual, found, node = given or f'{namespace}/effort_command', list[Receiver](), client.node
    for topic, kinds in node.get_topic_names_and_types():
        nodes = names_of(node.get_subscriptions_info_by_topic(topic))
        if nodes and (topic == usual or not given and NUMBERS in kinds
                      and topic.endswith(COMMANDS)):
            joints, interface, timeout = _parameters(client, nodes[0])
            found.append(Receiver(
                topic, nodes[0], joints or (), interface or 'effort', timeout))
    fit = [one for one in found if one.interface == 'effort']
    chosen = [one for one in fit if one.topic == usual] or fit
    checks.add(
        'receiver', len(chosen) == 1 or (BAD if is_needed else False),
        '; '.join(map(str, found)) or 'none', f'one receiver of efforts, {usual}' + (
            '' if given else ' or an effort controller'),
        'name the topic with --receiver; start the driver or its effort controller')
    if len(chosen) != 1:
        return None
    if any(name.endswith('/list_controllers') for name, _ in node.get_service_names_and_types()):
        checks.add('controllers', UNKNOWN, 'their states were not read', 'active, effort claimed',
                   'ros2 control list_controllers --claimed-interfaces')
    timeout, keeps_last = chosen[0].timeout, chosen[0].is_controller
    checks.add(
        'watchdog', False if keeps_last else UNKNOWN if timeout is None else GOOD,
        'none: the last command stays active' if keeps_last else
        'not stated by the receiver' if timeout is None else f'after {timeout:g} s',
        'the arm is braked soon after the last command',
        'brakes or another controller must hold the arm if dynamics_node is killed')
    return chosen[0]


def _parameters(client: DynamicsClient, node: str) -> list[Any]:
    """Return the values of ASKED of a node, None for those that it does not have."""
    service, found = f'{node}/get_parameters', list[Any]()
    exists = any(name == service for name, _ in client.node.get_service_names_and_types())
    for name in ASKED:  # one by one: an undeclared one prevents the answer for others
        found.append(None)
        with suppress(RobotDynamicsError, IndexError):
            if exists:
                found[-1] = parameter_value_to_python(client.call(
                    GetParameters, service, GetParameters.Request(names=[name])).values[0])
    return found


def commanding(client: DynamicsClient, receiver: Receiver | None) -> list[str]:
    """Return the nodes that publish to a receiver of efforts."""
    return [] if receiver is None else names_of(
        client.node.get_publishers_info_by_topic(receiver.topic))


def gravity_of_imu(
    client: DynamicsClient, arm: ArmModel, checks: Checklist,
) -> tuple[FloatArray, str] | None:
    """Return gravity (3,) [m/s²] by an IMU that the description fixes to the base, and which."""
    for topic, kinds in client.node.get_topic_names_and_types():
        if IMU not in kinds or not client.node.count_publishers(topic):
            continue
        message = client.receive(Imu, topic, qos_profile_sensor_data, lambda one: one)
        frame = '' if message is None else message.header.frame_id
        try:
            place = arm.link_frame(frame)
            if message is None or place.parentJoint:
                continue  # silent, or of a link that moves
            gravity = place.placement.rotation @ gravity_from_imu(
                message, float(np.linalg.norm(arm.gravity)))
        except InvalidInputError as error:
            checks.add('IMU', UNKNOWN, f'{topic}: {error}', 'a link that is fixed to the base',
                       'state the mount: --gravity X Y Z')
            continue
        gravity *= np.linalg.norm(arm.gravity) / np.linalg.norm(gravity)
        checks.add('IMU', GOOD, f'{topic} of {frame}: gravity ({gravity.round(2).tolist()})',
                   'at rest')
        return gravity, topic
    return None
