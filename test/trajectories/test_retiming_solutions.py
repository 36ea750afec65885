# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Retiming against known solutions: formulas for one joint, and toppra for robots."""


import numpy as np
from optional_library import library
import pytest
from retimed import frictionless, hinge, INERTIA, largest_ratio, OPEN, poses, speed_up_and_down
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.trajectories import efforts_along, make_trajectory, retime
from robot_dynamics.trajectories.quintics import quintic_point_to_point
from robots import arm_without_gripper


@pytest.mark.parametrize(('kind', 'velocities'), [
    ('revolute', ()), ('prismatic', [[0.0], [0.0]])])
def test_constant_inertia_is_bang_bang(kind, velocities):
    path = make_trajectory(['hinge'], [0.0, 5.0], [[0.0], [1.5]], velocities)
    result = retime(ArmDynamics(hinge(kind=kind)), path)
    assert result.duration == pytest.approx(2.0 * np.sqrt(1.5 * INERTIA / 2.0), rel=3e-5)
    assert result.ratio == pytest.approx(result.duration / 5.0)
    assert set(result.limited_quantity) == {'effort'}
    assert set(result.limiting_joint) == {'hinge'}


@pytest.mark.parametrize(('way', 'tolerance'), [(1e-7, 0.1), (1e-5, 1e-4), (4.0, 1e-4)])
def test_ways_of_any_length(way, tolerance):
    path = make_trajectory(['hinge'], [0.0, 5.0], [[0.1], [0.1 + way]])
    result = retime(ArmDynamics(hinge()), path)
    assert result.duration == pytest.approx(2.0 * np.sqrt(way * INERTIA / 2.0), rel=tolerance)
    assert efforts_along(ArmDynamics(hinge()), result.trajectory).worst_ratio < 1.0 + 2e-6


MOTOR = make_actuators(['hinge'], 0.1, 10.0, rotor_inertia=2e-3, current_limit=2.0)


@pytest.mark.parametrize(('arm', 'acceleration', 'expected', 'quantities'), [
    (hinge(velocity=0.8), (), 1.5 / 0.8 + 0.8 * INERTIA / 2.0, {'effort', 'velocity'}),
    (hinge().with_friction(make_friction(['hinge'], coulomb=0.5)), (),
     speed_up_and_down(1.5 / INERTIA, 2.5 / INERTIA), {'effort'}),
    (hinge(), 3.0, speed_up_and_down(3.0, 3.0), {'acceleration'}),
    (hinge(), 30.0, speed_up_and_down(2.0 / INERTIA, 2.0 / INERTIA), {'effort'}),
    (hinge(effort=OPEN).with_actuators(MOTOR), (),
     speed_up_and_down(*2 * [2.0 / (INERTIA + 100.0 * 2e-3)]), {'current'}),
], ids=['trapezoid', 'friction', 'acceleration', 'effort', 'current of effort and rotor'])
def test_the_duration_is_that_of_the_known_solution(arm, acceleration, expected, quantities):
    path = quintic_point_to_point(['hinge'], [0.0], [1.5], 3.0)
    result = retime(ArmDynamics(arm), path, acceleration_limits=acceleration)
    assert result.duration == pytest.approx(expected, rel=5e-5)
    assert set(result.limited_quantity) == quantities


def test_viscous_friction_is_that_of_the_speed():
    d = 0.8
    arm = hinge().with_friction(make_friction(['hinge'], viscous=d))
    result = retime(ArmDynamics(arm), quintic_point_to_point(['hinge'], [0.0], [1.5], 3.0))
    # v' = (2 - d v) / I up to the switch, then v' = -(2 + d v) / I; integrated by small steps.
    dt, x_up, v_up = 4e-5, [0.0], [0.0]
    while x_up[-1] < 1.5:
        x_up.append(x_up[-1] + v_up[-1] * dt)
        v_up.append(v_up[-1] + (2.0 - d * v_up[-1]) / INERTIA * dt)
    x_down, v_down = [1.5], [0.0]
    while x_down[-1] > 0.0:
        x_down.append(x_down[-1] - v_down[-1] * dt)
        v_down.append(v_down[-1] + (2.0 + d * v_down[-1]) / INERTIA * dt)
    down = np.interp(x_up, x_down[::-1], v_down[::-1])
    switch = int(np.argmax(np.array(v_up) > down))
    expected = dt * (switch + int(np.argmax(np.array(x_down) < x_up[switch])))
    assert result.duration == pytest.approx(expected, rel=2e-4)


def test_the_voltage_of_a_motor_limits_its_speed():
    motor = make_actuators(['hinge'], 0.1, 10.0, resistance=0.01, voltage_limit=1.0)
    arm = hinge(effort=OPEN).with_actuators(motor)
    result = retime(ArmDynamics(arm), quintic_point_to_point(['hinge'], [0.0], [3.0], 3.0))
    assert result.duration == pytest.approx(3.0 / (1.0 / (0.1 * 10.0)), rel=0.02)
    assert largest_ratio(arm, result.trajectory) < 1.0 + 1e-5
    assert 'voltage' in result.limited_quantity


# --- toppra as oracle ----------------------------------------------------------------------------

@pytest.mark.parametrize('name', ['panda', 'ur10'])
def test_durations_are_those_of_toppra(name):
    toppra = library('toppra')
    toppra.setup_logging('ERROR')
    arm = frictionless(arm_without_gripper(name))
    dynamics = ArmDynamics(arm)
    spline = toppra.SplineInterpolator(
        np.linspace(0.0, 1.0, 6), poses(arm, 6, np.random.default_rng(1)))
    limits = arm.limits
    constraints = [
        toppra.constraint.JointVelocityConstraint(
            np.stack([-limits.velocity, limits.velocity], 1)),
        toppra.constraint.JointTorqueConstraint(
            lambda *motion: dynamics.unchecked.inverse_dynamics(*map(np.asarray, motion)),
            np.stack([-limits.effort, limits.effort], 1), np.zeros(arm.joint_count),
            discretization_scheme=toppra.constraint.DiscretizationType.Interpolation)]
    # Dense at both ends: with uniform nodes the first and the last interval take too long.
    nodes = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 3001)))
    _, speed, _ = toppra.algorithm.TOPPRA(
        constraints, spline, gridpoints=nodes, solver_wrapper='seidel',
    ).compute_parameterization(0, 0)
    expected = float(np.sum(2.0 * np.diff(nodes) / (speed[1:] + speed[:-1])))
    t = np.linspace(0.0, 1.0, 1000)
    result = retime(dynamics, make_trajectory(arm.joint_names, 10.0 * t, spline(t)))
    assert result.duration == pytest.approx(expected, rel=1e-4)
    assert efforts_along(dynamics, result.trajectory).worst_ratio < 1.0 + 1e-6
