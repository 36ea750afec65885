# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The representation of an object is one short line with its main properties."""


import numpy as np
import pytest
from recordings import KnownMotion, write_recording
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics, RigidBody
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.recordings.reader import Recording
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, TrajectoryPoint

ARM = load_arm(default_arm_urdf())
NAMES = ARM.joint_names
MODEL = "<ArmModel 'planar_arm', 2 joints ('joint1', 'joint2')>"
LOAD = make_payload('tool0', 2.5)
ONES = [1.0] * 60
LONG = load_arm(planar_arm_urdf(ONES, ONES, [0.5] * 60, [0.1] * 60))


def trajectory(n: int, points: int) -> JointTrajectory:
    return JointTrajectory(LONG.joint_names[:n], tuple(
        TrajectoryPoint(0.5 * i, np.full(n, 0.1)) for i in range(points)))


def test_an_arm_its_load_and_its_dynamics():
    assert repr(ARM) == MODEL
    assert repr(LOAD) == "<Payload of 2.5 kg on 'tool0'>"
    assert repr(ARM.with_payloads([LOAD])) == f'{MODEL[:-1]}, {LOAD!r}>'
    assert repr(ArmDynamics(ARM)) == f'<ArmDynamics of {MODEL}>'
    assert repr(RigidBody(ARM)) == f'<RigidBody of {MODEL}>'


def test_a_controller():
    controller = Controller(ARM, ControllerOptions(make_gains(NAMES)))
    assert repr(controller) == f'<Controller of {MODEL}, computed_torque, no reference>'
    controller.update(0, np.zeros(2), np.zeros(2))
    controller.stop()
    assert repr(controller) == (
        f'<Controller of {MODEL}, computed_torque, following a reference>')


def test_a_simulation():
    simulation = ArmSimulation(ARM, [1.0 / 3.0, -2])
    assert repr(simulation) == (
        f'<ArmSimulation of {MODEL}, brakes on, position [0.3333, -2.0]>')
    simulation.release()
    assert 'brakes off' in repr(simulation)


def test_a_trajectory():
    assert repr(trajectory(2, 3)) == (
        "<JointTrajectory of 2 joints ('joint1', 'joint2'), 3 points, 1 s>")
    assert repr(trajectory(2, 0)) == (
        "<JointTrajectory of 2 joints ('joint1', 'joint2'), 0 points>")


def test_a_recording(tmp_path):
    messages = KnownMotion(seconds=0.5).messages()
    path = write_recording(tmp_path / 'bag', messages)
    with Recording(path) as recording:
        assert repr(recording) == (
            f'<Recording {str(path)!r}, 1 topics, {len(messages)} messages, 0 losses>')


@pytest.mark.parametrize('one', [
    LONG, ArmDynamics(LONG), RigidBody(LONG), ArmSimulation(LONG), trajectory(60, 1000),
    Controller(LONG, ControllerOptions(make_gains(LONG.joint_names)))])
def test_many_joints_are_shortened(one):
    assert "60 joints ('joint1', 'joint2'" in repr(one)
    assert 'joint7' not in repr(one)
    assert len(repr(one)) < 300
    assert '\n' not in repr(one)
