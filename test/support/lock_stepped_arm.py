# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A running `simulated_arm` in lock-step, whose controller is the test."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from closed_loop import NAMES, START
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from ros_harness import KEEP_MANY, NodeProcess, RosClient, SIMULATED_ARM
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState


class LockStepped:
    """A simulated arm that waits for each effort, and its newest state."""

    def __init__(self, client: RosClient, node: NodeProcess, namespace: str) -> None:
        self.client, self.node, self.namespace = client, node, namespace
        self.states = client.collect(JointState, f'{namespace}/joint_states', KEEP_MANY)
        self.motors = client.collect(
            JointState, f'{namespace}/simulated_arm/motor_states', KEEP_MANY)
        self.clock = client.collect(Clock, f'{namespace}/clock', KEEP_MANY)
        self.efforts = client.publisher(JointState, f'{namespace}/effort_command', 1)
        self.state = self.states.wait_for()

    def step(self, effort: Any, names: Any = None) -> JointState:
        """Answer the newest state; return the state that follows."""
        answer = JointState(header=self.state.header, name=names or NAMES, effort=effort)
        before = stamp_from_ros(self.state.header.stamp)
        self.state = self.client.ask(
            self.efforts, answer, self.states,
            lambda message: stamp_from_ros(message.header.stamp) > before)
        self.states.clear()
        return self.state


@contextmanager
def lock_stepped(client: RosClient, namespace: str, **parameters: Any) -> Iterator[LockStepped]:
    """Run an arm at `START`, with a separate clock."""
    with NodeProcess(
            SIMULATED_ARM, {'lock_step': True, 'initial_position': START, **parameters},
            namespace=namespace, remaps={'/clock': f'{namespace}/clock'}) as node:
        yield LockStepped(client, node, namespace)
