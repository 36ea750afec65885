# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Other nodes that interfere: publishers of the same topics, and nodes of the same full name."""

from collections.abc import Mapping
import math
import re
import time

from rclpy.node import Node
from robot_dynamics.ros.middleware.diagnostics import OK, Status, WARN
from robot_dynamics.ros.middleware.joint_state_loop import LOG_PERIOD

LOOK_PERIOD = 1.0
"""[s] between two queries of the graph."""
NAME = 'other nodes'
OBSERVER = re.compile(
    r'/(_[a-z]|dynamics_monitor|foxglove_|plotjuggler|rosbag2_|rqt|rviz|viewer)[^/]*$')
"""Full names of nodes that show or record topics; those of ros2cli begin with an underscore."""


def full_name(name: str, namespace: str) -> str:
    """Return the full name of a node."""
    return f'{namespace.rstrip("/")}/{name}'


def subscribers(node: Node, topic: str) -> tuple[list[str], list[str]]:
    """Return the full names of the nodes that subscribe to a topic: receivers, observers."""
    found = sorted({full_name(end.node_name, end.node_namespace)
                    for end in node.get_subscriptions_info_by_topic(topic)})
    return ([name for name in found if not OBSERVER.search(name)],
            [name for name in found if OBSERVER.search(name)])


class GraphWatch:
    """Logs other publishers of a node's topics, and other nodes of the same full name."""

    def __init__(self, node: Node, topics: Mapping[str, str], remedy: str) -> None:
        """
        Watch the full names in `topics`, each of which this node publishes once.

        The keys of `topics` name the topics in the diagnostics. `remedy` is the sentence in the
        log about the remedy for another publisher.
        """
        self._node, self._topics, self._remedy = node, topics, remedy
        self._name = node.get_fully_qualified_name()
        self._findings: list[str] = []
        self._reported: list[str] = []
        self._figures: dict[str, int] = {}
        self._looked_at = self._reported_at = -math.inf

    def status(self) -> Status:
        """Return the findings for the diagnostics; query the graph at most once per second."""
        self.query()
        level, words = (WARN, '; '.join(self._findings)) if self._findings else (
            OK, 'no other publisher or node of this name')
        return Status(NAME, level, words, self._figures)

    def query(self) -> None:
        """Query the graph, at most once per second, and log changes."""
        now = time.monotonic()
        if now - self._looked_at < LOOK_PERIOD:
            return
        self._looked_at = now
        nodes = [full_name(name, namespace)
                 for name, namespace in self._node.get_node_names_and_namespaces()]
        self._figures = {'nodes of this name': nodes.count(self._name)}
        self._findings = [] if nodes.count(self._name) < 2 else [
            f'another node is named {self._name}']
        for key, topic in self._topics.items():
            count = self._node.count_publishers(topic)
            self._figures[f'publishers of {key}'] = count
            if count > 1:
                names = sorted(full_name(end.node_name, end.node_namespace)
                               for end in self._node.get_publishers_info_by_topic(topic))
                if self._name in names:
                    names.remove(self._name)
                self._findings.append(f'{topic} has other publishers: {names}')
        if self._findings != self._reported and now - self._reported_at >= LOG_PERIOD:
            self._reported, self._reported_at = self._findings, now
            if self._findings:
                self._node.get_logger().warning(
                    f'{"; ".join(self._findings)}. {self._remedy} Nodes need different names: '
                    '`-r __node:=NAME` or `-r __ns:=/NAMESPACE` after --ros-args. A process that '
                    'was killed stays listed for up to 20 s.')
            else:
                self._node.get_logger().info(
                    'There is no other publisher or node of this name any more.')
