# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Identification of the nodes' own parameters from a recording of the nodes.

`dynamics` and `simulated_arm` execute the trajectory that `excite` finds, in lock-step: the noise
depends only on a seed, and the motion begins at a stamp. Each effort reaches the arm after the
test has received the state of the effort, so that every run records all states, and the same ones.
"""

from pathlib import Path
import sys

import children
import numpy as np
import pytest
from robot_dynamics.analysis.motion_filter import filter_motion
from robot_dynamics.identification.pipeline import identify
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.model.regressor import inertial_parameters
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.recordings.reader import Recording, RecordingWriter
from robot_dynamics.ros.middleware.conversions import (
    stamp_from_ros,
    stamp_to_ros,
    trajectory_to_ros,
)
from robot_dynamics.ros.middleware.recorder import Recorder, TopicSpec
from robot_dynamics.trajectories.files import read_trajectory
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory
from ros_harness import (
    DYNAMICS,
    LONG,
    NodeProcess,
    RosClient,
    SIMULATED_ARM,
    wait_until,
    write_parameters,
)
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg

RATE = 250.0
BEGIN = 0.2
STATES, EFFORTS, RELAYED = (
    '/truth/joint_states', '/truth/effort_command', '/truth/relayed_effort')
TRUTH = {
    'joints': ['joint1', 'joint2'], 'friction.viscous': [1.5, 0.6],
    'friction.coulomb': [2.0, 1.0], 'actuator.torque_constant': [0.1, 0.1],
    'actuator.gear_ratio': [100.0, 50.0], 'actuator.rotor_inertia': [2e-5, 4e-5]}
"""Parameters of the arm in addition to the URDF, which the node knows."""
NOISE = {'position_noise': 2e-5, 'velocity_noise': 5e-4, 'effort_noise': 0.3, 'seed': 1}


class Relay:
    """
    Forwards each effort to the arm once its state has arrived at the test.

    The effort for the state at `HELD_AT` waits for `open`: the trajectory has to arrive at one
    simulated time in all runs, and after the first state, because earlier ones are rejected.
    """

    HELD_AT = round(0.5e9 * BEGIN)
    """[ns]"""

    def __init__(self, client: RosClient) -> None:
        self._state = -1
        self._is_open = False
        self._effort: JointState | None = None
        self._publisher = client.node.create_publisher(JointState, RELAYED, 1)
        client.node.create_subscription(JointState, STATES, self._on_state, 1)
        client.node.create_subscription(JointState, EFFORTS, self._on_effort, 1)

    def _on_state(self, message: JointState) -> None:
        self._state = stamp_from_ros(message.header.stamp)
        self._pass_on()

    def _on_effort(self, message: JointState) -> None:
        self._effort = message
        self._pass_on()

    def wait_held(self) -> None:
        """Wait until the arm waits for an effort."""
        wait_until(lambda: self._state == self.HELD_AT, 'the state')

    def open(self) -> None:
        """Forward all efforts from now on, the first with the state that the arm repeats."""
        self._is_open = True

    def _pass_on(self) -> None:
        if self._state >= self.HELD_AT and not self._is_open:
            return
        if self._effort is not None and stamp_from_ros(self._effort.header.stamp) == self._state:
            self._publisher.publish(self._effort)


@pytest.fixture(scope='module')
def arm() -> ArmModel:
    return arm_from_parameters(default_arm_urdf(), TRUTH)


@pytest.fixture(scope='module')
def trajectory(arm: ArmModel, tmp_path_factory: pytest.TempPathFactory) -> JointTrajectory:
    """Return the trajectory of the tool, run in a separate process as by a user."""
    directory = tmp_path_factory.mktemp('excite')
    parameters = write_parameters(directory / 'parameters.yaml', TRUTH)
    path = directory / 'trajectory.yaml'
    children.run(
        [sys.executable, '-m', 'robot_dynamics.tools.excite', '--parameters', str(parameters),
         '--lead', '0.3', '--output', str(path)], check=True, timeout=LONG)
    return read_trajectory(path, arm.joint_names)


@pytest.fixture(scope='module')
def recording(
    client: RosClient, arm: ArmModel, trajectory: JointTrajectory,
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    """Return the recording of the motion; simulated time waits until all have subscribed."""
    path = tmp_path_factory.mktemp('truth') / 'recording'
    end_ns = round(1e9 * (BEGIN + trajectory.duration + 0.1))
    parameters = {**TRUTH, 'gains.natural_frequency': [8.0], 'effort_check': False}
    with RecordingWriter(path) as writer:
        recorder = Recorder(client.node, writer, [TopicSpec(STATES, JointState, stamped=True)])
        count = recorder.counts[STATES]
        relay = Relay(client)
        with NodeProcess(SIMULATED_ARM, {
                **TRUTH, **NOISE, 'rate': RATE, 'lock_step': True,
                'initial_position': trajectory.points[0].position.tolist()},
                namespace='/truth', remaps={'effort_command': RELAYED}), \
                NodeProcess(DYNAMICS, parameters, namespace='/truth'):
            relay.wait_held()
            message = trajectory_to_ros(trajectory)
            message.header.stamp = stamp_to_ros(round(1e9 * BEGIN))
            publisher = client.publisher(
                JointTrajectoryMsg, '/truth/dynamics/joint_trajectory')
            with client.collect(JointState, '/truth/dynamics/reference') as references:
                references.wait_matched()
                publisher.publish(message)
                references.wait_for()  # the trajectory is followed
            relay.open()
            wait_until(
                lambda: recorder.drain() >= 0 and count.stamp_ns >= end_ns, 'the end', LONG)
        recorder.close()
    return path


def test_every_base_parameter_is_within_three_deviations(arm, recording):
    """The identified model starts from the URDF: no friction, no rotors."""
    model = arm_from_parameters(default_arm_urdf(), {})
    with Recording(recording) as bag:
        series = bag.joint_series(STATES, model.joint_names)
    assert (np.diff(np.unique(series.stamps_ns)) == round(1e9 / RATE)).all()
    found = identify(model, [filter_motion(series)], train_fraction=0.9)
    true = dict(zip(found.base.labels, found.base.matrix @ np.concatenate(
        (inertial_parameters(arm), arm.actuators.reflected_inertia))))
    assert len(true) == 7
    estimate = found.estimate
    values = dict(zip(estimate.names, zip(estimate.values, estimate.deviations)))
    for name, expected in true.items():
        value, deviation = values[name]
        assert abs(value - expected) < 3.0 * deviation, name
        assert deviation < max(0.1 * abs(expected), 0.02), name  # else the result says nothing
    for name, viscous in zip(arm.joint_names, arm.friction.viscous):
        assert values[f'viscous({name})'][0] == pytest.approx(viscous, abs=0.15)
