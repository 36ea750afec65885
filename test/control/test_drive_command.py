# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0
"""Commands for drives with a scale and an offset: the torque at the joints, and the limits."""

from dataclasses import replace
from typing import Any

from controller_bench import ARM, LIMIT, NAMES, Q, update, ZERO
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.control.braking import braked
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.joints.effort_calibration import EffortCalibration, make_effort_calibration
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.simulation.plant import InnerController
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from simulated_arms import released

FRICTION = ARM.with_friction(make_friction(NAMES, [2.0], [3.0]))
V = np.array([0.5, -0.3])
NOW = 1_000_000_000

laws = settings(max_examples=40)
scales = st.tuples(*2 * (st.floats(0.2, 5.0) | st.floats(-5.0, -0.2),))
offsets = st.tuples(st.floats(-30.0, 30.0), st.floats(-12.0, 12.0))
angles = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)).map(np.array)
robots = st.sampled_from([(), ('gravity',), ('friction',), ('gravity', 'friction')])


def driven(arm: ArmModel, scale: Any, offset: Any) -> tuple[ArmModel, EffortCalibration]:
    drive = make_effort_calibration(NAMES, scale, offset, LIMIT)
    return replace(arm.with_drive(drive), report=drive), drive


def controller(arm: ArmModel, robot: tuple[str, ...], **options: Any) -> Controller:
    return Controller(arm, ControllerOptions(
        make_gains(NAMES, [8.0]), effort_convention=EffortConvention(robot_compensates=robot),
        **options))


def follow(one: Controller, goal: Any, v: Any = ZERO) -> None:
    update(one, NOW, Q, v)
    one.follow(make_trajectory(NAMES, [0.0], [goal], [ZERO], [], NAMES), 0)


@laws
@given(scales, offsets, angles, st.floats(0.0, 1.0), robots)
def test_no_command_is_beyond_the_limits_of_the_drive(scale, offset, goal, share, robot):
    arm, drive = driven(FRICTION, scale, offset)
    one = controller(arm, robot, effort_limit_fraction=share)
    follow(one, goal)
    output = update(one, NOW + 1, Q, ZERO)
    holding = output.holding_effort()
    for effort in (output.command, holding, braked(one, Q, V, holding)):
        assert (np.abs(effort) <= LIMIT).all()
    free = np.maximum(np.abs(holding), np.abs(drive.offset))
    assert (np.abs(output.command) <= np.maximum(share * LIMIT, free) + 1e-9).all()


@pytest.mark.parametrize('robot', [(), ('gravity',), ('gravity', 'friction')])
def test_the_drive_turns_the_command_and_what_the_robot_adds_into_the_torque(robot):
    arm, drive = driven(FRICTION, [0.7, 1.3], [8.0, -4.0])
    one = controller(arm, robot)
    follow(one, Q, V)
    output = update(one, NOW + 1, Q, V)
    assert output.clamped is None
    added = np.zeros(2)
    if 'gravity' in robot:
        added += output.robot_gravity
    hold = drive.torque(output.holding_effort() + added)
    assert hold == pytest.approx(output.gravity_compensation)
    if 'friction' in robot:
        friction = controller(FRICTION, ())  # the same reference without a drive
        follow(friction, Q, V)
        added += update(friction, NOW + 1, Q, V).terms.friction
    assert drive.torque(output.command + added) == pytest.approx(output.computed_torque)
    # the terms are those of the torque that the command causes
    assert drive.torque(output.command) == pytest.approx(output.terms.effort)
    parts = output.terms
    assert parts.inertial + parts.coriolis + parts.gravity + parts.friction == pytest.approx(
        parts.effort)


def test_in_a_fault_the_damping_is_a_torque():
    arm, drive = driven(ARM, [0.7, 1.3], [8.0, -4.0])
    without, one = controller(ARM, ()), controller(arm, ())
    held = update(without, NOW, Q, V).holding_effort()
    damped = braked(without, Q, V, held)
    assert np.abs(damped - held).min() > 0.1
    hold = update(one, NOW, Q, V).holding_effort()
    assert drive.torque(braked(one, Q, V, hold)) == pytest.approx(damped)


@pytest.mark.parametrize('robot', [(), ('gravity',)])
@pytest.mark.parametrize('knows', [True, False])
def test_an_arm_with_drives_holds_if_the_controller_knows_them(robot, knows):
    """Half a second of gravity compensation."""
    arm, _ = driven(ARM, [0.7, 1.3], [8.0, -4.0])
    one, drives = controller(arm if knows else ARM, robot), InnerController(
        arm, EffortConvention(robot_compensates=robot))
    simulation = released(arm, Q)
    for k in range(250):
        command = update(one, NOW + 2_000_000 * k, *simulation.state).command
        simulation.step(drives.with_own_compensation(command, *simulation.state), 2e-3)
    moved = np.abs(simulation.q - Q).max()
    assert moved < 1e-6 if knows else moved > 0.1


@pytest.mark.parametrize('kind', ['joint_torque', 'joint_torque_without_gravity'])
def test_the_simulated_drives_report_efforts_of_the_driver(kind):
    arm, drive = driven(ARM, [0.7, 1.3], [8.0, -4.0])
    robot = InnerController(arm, EffortConvention(kind))
    g = ArmDynamics(ARM).gravity(Q)
    taken_out = g if kind != 'joint_torque' else ZERO
    assert robot.measured(g, Q, ZERO, braked=False) == pytest.approx(drive.effort(g) - taken_out)
    assert robot.measured(ZERO, Q, ZERO, braked=True).tolist() == [0.0, 0.0]
    assert robot.with_own_compensation(robot.idle_effort, Q, ZERO).tolist() == [0.0, 0.0]
