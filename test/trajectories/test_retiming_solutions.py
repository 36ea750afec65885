# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Retiming against known solutions: formulas for one joint, and toppra for robots.

Retiming with limits of the rate of the efforts: limits, path and rests of the result.
"""


from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
from optional_library import library
import pytest
from retimed import (
    distance_from_lines,
    frictionless,
    hinge,
    INERTIA,
    largest_ratio,
    OPEN,
    poses,
    sampled,
    speed_up_and_down,
)
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories import efforts_along, JointTrajectory, make_trajectory, retime
from robot_dynamics.trajectories.goal_limits import motion_excesses
from robot_dynamics.trajectories.path import path_of
from robot_dynamics.trajectories.quintics import quintic_point_to_point
from robot_dynamics.trajectories.segments import TrajectorySegments
from robots import arm_without_gripper, JOINTS, robot_urdf


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


ARMS = ('two_link', 'ur10')


def arm_of(name: str) -> ArmModel:
    arm = load_arm(default_arm_urdf() if name == 'two_link' else robot_urdf(name),
                   JOINTS.get(name, ()))
    limit = arm.limits.effort
    return arm.with_reflected_inertia(np.where(np.isfinite(limit), limit / 500.0, 0.01))


def rates_of(arm: ArmModel) -> np.ndarray:
    return np.where(np.isfinite(arm.limits.effort), 7.5 * arm.limits.effort, 750.0)


def random_path(arm: ArmModel, seed: int, count: int = 4) -> JointTrajectory:
    rng = np.random.default_rng(seed)
    low, high = np.maximum(arm.limits.lower, -2.0), np.minimum(arm.limits.upper, 2.0)
    middle = 0.5 * (low + high)
    q = np.clip(middle + rng.uniform(-0.8, 0.8, (count, len(middle))), low, high)
    return make_trajectory(arm.joint_names, np.arange(float(count)), q)


@settings(max_examples=4)
@given(name=st.sampled_from(ARMS), seed=st.integers(0, 10**6), share=st.sampled_from((0.5, 1.0)))
def test_the_result_keeps_all_limits(name, seed, share):
    arm = arm_of(name)
    dynamics, path, rates = ArmDynamics(arm), random_path(arm, seed), rates_of(arm)
    gravity = np.abs(dynamics.gravity_batch([point.position for point in path.points]))
    assume((gravity < 0.9 * share * arm.limits.effort).all())
    result = retime(
        dynamics, path, corner_tolerance=0.05, effort_limit_fraction=share,
        effort_rate_limits=rates)
    assert efforts_along(dynamics, result.trajectory).worst_ratio <= share * 1.005
    assert not [one for one in motion_excesses(arm, result.trajectory) if 'velocity' in one]
    tau = dynamics.unchecked.rigid_body.inverse_dynamics_batch(*sampled(result.trajectory, 5))
    segments = TrajectorySegments(result.trajectory)
    t = segments.time(np.repeat(np.arange(segments.count), 5), np.tile(
        np.linspace(0.0, 1.0, 5), segments.count))
    new = np.diff(t) > 1e-9
    steps = np.abs(np.diff(tau, axis=0))[new] / np.diff(t)[new][:, None]
    assert (steps <= 1.02 * rates).all()


@pytest.mark.parametrize('name', ARMS)
def test_the_arm_stays_on_the_path_and_rests_at_its_ends(name):
    arm = arm_of(name)
    path = random_path(arm, 5)
    result = retime(
        ArmDynamics(arm), path, corner_tolerance=0.05, effort_rate_limits=rates_of(arm)).trajectory
    rounded, phases = path_of(path, 0.05), np.linspace(0.0, 1.0, 4001)
    k = len(rounded.coefficients)
    samples = rounded.sample(np.repeat(np.arange(k), len(phases)), np.tile(phases, k))[0]
    assert distance_from_lines(samples, sampled(result, 4)[0]) < 1e-5
    first, last = result.points[0], result.points[-1]
    assert first.position == pytest.approx(path.points[0].position, abs=1e-12)
    assert last.position == pytest.approx(path.points[-1].position, abs=1e-12)
    for point in (first, last):
        assert not point.velocity.any()
        assert not point.acceleration.any()


def test_rests_of_the_request_remain_rests():
    arm = arm_of('two_link')
    zero = [[0.0, 0.0]] * 3
    points = [[0.0, 0.0], [0.6, -0.4], [0.1, 0.8]]
    path = make_trajectory(arm.joint_names, [0.0, 1.0, 2.0], points, zero, zero)
    result = retime(ArmDynamics(arm), path, effort_rate_limits=rates_of(arm)).trajectory
    nearest = min(result.points, key=lambda point: np.abs(point.position - points[1]).max())
    assert nearest.position == pytest.approx(np.array(points[1]), abs=1e-9)
    assert nearest.velocity == pytest.approx(0.0, abs=1e-9)
