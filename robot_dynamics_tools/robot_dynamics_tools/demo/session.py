# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Code of both kinds of demo: the topics, the nodes, a recorder, and an orderly shutdown."""

from collections.abc import Callable, Sequence
from pathlib import Path
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import InertiaStamped
from robot_dynamics_interfaces.msg import DynamicsTerms
from robot_dynamics_tools.processes import NodeError, Nodes
from robot_dynamics_tools.recorder import Recorder, TopicSpec, write_description
from robot_dynamics_tools.recordings.topics import ROBOT_DESCRIPTION, TopicQos
from robot_dynamics_tools.recordings.writer import RecordingWriter
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

RECORDING, DESCRIPTION, PICTURE, REPORT = 'recording', 'robot.urdf', 'demo.png', 'report.html'
"""Files in the directory of a demo."""
START_TIMEOUT = 60.0
"""[s] for the start of the nodes, and between two efforts on a busy machine."""
DRAIN_PERIOD = 0.01
"""[s]"""


class Session(DynamicsClient):
    """A client of the nodes of the demo, which records all topics while it waits."""

    JOINT_STATES, EFFORT_COMMAND = '/joint_states', '/effort_command'
    GRAVITY = '/dynamics/gravity_compensation'
    COMPUTED_TORQUE = '/dynamics/computed_torque'
    TERMS = '/dynamics/terms'
    TRAJECTORY = '/dynamics/joint_trajectory'
    TOPICS = (
        *(TopicSpec(name, JointState, stamped=True) for name in (
            JOINT_STATES, EFFORT_COMMAND, GRAVITY, COMPUTED_TORQUE)),
        TopicSpec('/dynamics/commands', Float64MultiArray),
        TopicSpec(TERMS, DynamicsTerms, stamped=True),
        TopicSpec('/dynamics/payload', InertiaStamped, qos=TopicQos(transient_local=True)),
        TopicSpec(TRAJECTORY, JointTrajectory),
        TopicSpec('/diagnostics', DiagnosticArray, qos=TopicQos(depth=10)))
    """The recorded topics: commands of `dynamics`, and the joint states for them."""
    recorder: Recorder

    def __init__(
        self, directory: Path, urdf: str, topics: Sequence[TopicSpec] = (),
        time_ns: Callable[[], int] | None = None,
    ) -> None:
        """
        Record to `directory`/recording, under the time `time_ns` of a playback.

        `topics` are recorded in addition to TOPICS. The recording begins with the URDF, as any
        viewer and `--replay` expect it. `processes` start later.
        """
        self._writer = RecordingWriter(directory / RECORDING)
        super().__init__('dynamics', START_TIMEOUT)
        self.processes = Nodes(directory)
        self.recorder = Recorder(self.node, self._writer, (*self.TOPICS, *topics), time_ns)
        write_description(self._writer, ROBOT_DESCRIPTION, urdf, (time_ns or time.time_ns)())

    def __exit__(self, *error: object) -> None:
        """Stop the nodes, record what they have sent, then close the recording."""
        with self._writer:
            try:
                self.processes.stop()
            finally:
                self.recorder.close()
                super().__exit__(*error)

    def on_turn(self) -> None:
        """Record the waiting messages; raise NodeError if a node has ended."""
        self.processes.check()
        super().on_turn()

    def wait_for(self, condition: Callable[[], object], what: str) -> None:
        """Record until `condition` holds; raise NodeError at START_TIMEOUT or if a node ends."""
        if not self.wait(condition):
            raise NodeError(f'{START_TIMEOUT:g} s passed without {what}.\n{self.processes.logs()}')

    def call(self, service_type: type, name: str, request: object) -> Any:
        """Return the response of a service; raise NodeError without one."""
        try:
            return super().call(service_type, name, request)
        except NoAnswerError as error:
            raise NodeError(f'{error}.\n{self.processes.logs()}') from None

    def record(self) -> None:
        """Record for a moment; raise NodeError if a node has ended."""
        self.wait(lambda: False, DRAIN_PERIOD)
