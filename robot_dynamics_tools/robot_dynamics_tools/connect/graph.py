# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Who publishes joint states, who receives efforts, and which nodes command them already."""

from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

from rcl_interfaces.srv import GetParameters
from rclpy.topic_endpoint_info import TopicEndpointInfo
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.ros.middleware.graph_watch import full_name
from robot_dynamics_tools.connect.checklist import BAD, Checklist
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError

JOINT_STATE, NUMBERS = 'sensor_msgs/msg/JointState', 'std_msgs/msg/Float64MultiArray'
COMMANDS = '/commands'
"""End of the topics of ros2_control controllers."""


class Receiver(NamedTuple):
    """A topic of efforts, the nodes that subscribe to it, and the joints of a controller."""

    topic: str
    nodes: tuple[str, ...]
    joints: tuple[str, ...] = ()

    @property
    def remap(self) -> str:
        """The remapping of `dynamics_node` to this topic."""
        name = '~/commands' if self.topic.endswith(COMMANDS) else 'effort_command'
        return f'{name}:={self.topic}'


def topic_of_states(client: DynamicsClient, given: str | None) -> str:
    """Return the topic of the joint states; raise NoAnswerError or InvalidInputError."""
    def found() -> list[str]:
        return [name for name, kinds in client.node.get_topic_names_and_types()
                if JOINT_STATE in kinds and client.node.count_publishers(name)
                and (name == given if given else name.endswith('joint_states'))]

    if client.wait(found):
        client.wait(lambda: False, 0.5)  # others may be discovered later
    topics = found()
    if not topics:
        others = [name for name, kinds in client.node.get_topic_names_and_types()
                  if JOINT_STATE in kinds]
        raise NoAnswerError(
            f'no joint states on {given or "a topic .../joint_states"} in {client.timeout:g} s; '
            f'topics of this type: {", ".join(others) or "none"}. Start the driver, name the '
            'topic with --topic, or set the ROS_DOMAIN_ID of the robot')
    if len(topics) > 1 and '/joint_states' not in topics:
        raise InvalidInputError(
            f'there are joint states on {", ".join(topics)}, expected --topic with one of them')
    return topics[0] if len(topics) == 1 else '/joint_states'


def check_publishers(
    client: DynamicsClient, topic: str, layouts: Sequence[tuple[str, ...]], checks: Checklist,
) -> None:
    """Check that each joint of the joint states has one publisher."""
    nodes = names_of(client.node.get_publishers_info_by_topic(topic))
    is_shared = len(nodes) > 1 and len(layouts) < len(nodes)
    checks.add(
        'joint states', BAD if is_shared else True, f'{topic} of {", ".join(nodes)}',
        'one publisher per joint', 'end all but one of them')


def names_of(ends: Sequence[TopicEndpointInfo]) -> list[str]:
    """Return the full names of the nodes of publishers or subscriptions."""
    return sorted(full_name(end.node_name, end.node_namespace) for end in ends)


def find_receiver(
    client: DynamicsClient, given: str | None, namespace: str, checks: Checklist,
) -> Receiver | None:
    """Return who receives efforts, None without a receiver; `given` is a topic."""
    usual = f'{namespace}/effort_command'
    topics = [name for name, kinds in client.node.get_topic_names_and_types()
              if name == (given or usual) or not given and NUMBERS in kinds
              and name.endswith(COMMANDS)]
    found = []
    for topic in topics:
        nodes = names_of(client.node.get_subscriptions_info_by_topic(topic))
        if nodes:
            joints = _joints_of(client, nodes[0]) if topic.endswith(COMMANDS) else ()
            found.append(Receiver(topic, tuple(nodes), joints))
    chosen = [one for one in found if one.topic == usual] or found
    checks.add(
        'receiver', len(chosen) == 1, '; '.join(
            f'{one.topic} to {", ".join(one.nodes)}' + (
                f' with the joints {", ".join(one.joints)}' if one.joints else '')
            for one in found) or 'none', f'one receiver of efforts, {usual} or a controller',
        'name the topic with --receiver; start the driver or its effort controller')
    return chosen[0] if len(chosen) == 1 else None


def _joints_of(client: DynamicsClient, controller: str) -> tuple[str, ...]:
    with suppress(RobotDynamicsError):
        response = client.call(GetParameters, f'{controller}/get_parameters',
                               GetParameters.Request(names=['joints']))
        return tuple(response.values[0].string_array_value) if response.values else ()
    return ()


def commanding(client: DynamicsClient, receiver: Receiver | None) -> list[str]:
    """Return the nodes that publish to a receiver of efforts."""
    return [] if receiver is None else names_of(
        client.node.get_publishers_info_by_topic(receiver.topic))
