# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Missing commands: how missing steps are counted, and how the simulated robot reacts.

Drives with their own position loop: sag, feed-forward, limits, and wrong parameters.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.effort_convention import EffortConvention, make_effort_convention
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics.simulation.command_timeout import CommandTimeout
from robot_dynamics.simulation.drive_loop import drive_loop_from
from robot_dynamics.simulation.plant import InnerController, SimulatedRobot
from simulated_arms import released

PERIOD = 0.01
TIMEOUT = 0.2
ENOUGH = 20
"""Steps of silence that make the timeout."""


def received_once(timeout: float = TIMEOUT) -> CommandTimeout:
    commands = CommandTimeout(timeout)
    commands.receive()
    assert not commands.end_step(PERIOD, PERIOD)
    return commands


def steps_until_over(commands: CommandTimeout, passed: float, period: float = PERIOD) -> int:
    """Return the number of missed steps of `passed` [s] to the timeout; 0 for more than 1000."""
    for k in range(1, 1001):
        if commands.end_step(passed, period):
            return k
    return 0


# --- the counter ---------------------------------------------------------------------------------

def test_nothing_is_missed_before_the_first_command_or_with_a_timeout_of_0():
    assert steps_until_over(CommandTimeout(TIMEOUT), PERIOD) == 0
    assert steps_until_over(received_once(0.0), PERIOD) == 0


def test_each_command_restarts_the_timeout():
    commands = received_once()
    for _ in range(50):
        for _ in range(ENOUGH - 2):
            assert not commands.end_step(PERIOD, PERIOD)
        commands.receive()
        assert not commands.end_step(PERIOD, PERIOD)
        assert commands.silence == 0.0
    assert steps_until_over(commands, PERIOD) > 0
    commands.receive()
    assert steps_until_over(commands, PERIOD) > 0  # a second timeout after a command


@pytest.mark.parametrize('stall', [0.25, float('inf')])
def test_a_loop_that_was_held_up_could_not_receive(stall):
    """A stall longer than the timeout counts as one step."""
    commands = received_once()
    assert not commands.end_step(stall, PERIOD)
    assert commands.silence == PERIOD
    assert steps_until_over(commands, PERIOD) >= ENOUGH - 2


def test_a_loop_that_catches_up_counts_the_time_that_passes():
    assert steps_until_over(received_once(), 0.8 * PERIOD) == pytest.approx(ENOUGH / 0.8, abs=1)


def test_a_single_command_may_be_late_where_steps_are_long():
    assert steps_until_over(received_once(), 1.0, 1.0) == 3


# --- the robot -----------------------------------------------------------------------------------

START = [0.8, 0.5]
EFFORT = np.array([-30.0, -12.0])


def robot(brakes: bool = True, robot_compensates: Sequence[str] = ()) -> SimulatedRobot:
    arm = load_arm(default_arm_urdf())
    plant = SimulatedRobot(
        ArmSimulation(arm, START),
        InnerController(arm, make_effort_convention('joint_torque', robot_compensates, False)),
        brakes,
        np.random.default_rng(0))
    plant.commands.timeout = TIMEOUT
    return plant


def times_out(plant: SimulatedRobot) -> bool:
    """Return whether efforts are missing for too long; let that time pass."""
    for _ in range(2 * ENOUGH):
        if plant.watch_commands(PERIOD, PERIOD):
            return True
        plant.step(PERIOD)
    return False


def command(plant: SimulatedRobot, steps: int) -> None:
    for _ in range(steps):
        plant.take_effort(EFFORT)
        assert not plant.watch_commands(PERIOD, PERIOD)
        plant.step(PERIOD)


def test_the_brakes_hold_an_arm_that_gets_no_effort_any_more():
    plant = robot()
    command(plant, 10)
    assert times_out(plant)
    assert plant.timed_out
    held = plant.measure()
    assert np.abs(held.position - START).max() > 0.01
    for _ in range(3):
        plant.step(PERIOD)
        assert not plant.watch_commands(PERIOD, PERIOD)
        now = plant.measure()
        assert now.position.tolist() == held.position.tolist()
        assert now.velocity.tolist() == now.effort.tolist() == [0.0, 0.0]


def test_the_next_effort_moves_it_on_from_where_it_stands():
    plant = robot()
    command(plant, 10)
    assert times_out(plant)
    twin = released(load_arm(default_arm_urdf()), plant.measure().position)
    command(plant, 1)
    assert not plant.timed_out
    twin.step(EFFORT, PERIOD)
    assert plant.measure().position.tolist() == twin.q.tolist()
    assert plant.measure().velocity.tolist() == twin.v.tolist()


def test_an_arm_without_brakes_falls_unless_the_robot_compensates_gravity():
    plant = robot(brakes=False)
    command(plant, 10)
    assert times_out(plant)
    twin = released(load_arm(default_arm_urdf()), *plant.simulation.state)
    plant.step(0.1)
    twin.step(np.zeros(2), 0.1)
    assert plant.timed_out
    assert plant.simulation.q.tolist() == twin.q.tolist()
    plant = robot(brakes=False, robot_compensates=['gravity'])
    plant.take_effort(np.zeros(2))
    assert times_out(plant)
    plant.step(0.1)
    assert plant.simulation.q == pytest.approx(START, abs=1e-9)


def test_an_arm_that_was_reset_waits_for_its_first_effort():
    plant = robot()
    command(plant, 10)
    assert times_out(plant)
    plant.reset()
    assert not plant.timed_out
    assert plant.measure().position.tolist() == START
    assert not times_out(plant)
    command(plant, 10)
    plant.reset()  # while missed steps are counted
    assert plant.commands.silence == 0.0
    assert not times_out(plant)
    plant.take_effort(EFFORT)
    plant.reset()  # in the same step as the command
    assert not times_out(plant)


ARM = load_arm(default_arm_urdf())
Q = np.array([0.3, 0.5])
GIVEN: dict[str, Any] = {
    'joints': list(ARM.joint_names),
    'drive.stiffness': [400.0, 200.0], 'drive.damping': [60.0], 'drive.stiffness_limit': 0.0,
    'drive.damping_limit': 0.0, 'drive.effort_limit': 0.0}


def driven_robot(brakes: bool = True, **values: Any) -> SimulatedRobot:
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
    q = settled(driven_robot(), np.zeros(2))
    assert np.array([400.0, 200.0]) * (Q - q) == pytest.approx(body.gravity(q), rel=1e-5)
    assert settled(driven_robot(), body.gravity(Q)) == pytest.approx(Q, abs=1e-9)


def test_the_drives_close_their_loop_each_millisecond():
    plant, twin = driven_robot(), released(ARM, Q)
    plant.take_effort(np.array([Q + 0.1, np.zeros(2), np.zeros(2)]))
    plant.step(0.004)
    for _ in range(4):
        twin.step([400.0, 200.0] * (Q + 0.1 - twin.q) - 60.0 * twin.v, 0.001)
    assert plant.simulation.q == pytest.approx(twin.q, abs=1e-12)


def test_the_drives_have_effort_limits_and_no_effort_before_the_first_command():
    plant = driven_robot(**{'drive.effort_limit': 10.0})
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
    plant = driven_robot(brakes=False)
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
