# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Why no joint states arrive, or nothing receives the command, and the setting that helps."""

from collections.abc import Callable, Sequence
import math
import os
import time

from rclpy.node import Node
from robot_dynamics.ros.middleware.graph_watch import full_name, OBSERVER, subscribers

PATIENCE = 1.5
"""[s] in which publishers and subscribers may still be discovered."""
JOINT_STATE, NUMBERS = 'sensor_msgs/msg/JointState', 'std_msgs/msg/Float64MultiArray'


class Silence:
    """Something that may be missing: each reason is logged once, after PATIENCE."""

    def __init__(self, log: Callable[[str], object]) -> None:
        """Begin with something that is missing; `log` gets the reasons."""
        self._log, self._since, self._logged = log, time.monotonic(), set[str]()

    def reason(self, found: str) -> str:
        """
        Return the reason that is `found` at present, empty before PATIENCE.

        An empty `found` states that nothing is missing.
        """
        now = time.monotonic()
        if not found:
            self._since = math.inf
            self._logged.clear()
        self._since = min(self._since, now)
        if now - self._since < PATIENCE:
            return ''
        if found not in self._logged:  # the first one may precede a discovery
            self._logged.add(found)
            self._log(found)
        return found


def no_states(
    node: Node, expected: Sequence[str], received: Sequence[str] | None,
) -> str:
    """
    Return why no joint states of the joints `expected` arrive.

    `received` are the joints of the last message without any of them, None without a message.
    """
    topic = node.resolve_topic_name('joint_states')
    publishers = sorted(full_name(end.node_name, end.node_namespace)
                        for end in node.get_publishers_info_by_topic(topic))
    others = [name for name, kinds in node.get_topic_names_and_types()
              if name.endswith('joint_states') and name != topic and JOINT_STATE in kinds
              and node.count_publishers(name)]
    remap = f'`-r joint_states:={others[0] if others else "TOPIC"}`'
    if publishers and received is not None:
        return (f'{topic} of {", ".join(publishers)} has the joints {list(received)}, expected '
                f'{list(expected)}: set {remap}, or the description of this robot, and `joints`')
    if publishers:
        return (f'{topic} is published by {", ".join(publishers)}, which sends nothing: start '
                'its driver, or activate its controller')
    if others:
        return f'{topic} has no publisher, but {", ".join(others)}: set {remap}'
    own = node.get_fully_qualified_name()
    nodes = sorted({full_name(*one) for one in node.get_node_names_and_namespaces()} - {own})
    nodes = [name for name in nodes if not OBSERVER.search(name)]
    if nodes:
        return (f'{topic} has no publisher, only these nodes run: {", ".join(nodes)}. Start the '
                f'driver, or set {remap}')
    return (f'no other node is found with {domain()}: start the driver, or set the ROS_DOMAIN_ID '
            'of the robot')


def domain() -> str:
    """Return the environment variables that decide which nodes are found."""
    reach = os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE')
    return f'ROS_DOMAIN_ID={os.environ.get("ROS_DOMAIN_ID") or 0}' + (
        f' ROS_AUTOMATIC_DISCOVERY_RANGE={reach}' if reach else '')


def no_receiver(node: Node, topics: Sequence[str]) -> str:
    """Return why nothing receives the command on `topics`, empty if something may."""
    found = [subscribers(node, topic) for topic in topics]
    if any(receivers for receivers, _ in found):
        return ''
    observers = sorted({name for _, names in found for name in names})
    nothing = f'nothing subscribes to {" or ".join(topics)}' + (
        f' except {", ".join(observers)}, which only observe' if observers else '')
    for ours, kind, end in (('effort_command', JOINT_STATE, 'effort_command'),
                            ('~/commands', NUMBERS, '/commands')):
        others = [name for name, kinds in node.get_topic_names_and_types()
                  if name.endswith(end) and kind in kinds and subscribers(node, name)[0]]
        if others:
            return f"{nothing}, but to {', '.join(others)}: set `-r '{ours}:={others[0]}'`"
    return (f'{nothing}: start the driver, or its effort '
            "controller with `-r '~/commands:=/CONTROLLER/commands'`")
