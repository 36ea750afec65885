# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Effort convention: conversions of measured efforts, compensation by the robot, clamping."""

from typing import Any

from controller_bench import ARM, NAMES, Q, update, ZERO
import numpy as np
import pytest
from robot_dynamics.control.control_output import ControlOutput
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.actuator import Actuators, make_actuators
from robot_dynamics.joints.effort_convention import (
    EffortConvention,
    joint_effort_at_rest,
    make_effort_convention,
    measured_from_joint,
)
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

V = np.array([0.5, -0.3])
G = ArmDynamics(ARM).rigid_body.gravity(Q)
EFFORT = np.array([-40.0, 12.0])
ALL = ('gravity', 'friction')


def motors(efficiency: float = 1.0) -> Actuators:
    return make_actuators(
        NAMES, [0.1, 0.05], [100.0, -50.0], rotor_inertia=[1e-5], efficiency=[efficiency])


# --- measured effort -----------------------------------------------------------------------------

@pytest.mark.parametrize(('kind', 'expected'), [
    ('joint_torque', [-40.0, 12.0]),
    ('joint_torque_without_gravity', [-40.0, 12.0]),
    ('motor_torque', [-4000.0, -600.0]),
    ('motor_current', [-400.0, -30.0]),
])
def test_a_measured_effort_is_taken_to_the_joint_side(kind, expected):
    assert joint_effort_at_rest(kind, EFFORT, motors()) == pytest.approx(np.array(expected))


@pytest.mark.parametrize('v', [-1.0, 1.0])
def test_a_lossy_gearbox_is_read_within_its_losses(v):
    """For power in either direction, the error of readings at rest is within the efficiency."""
    eta = 0.7
    reported = measured_from_joint('motor_current', EFFORT, np.full(2, v), G, motors(eta))
    ratio = joint_effort_at_rest('motor_current', reported, motors(eta)) / EFFORT
    assert (ratio >= eta - 1e-12).all()
    assert (ratio <= 1.0 / eta + 1e-12).all()
    without = measured_from_joint('joint_torque_without_gravity', EFFORT, V, G, None)
    assert without.tolist() == (EFFORT - G).tolist()
    assert measured_from_joint('none', EFFORT, V, G, None).size == 0


@pytest.mark.parametrize(('arguments', 'words'), [
    (('torque', [], True), "measured_effort is 'torque', expected one of .*'motor_current'"),
    (('none', ['friction', 'load'], True), r"robot_compensates\[1\] is 'load', expected one of"),
    (('none', ['gravity', 'gravity'], True), "robot_compensates has 'gravity' twice"),
    (('motor_current', [], False),
     "'motor_current', but there are no actuators: expected actuator.torque_constant and"),
    (('motor_torque', [], False), r"or one of \['joint_torque', .*'none'\]"),
])
def test_mismatched_inputs_are_rejected_by_name(arguments, words):
    with pytest.raises(InvalidInputError, match=words):
        make_effort_convention(*arguments)


# --- the command ---------------------------------------------------------------------------------

def make_controller(compensates: tuple[str, ...], **changes: Any) -> Controller:
    semantics = EffortConvention(robot_compensates=compensates)
    return Controller(ARM.with_friction(make_friction(NAMES, [2.0], [3.0])), ControllerOptions(
        make_gains(NAMES), effort_convention=semantics, **changes))


def answered(controller: Controller, target: Any = None) -> ControlOutput:
    update(controller, 1, Q, V)
    if target is not None:
        controller.follow(make_trajectory(NAMES, [0.0], [target], [V], [], NAMES), 0)
    return update(controller, 2, Q, V)


@pytest.mark.parametrize('compensates', [('gravity',), ALL])
def test_the_command_and_what_the_robot_adds_are_computed_torque(compensates):
    output = answered(make_controller(compensates), Q + 0.01)
    whole = answered(make_controller(()), Q + 0.01)
    assert np.abs(whole.terms.friction).min() > 1.0
    assert output.computed_torque.tolist() == whole.computed_torque.tolist()
    added = ('gravity' in compensates) * G + ('friction' in compensates) * whole.terms.friction
    assert output.command + added == pytest.approx(output.computed_torque)
    terms = output.terms
    assert terms.effort == pytest.approx(output.command)
    for name in compensates:
        assert getattr(terms, name).tolist() == [0.0, 0.0]


def test_a_load_that_only_this_node_knows_of_stays_in_the_command():
    controller = make_controller(('gravity',))
    load = make_payload('tool0', 2.0)
    controller.set_payloads([load], 0.0, lambda _: None)
    output = answered(controller)
    loaded = ArmDynamics(ARM.with_payloads([load])).rigid_body.gravity(Q)
    assert output.command == pytest.approx(loaded - G)
    assert output.gravity_compensation == pytest.approx(loaded)
    assert output.robot_gravity == pytest.approx(G)
    assert output.terms.gravity == pytest.approx(loaded - G)


# --- limits --------------------------------------------------------------------------------------

LIMIT = np.array([150.0, 60.0])


@pytest.mark.parametrize('target', [[3.0, -2.0], [-3.0, 3.0], [0.9, 0.6], None])
@pytest.mark.parametrize('scale', [1.0, 0.5, 0.0])
@pytest.mark.parametrize('compensates', [(), ALL])
def test_joint_and_command_keep_within_their_limits(compensates, scale, target):
    """
    The effort at the joint is within the limit of the URDF, the command within its share of it.

    A share that is below the gravity torque is raised to it, so that the arm does not fall.
    """
    output = answered(make_controller(compensates, effort_limit_fraction=scale), target)
    added = G if compensates else ZERO
    hold = G - added
    assert output.holding_effort() == pytest.approx(hold)
    low, high = np.minimum(-scale * LIMIT, hold), np.maximum(scale * LIMIT, hold)
    assert ((low - 1e-9 <= output.command) & (output.command <= high + 1e-9)).all()
    assert (np.abs(output.command + added) <= LIMIT + 1e-9).all()
    wanted = output.terms.effort
    inside = (low <= wanted) & (wanted <= high) & (np.abs(wanted + added) <= LIMIT)
    assert output.command[inside] == pytest.approx(output.terms.effort[inside])
    clamped = np.zeros(2, dtype=bool) if output.clamped is None else output.clamped
    assert clamped.tolist() == (~inside).tolist()
