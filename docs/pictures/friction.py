# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Draw docs/images/friction.png: the curve of friction, and a joint that sticks and slips.

The joint is that of the running simulated arm, which runs in lock-step, so that the motion does
not depend on the speed of this machine. A slow spring moves the joint to and fro.
"""

import os
from pathlib import Path
import sys
import tempfile
import threading
from typing import Any

import numpy as np
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics_tools.processes import choose_domain
from robot_dynamics_tools.recorder import Recorder, TopicSpec
from robot_dynamics_tools.recordings.reader import JointSeries, Recording, RecordingWriter
from robot_dynamics_tools.reporting.figures import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    legend_below,
    ORANGE,
    PURPLE,
    styled_figure,
    VERMILION,
)
from sensor_msgs.msg import JointState

sys.path.insert(0, str(Path(__file__).parents[2] / 'test' / 'support'))
from ros_harness import (  # noqa: E402
    KEEP_MANY,
    LONG,
    NodeProcess,
    RosClient,
    SIMULATED_ARM,
    wait_until,
)

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


def stick_slip() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time, position and spring torque of a joint pulled by a spring, as simulated."""
    os.environ.update(choose_domain(os.environ))
    with tempfile.TemporaryDirectory() as directory:
        series = read_stick_slip(record_stick_slip(Path(directory)))
    return series.stamps_ns / 1e9, series.position[:, 0], series.effort[:, 0]


def draw_curve(axes: Any) -> None:
    sliding = {'coulomb': [1.0], 'viscous': [0.4]}
    stribeck = {**sliding, 'static': [1.6], 'stribeck_velocity': [0.1]}
    curves = {
        'Coulomb': ({'coulomb': [1.0]}, GREY, (0, (1, 1))),
        'Coulomb, viscous': (sliding, BLUE, (0, (4, 2))),
        'and Stribeck': (stribeck, VERMILION, '-'),
        'and offset': ({**stribeck, 'offset': [0.3]}, GREEN, (0, (6, 1, 1, 1))),
        'sigmoid, viscous': (
            {'viscous': [0.4], 'sigmoid': [0.5], 'sigmoid_velocity': [0.1]}, PURPLE,
            (0, (6, 2))),
    }
    for name, (parameters, colour, dash) in curves.items():
        friction = make_friction(('joint',), **parameters)
        for side in (-1.0, 1.0):
            v = side * np.linspace(1e-6, 1.0, 400)
            axes.plot(v, friction.effort(v[:, None])[:, 0], color=colour, linestyle=dash,
                      linewidth=1.8, label=name if side > 0.0 else None)
    smooth = make_friction(('joint',), **stribeck)
    v = np.linspace(-0.05, 0.05, 201)
    axes.plot(v, smooth.smooth_effort(v[:, None])[:, 0], color=BLACK, linewidth=1.0,
              label='as compensated')
    axes.set(xlabel='velocity [rad/s]', ylabel='friction [N·m]', title='Friction models',
             xticks=[-1.0, -0.5, 0.0, 0.5, 1.0])
    legend_below(axes, 2)


def draw_motion(axes: Any, t: np.ndarray, q: np.ndarray) -> None:
    axes.plot(t, [pulled_to(time) for time in t], color=ORANGE, linestyle=(0, (5, 2)),
              linewidth=2.0, label='end of the spring')
    axes.plot(t, q, color=BLUE, linewidth=1.8, label='joint')
    axes.set(xlabel='time [s]', ylabel='position [rad]',
             title='Simulated: a spring pulls a joint')
    legend_below(axes, 2)


def draw_torque(axes: Any, t: np.ndarray, q: np.ndarray, torque: np.ndarray) -> None:
    axes.plot(t, torque, color=BLACK, linewidth=1.2, label='torque of the spring')
    moves = np.diff(q) != 0.0
    leaves = np.flatnonzero(moves[1:] & ~moves[:-1]) + 2
    axes.plot(t[leaves], torque[leaves], 'o', color=VERMILION, label='joint breaks away')
    for name, size, colour, dash in (
            ('± static friction', STATIC, VERMILION, '--'),
            ('± Coulomb friction', COULOMB, GREY, ':')):
        axes.axhline(size, color=colour, linestyle=dash, linewidth=1.6, label=name)
        axes.axhline(-size, color=colour, linestyle=dash, linewidth=1.6)
    axes.set(xlabel='time [s]', ylabel='torque [N·m]',
             title='Simulated: break-away at static friction')
    legend_below(axes, 2)


def main(directory: Path) -> None:
    """Write the picture into a directory."""
    t, q, torque = stick_slip()
    with styled_figure(12.0, 4.4) as figure:
        curve, motion, effort = figure.subplots(1, 3)
        draw_curve(curve)
        draw_motion(motion, t, q)
        draw_torque(effort, t, q, torque)
        figure.savefig(directory / 'friction.png')


if __name__ == '__main__':
    main(Path(sys.argv[1]))
