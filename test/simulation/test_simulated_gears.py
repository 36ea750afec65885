# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The simulated arm with friction of gears: energy, an exact solution, creep, and stiff gears."""

from typing import Any

import numpy as np
import pytest
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.simulation.plant import InnerController
from simulated_arms import block, released

MASS, GRAVITY = 2.0, 9.81
ARM = load_arm(default_arm_urdf())
NAMES = ARM.joint_names


def lift(
    sigmoid: float, width: float, load_fraction: float, viscous: float = 0.0,
) -> ArmModel:
    """Return a mass on a vertical rail: its gears bear the same load everywhere."""
    return block(
        MASS, (0.0, 0.0, 1.0), viscous=viscous, sigmoid=sigmoid, sigmoid_velocity=width,
        load_coefficient=load_fraction)


def geared(**changes: Any) -> ArmModel:
    """Return the arm of two links with every kind of friction."""
    return ARM.with_friction(make_friction(
        NAMES, [0.5, 0.2], [1.0, 0.5], [1.5, 0.5], [0.05], [0.3, -0.1], **{
        'sigmoid': [2.0, 0.5], 'sigmoid_velocity': [0.05, 0.1], 'load_coefficient': [0.1, 0.2],
        'presliding_distance': [0.01, 0.0], **changes}))


@pytest.mark.parametrize('width', [0.1, 1e-5])
def test_under_a_load_below_its_friction_a_joint_creeps(width):
    """With up to 500 time constants per step: v_a artanh of the fraction of the load."""
    arm = lift(5.0, width, 0.1)
    simulation = released(arm, [0.0])
    for _ in range(300):
        state = simulation.step(np.array([MASS * GRAVITY + 2.0]), 0.002)
    expected = width * np.arctanh(2.0 / (5.0 + 0.1 * MASS * GRAVITY))
    assert state.velocity[0] == pytest.approx(expected, rel=1e-6)
    assert simulation.work - simulation.heat == pytest.approx(
        sum(simulation.energy) - sum(released(arm, [0.0]).energy), abs=1e-7)


@pytest.mark.parametrize(('width', 'backlash', 'load', 'allowed'), [
    ([0.05, 0.1], 2e-3, [0.0], 1e-6), ([0.002, 0.001], None, [0.1, 0.2], 1e-6),
    ([0.05, 0.1], 2e-3, [0.1, 0.2], 1e-4)])
def test_the_energy_balance_closes(width, backlash, load, allowed):
    """Load-dependent friction acts where teeth touch."""
    arm = geared(sigmoid_velocity=width, load_coefficient=load)
    if backlash is not None:
        arm = arm.with_actuators(make_actuators(
            NAMES, [0.1], [100.0], rotor_inertia=[2e-5], backlash=[backlash]))
    simulation = released(arm, [0.4, -0.3], [1.0, -2.0])
    at_start, largest, turns, before = sum(simulation.energy), 1.0, 0, simulation.v.copy()
    for k in range(300):
        effort = np.array([60.0, 20.0]) * np.sin(0.03 * k + np.array([0.0, 1.0]))
        v = simulation.step(effort, 0.002).velocity
        turns, before = turns + int((v * before < 0.0).sum()), v
        change = sum(simulation.energy) - at_start
        largest = max(largest, simulation.work, simulation.heat)
        assert simulation.work - simulation.heat == pytest.approx(change, abs=allowed * largest)
    assert turns >= 3
    assert simulation.heat > 5.0


@pytest.mark.parametrize('v', [[0.0, 0.4], [-0.02, 0.0]])
def test_the_first_acceleration_is_that_of_forward_dynamics(v):
    arm, effort = geared(presliding_distance=[0.0]), np.array([90.0, 5.0])
    q, h = [0.4, -0.3], 1e-6
    simulation = released(arm, q, v, h)
    a = (simulation.step(effort, h).velocity - v) / h
    expected = ArmDynamics(arm).forward_dynamics(np.array(q), np.array(v), effort)
    assert a == pytest.approx(expected, rel=1e-3, abs=1e-3)
    assert np.abs(expected).max() > 1.0


def test_forward_dynamics_inverts_inverse_dynamics_with_a_joint_at_rest():
    """Joint 2 sticks, joint 1 slides: the load of joint 2 is its effort less dry friction."""
    arm = geared(load_coefficient=[0.5, 0.5])
    q, v, a = np.array([0.4, -0.3]), np.array([0.2, 0.0]), np.array([3.0, 0.0])
    dynamics = ArmDynamics(arm)
    tau = dynamics.inverse_dynamics(q, v, a)
    assert dynamics.forward_dynamics(q, v, tau) == pytest.approx(a, abs=1e-9)


def test_a_robot_that_compensates_friction_compensates_that_of_its_gears():
    arm = geared()
    robot = InnerController(arm, EffortConvention(robot_compensates=('friction',)))
    q, v, effort = np.array([0.4, -0.3]), np.array([0.2, -0.1]), np.array([30.0, 4.0])
    added = robot.with_own_compensation(effort, q, v) - effort
    assert added == pytest.approx(
        ArmDynamics(arm).friction_effort(v, effort, smooth=True), rel=1e-12)


def test_teeth_that_do_not_touch_bear_no_load():
    """While the motor is inside the gap, only gravity and unloaded friction act on the lift."""
    motors = make_actuators(['hinge'], [0.1], [100.0], rotor_inertia=[2e-5], backlash=[0.5])
    arm = lift(2.0, 0.01, 0.5).with_actuators(motors)
    simulation = released(arm, [0.0], [1.0])
    simulation.step(np.array([-10.0]), 1e-3)
    assert simulation.v[0] == pytest.approx(1.0 - 1e-3 * (GRAVITY + 2.0 / MASS), rel=1e-6)
