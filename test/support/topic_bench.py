# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A node `dynamics` on the default arm, its joint states, references and published topics."""

from dataclasses import dataclass
from typing import Any

from builtin_interfaces.msg import Time
import numpy as np
from ros_harness import Collector, NodeProcess, RosClient
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NAMES = ['joint1', 'joint2']
Q, V = [np.pi / 4, np.pi / 6], [0.5, 0.3]
G = [-49.52282521, -11.37087883]
TAU = [-48.74713301, -10.95795578]


@dataclass
class Bench:
    """A node, a publisher of its joint states, and collectors of the topics that it publishes."""

    client: RosClient
    node: NodeProcess
    namespace: str
    states: Any
    trajectories: Any
    efforts: Collector
    gravity: Collector
    computed_torque: Collector
    next_second: int = 0

    def state(self, q: Any = Q, v: Any = V, names: Any = None) -> JointState:
        """
        Return a joint state with a unique stamp.

        Its default position changes from state to state: an arm in motion repeats no sample.
        """
        self.next_second += 1
        if q is Q:
            q = [each + 2.5e-16 * (self.next_second % 16) for each in Q]
        message = JointState(name=names or NAMES, position=q, velocity=v)
        message.header.stamp = Time(sec=self.next_second, nanosec=123_456_789)
        return message

    def command(self, state: JointState) -> Any:
        """Return the effort command for a state."""
        return self.client.answer_to(self.states, state, self.efforts)

    def topic(self, name: str) -> str:
        return f'{self.namespace}/{name}'

    def follow(self, point: JointTrajectoryPoint) -> None:
        """Send a set-point."""
        self.trajectories.publish(JointTrajectory(joint_names=NAMES, points=[point]))


def make_bench(client: RosClient, node: NodeProcess, namespace: str) -> Bench:
    efforts, gravity, computed_torque = (
        client.collect(JointState, f'{namespace}/{topic}') for topic in (
            'effort_command', 'dynamics/gravity_compensation', 'dynamics/computed_torque'))
    for collector in (efforts, gravity, computed_torque):
        collector.wait_matched()
    return Bench(
        client, node, namespace,
        client.publisher(JointState, f'{namespace}/joint_states', 1),
        client.publisher(JointTrajectory, f'{namespace}/dynamics/joint_trajectory'),
        efforts, gravity, computed_torque)
