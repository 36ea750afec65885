# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes of this package in the process of a test, in an executor that the test chooses."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import itertools
import threading
import time
from typing import Any

from children import TIMEOUT
import rclpy
from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node
from rclpy.parameter import Parameter
from robot_dynamics.ros.dynamics.node import DynamicsNode
from robot_dynamics.ros.simulated_arm.node import SimulatedArmNode
from ros_harness import Collector, has_stamp, RosClient
from sensor_msgs.msg import JointState

COUNTER = itertools.count()


class OwnProcess:
    """A context of this process, with its own namespace, whose nodes an executor spins."""

    def __init__(self, context: Context) -> None:
        self.context, self.nodes = context, list[Node]()
        self.namespace = f'/own{next(COUNTER)}'

    def dynamics(self, **parameters: Any) -> DynamicsNode:
        """Return a node `dynamics`."""
        return self.add(DynamicsNode(**self._arguments(parameters)))

    def simulated_arm(self, **parameters: Any) -> SimulatedArmNode:
        """Return a node `simulated_arm`."""
        return self.add(SimulatedArmNode(**self._arguments(parameters)))

    def other(self, name: str) -> Node:
        """Return a node of rclpy."""
        return self.add(rclpy.create_node(name, context=self.context, namespace=self.namespace))

    def add(self, node: Any) -> Any:
        """Return a node that `spun` destroys."""
        self.nodes.append(node)
        return node

    def destroy_nodes(self) -> None:
        """Destroy the nodes: others find a node until then, also after its context has ended."""
        while self.nodes:
            self.nodes.pop().destroy_node()

    def _arguments(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        return {
            'context': self.context, 'namespace': self.namespace,
            'parameter_overrides': [
                Parameter(name, value=value) for name, value in parameters.items()]}

    @contextmanager
    def spun(self, make: Callable[..., Executor]) -> Iterator[None]:
        """Let an executor spin the nodes in a thread until the end of the statement."""
        executor = make(context=self.context)
        for node in self.nodes:
            executor.add_node(node)
        ended = threading.Event()
        thread = threading.Thread(target=_spin, args=(executor, ended), daemon=True)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            executor.wake()
            thread.join(TIMEOUT)
            self.destroy_nodes()
            executor.shutdown()
        assert not thread.is_alive()


def _spin(executor: Executor, ended: threading.Event) -> None:
    while not ended.is_set():
        try:
            executor.spin_once(timeout_sec=0.2)
        except ExternalShutdownException:
            return


@contextmanager
def own_process() -> Iterator[OwnProcess]:
    """Yield a context for nodes; shut it down at the end."""
    context = Context()
    rclpy.init(args=[], context=context)
    process = OwnProcess(context)
    try:
        yield process
    finally:
        process.destroy_nodes()
        rclpy.try_shutdown(context=context)


def answer(
    client: RosClient, process: OwnProcess, names: Sequence[str], q: Sequence[float],
) -> Any:
    """Publish a joint state at rest until its gravity compensation arrives; return that."""
    state = JointState(name=list(names), position=list(q), velocity=[0.0] * len(q))
    state.header.stamp.sec = 1
    deadline = time.monotonic() + TIMEOUT
    while True:
        with client.collect(
                JointState, f'{process.namespace}/dynamics/gravity_compensation') as answers:
            states = client.publisher(JointState, f'{process.namespace}/joint_states')
            try:
                return client.ask(
                    states, state, answers, has_stamp(state.header.stamp), TIMEOUT / 6.0)
            except AssertionError:  # then with another subscription and publisher
                if time.monotonic() > deadline:
                    raise
            finally:
                client.node.destroy_publisher(states)


def stamps_of(collector: Collector) -> list[int]:
    """Return the stamps [ns] of the messages so far."""
    return [message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            for message in collector.messages]
