# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Code of both kinds of demo: the topics, the nodes, a recorder, and an orderly shutdown."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import math
from pathlib import Path
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import InertiaStamped
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from robot_dynamics.recordings.interrupts import uninterrupted
from robot_dynamics.recordings.reader import RecordingWriter, TopicQos
from robot_dynamics.ros.recorder import (
    interface_definitions,
    Recorder,
    TopicSpec,
    write_description,
)
from robot_dynamics.tools.demo.processes import DemoError, Nodes
from robot_dynamics_interfaces.msg import DynamicsTerms
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

RECORDING = 'recording'
DESCRIPTION = 'robot.urdf'
PICTURE = 'demo.png'
REPORT = 'report.html'

JOINT_STATES = '/joint_states'
EFFORT_COMMAND = '/effort_command'
GRAVITY = '/dynamics/gravity_compensation'
COMPUTED_TORQUE = '/dynamics/computed_torque'
TERMS = '/dynamics/terms'
TRAJECTORY = '/dynamics/joint_trajectory'
ROBOT_DESCRIPTION = '/robot_description'

TOPICS = (
    TopicSpec(JOINT_STATES, JointState, stamped=True),
    TopicSpec(EFFORT_COMMAND, JointState, stamped=True),
    TopicSpec(GRAVITY, JointState, stamped=True),
    TopicSpec(COMPUTED_TORQUE, JointState, stamped=True),
    TopicSpec('/dynamics/commands', Float64MultiArray),
    TopicSpec(TERMS, DynamicsTerms, stamped=True),
    TopicSpec('/dynamics/payload', InertiaStamped, qos=TopicQos(transient_local=True)),
    TopicSpec(TRAJECTORY, JointTrajectory),
    TopicSpec('/diagnostics', DiagnosticArray, qos=TopicQos(depth=10)),
)
"""The recorded topics: commands of `dynamics`, and the joint states for them."""
CLOCK = TopicSpec('/clock', Clock, qos=TopicQos(depth=10))

START_TIMEOUT = 60.0
"""[s] for the start of the nodes, and between two efforts on a busy machine."""
ANSWER_PERIOD = 1.0
"""[s] after which a request without a response is sent again."""
DRAIN_PERIOD = 0.01
"""[s]"""


@dataclass
class Session:
    """A node of the demo in its own context, with the recorder of all topics."""

    node: Node
    recorder: Recorder
    nodes: Nodes
    directory: Path

    def wait_for(self, condition: Callable[[], bool], what: str) -> None:
        """Record until `condition` holds; raise DemoError at START_TIMEOUT or if a node ends."""
        deadline = time.monotonic() + START_TIMEOUT
        while not condition():
            self.record(DRAIN_PERIOD)
            if time.monotonic() > deadline:
                raise DemoError(
                    f'{START_TIMEOUT:g} s passed without {what}.\n{self.nodes.logs()}')

    def call(self, service_type: type, name: str, request: object) -> Any:
        """
        Return the response of a service that may be called twice, and record meanwhile.

        Raises DemoError after START_TIMEOUT or if a node ends.
        """
        client = self.node.create_client(service_type, name)
        executor = SingleThreadedExecutor()
        executor.add_node(self.node)
        futures: list[Any] = []
        due = -math.inf

        def has_answer() -> bool:
            nonlocal due
            if time.monotonic() > due and client.service_is_ready():
                futures.append(client.call_async(request))
                due = time.monotonic() + ANSWER_PERIOD
            with uninterrupted():
                executor.spin_once(timeout_sec=0.0)
            return any(future.done() for future in futures)

        try:
            self.wait_for(has_answer, f'a response of {name}')
            return next(future.result() for future in futures if future.done())
        finally:
            executor.remove_node(self.node)
            executor.shutdown()
            self.node.destroy_client(client)

    def record(self, seconds: float) -> None:
        """Record the waiting messages, then wait; raise DemoError if a node has ended."""
        self.nodes.check()
        self.recorder.drain()
        time.sleep(seconds)


@contextmanager
def recording_session(
    directory: Path, urdf: str, topics: Sequence[TopicSpec] = TOPICS,
    time_ns: Callable[[], int] | None = None,
) -> Iterator[Session]:
    """
    Yield a session that records to `directory`/recording; the nodes stop before it is closed.

    The recording begins with the URDF, as any viewer and `--replay` expect it.
    """
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    definitions = interface_definitions('robot_dynamics_interfaces', ['DynamicsTerms'])
    node = rclpy.create_node('demo', start_parameter_services=False, enable_rosout=False)
    try:
        with RecordingWriter(directory / RECORDING, definitions) as writer:
            recorder = Recorder(node, writer, topics, time_ns)
            now = time.time_ns() if time_ns is None else time_ns()
            write_description(writer, ROBOT_DESCRIPTION, urdf, now)
            try:
                with Nodes(directory) as nodes:
                    yield Session(node, recorder, nodes, directory)
            finally:
                recorder.close()
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
