# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Drives with their own position loop: sag, feed-forward, limits, and wrong parameters."""

from typing import Any

import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics.simulation.drive_loop import drive_loop_from
from robot_dynamics.simulation.plant import InnerController, SimulatedRobot
from simulated_arms import released

ARM = load_arm(default_arm_urdf())
Q = np.array([0.3, 0.5])
GIVEN: dict[str, Any] = {
    'joints': list(ARM.joint_names),
    'drive.stiffness': [400.0, 200.0], 'drive.damping': [60.0], 'drive.stiffness_limit': 0.0,
    'drive.damping_limit': 0.0, 'drive.effort_limit': 0.0}


def robot(brakes: bool = True, **values: Any) -> SimulatedRobot:
    plant = SimulatedRobot(
        ArmSimulation(ARM, Q), InnerController(ARM, EffortConvention()), brakes,
        np.random.default_rng(0))
    plant.drive_loop = drive_loop_from(ARM, {**GIVEN, **values})
    return plant


def settled(plant: SimulatedRobot, effort: np.ndarray) -> np.ndarray:
    """Return where the drives hold the arm whose command is Q and this effort."""
    for _ in range(1000):
        plant.take_effort(np.array([Q, np.zeros(2), effort]))
        plant.step(0.004)
    assert np.abs(plant.simulation.v).max() < 1e-6
    return plant.simulation.q


def test_the_arm_sags_by_gravity_over_the_stiffness_and_not_with_feed_forward():
    body = ArmDynamics(ARM).rigid_body
    q = settled(robot(), np.zeros(2))
    assert np.array([400.0, 200.0]) * (Q - q) == pytest.approx(body.gravity(q), rel=1e-5)
    assert settled(robot(), body.gravity(Q)) == pytest.approx(Q, abs=1e-9)


def test_the_drives_close_their_loop_each_millisecond():
    plant, twin = robot(), released(ARM, Q)
    plant.take_effort(np.array([Q + 0.1, np.zeros(2), np.zeros(2)]))
    plant.step(0.004)
    for _ in range(4):
        twin.step([400.0, 200.0] * (Q + 0.1 - twin.q) - 60.0 * twin.v, 0.001)
    assert plant.simulation.q == pytest.approx(twin.q, abs=1e-12)


def test_the_drives_have_effort_limits_and_no_effort_before_the_first_command():
    plant = robot(**{'drive.effort_limit': 10.0})
    plant.step(0.1)
    assert plant.simulation.braked
    plant.take_effort(np.array([Q + 1.0, np.zeros(2), np.zeros(2)]))
    plant.step(0.001)
    assert plant.simulation.effort == pytest.approx([10.0, 10.0])
    plant.commands.timeout = 0.2
    for _ in range(100):
        plant.watch_commands(0.01, 0.01)
        plant.step(0.01)
    assert plant.simulation.braked  # the last command has timed out


def test_without_brakes_the_arm_falls_until_the_first_command():
    plant = robot(brakes=False)
    plant.step(0.1)
    assert np.abs(plant.simulation.v).max() > 0.1


@pytest.mark.parametrize(('values', 'words'), [
    ({'drive.damping': []}, 'drive.damping is empty'),
    ({'joints': []}, 'drive.stiffness has 2 values, one per joint, but the parameter joints'),
    ({'drive.stiffness': []}, 'drive.stiffness is empty'),
    ({'drive.stiffness': [1.0, 2.0, 3.0]}, 'drive.stiffness has 3'),
    ({'drive.stiffness_limit': 300.0}, "drive.stiffness of 'joint1' is 400, expected at most 300"),
    ({'drive.damping_limit': 5.0}, "drive.damping of 'joint1' is 60, expected at most 5"),
])
def test_wrong_gains_are_named(values, words):
    assert drive_loop_from(ARM, {**GIVEN, 'drive.stiffness': [], 'drive.damping': []}) is None
    with pytest.raises(InvalidInputError, match=words):
        drive_loop_from(ARM, {**GIVEN, **values})
