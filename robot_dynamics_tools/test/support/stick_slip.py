# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A joint of the running simulated arm that a slow spring moves to and fro, recorded to a bag.

The arm runs in lock-step, so that the motion does not depend on the speed of this machine. The
figure of the documentation shows the run.
"""

from pathlib import Path
import threading

import numpy as np
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics_tools.recorder import Recorder, TopicSpec
from robot_dynamics_tools.recordings.joint_series import JointSeries
from robot_dynamics_tools.recordings.reader import Recording
from robot_dynamics_tools.recordings.writer import RecordingWriter
from ros_harness import KEEP_MANY, LONG, NodeProcess, RosClient, SIMULATED_ARM, wait_until
from sensor_msgs.msg import JointState

STATIC, COULOMB, STRIBECK_VELOCITY = 1.5, 0.8, 0.02
STIFFNESS, PULL, TURN, DURATION, RATE = 20.0, 0.2, 4.0, 6.0, 500.0
"""Stiffness [N·m/rad], speed [rad/s], reversal [s] of the spring; duration [s], rate [Hz]."""
STATES = '/stick_slip/joint_states'
COMMANDS = '/stick_slip/effort_command'
URDF = planar_arm_urdf([2.0], [1.0], [0.5], [0.1])
PARAMETERS = {
    'robot_description': URDF, 'gravity': [0.0, 0.0, 0.0], 'rate': RATE, 'lock_step': True,
    'friction.coulomb': [COULOMB], 'friction.static': [STATIC],
    'friction.stribeck_velocity': [STRIBECK_VELOCITY]}


def pulled_to(seconds: float) -> float:
    """Return the position of the end of the spring [rad]."""
    return PULL * (seconds if seconds < TURN else 2.0 * TURN - seconds)


class Spring:
    """Answers each state with the torque of the spring at its stamp, until the end of the run."""

    def __init__(self, client: RosClient) -> None:
        self.over = threading.Event()
        self._publisher = client.node.create_publisher(JointState, COMMANDS, KEEP_MANY)
        client.node.create_subscription(JointState, STATES, self._answer, KEEP_MANY)

    def _answer(self, state: JointState) -> None:
        stamp = state.header.stamp
        seconds = stamp.sec + 1e-9 * stamp.nanosec
        if seconds >= DURATION:
            self.over.set()
            return
        torque = STIFFNESS * (pulled_to(seconds) - state.position[0])
        self._publisher.publish(
            JointState(header=state.header, name=state.name, effort=[torque]))


def record_stick_slip(directory: Path) -> Path:
    """Run the arm, and return the recording of its joint states and efforts."""
    bag = directory / 'stick_slip'
    topics = (TopicSpec(STATES, JointState, True), TopicSpec(COMMANDS, JointState, True))
    with RosClient('spring') as client, RecordingWriter(bag) as writer:
        recorder = Recorder(client.node, writer, topics)
        spring = Spring(client)

        def everything_arrived() -> bool:
            recorder.drain()
            newest = recorder.counts[STATES].stamp_ns
            return spring.over.is_set() and newest >= 1e9 * DURATION

        with NodeProcess(SIMULATED_ARM, PARAMETERS, namespace='/stick_slip', ready=None):
            wait_until(everything_arrived, 'the end of the run', LONG)
        recorder.close()
    steps = np.diff(np.unique(read_stick_slip(bag).stamps_ns))
    assert (steps == round(1e9 / RATE)).all(), 'states are missing'
    return bag


def read_stick_slip(bag: Path) -> JointSeries:
    with Recording(bag) as recording:
        return recording.joint_series(STATES)
