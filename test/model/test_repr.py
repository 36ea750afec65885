# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The representation of an object is one short line with its main properties."""

from controller_bench import update
import numpy as np
import pytest
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation

ARM = load_arm(default_arm_urdf())
MODEL = "<ArmModel 'planar_arm', 2 joints ('joint1', 'joint2')>"
LOAD = make_payload('tool0', 2.5)
ONES = [1.0] * 60
LONG = load_arm(planar_arm_urdf(ONES, ONES, [0.5] * 60, [0.1] * 60))


def test_a_controller():
    controller = Controller(ARM, ControllerOptions(make_gains(ARM.joint_names)))
    assert repr(controller) == f'<Controller of {MODEL}, computed_torque, no reference>'
    update(controller, 0, np.zeros(2), np.zeros(2))
    controller.stop()
    assert repr(controller) == (
        f'<Controller of {MODEL}, computed_torque, following a reference>')


@pytest.mark.parametrize(('one', 'words'), [
    (ARM.with_payloads([LOAD]), f"{MODEL[:-1]}, <Payload of 2.5 kg on 'tool0'>>"),
    (ArmDynamics(ARM), f'<ArmDynamics of {MODEL}>'),
    (ArmSimulation(ARM, [1.0 / 3.0, -2]),
     f'<ArmSimulation of {MODEL}, brakes on, position [0.3333, -2.0]>'),
])
def test_what_others_are(one, words):
    assert repr(one) == words


def test_many_joints_are_shortened():
    words = repr(ArmSimulation(LONG))
    assert "60 joints ('joint1', 'joint2'" in words
    assert 'joint7' not in words
    assert len(words) < 300
