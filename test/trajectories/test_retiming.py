# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Retiming: fastest timings and slow-downs within all limits, and requests that are rejected."""

from collections.abc import Callable
from dataclasses import replace
import re
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from one_joint_arm import arm_of, inertial
import pinocchio as pin
import pytest
from random_trees import random_urdf
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, JointLimits, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.references.motion_limits import MotionLimits
from robot_dynamics.references.path_conditioning import feasible_trajectory
from robot_dynamics.trajectories import (
    efforts_along,
    JointTrajectory,
    make_trajectory,
    retime,
    Retiming,
)
from robot_dynamics.trajectories.quintics import quintic_point_to_point, quintic_via_points
from robot_dynamics.trajectories.segments import TrajectorySegments
from robots import JOINTS, robot_urdf

laws = settings(max_examples=25)
PLANAR = ArmDynamics(load_arm(default_arm_urdf()))
CORNER = [[0.0, 0.0], [0.8, 0.5], [0.2, 1.0]]
OPEN = np.inf


def robot(name: str) -> ArmModel:
    return load_arm(robot_urdf(name), JOINTS.get(name, ()))


def frictionless(arm: ArmModel) -> ArmModel:
    return arm.with_friction(make_friction(arm.joint_names))


def poses(arm: ArmModel, count: int, rng: np.random.Generator, scale: float = 0.7) -> np.ndarray:
    low, high = np.maximum(arm.limits.lower, -2.0), np.minimum(arm.limits.upper, 2.0)
    return 0.5 * (low + high) + 0.5 * scale * (high - low) * rng.uniform(
        -1.0, 1.0, (count, arm.joint_count))


def sampled(trajectory: JointTrajectory, count: int = 9) -> tuple[np.ndarray, ...]:
    segments = TrajectorySegments(trajectory)
    k = segments.count
    return segments.sample(np.repeat(np.arange(k), count), np.tile(np.linspace(0, 1, count), k))


def largest_ratio(arm: ArmModel, trajectory: JointTrajectory, share: float = 1.0) -> float:
    """Return the largest |value| / limit: Pinocchio's RNEA, friction and motors by formula."""
    q, v, a = sampled(trajectory)
    model, G, q0 = arm.pinocchio_model, arm.coordinates.G, arm.coordinates.q0
    data = model.createData()
    load = np.array([
        G.T @ pin.rnea(model, data, G @ one + q0, G @ two, G @ three)
        for one, two, three in zip(q, v, a)])
    f = arm.friction
    dry = f.coulomb + (f.static - f.coulomb) * np.exp(-(v / f.stribeck_velocity)**2)
    gears = (f.sigmoid + f.load_coefficient * np.abs(load)) * np.tanh(v / f.sigmoid_velocity)
    tau = load + f.viscous * v + dry * np.sign(v) + f.offset + gears + f.effort_bias
    ratios = [np.abs(v) / arm.limits.velocity, np.abs(tau) / arm.limits.effort / share]
    if arm.actuators is not None:
        m = arm.actuators
        rotor = m.gear_ratio**2 * m.rotor_inertia * a
        passed = tau - rotor
        gain = np.where(passed * v < 0.0, 1.0 / m.efficiency, m.efficiency)
        current = (rotor + passed / gain) / (m.gear_ratio * m.torque_constant)
        voltage = m.resistance * current + m.back_emf_constant * m.gear_ratio * v
        ratios += [np.abs(current) / m.current_limit / share,
                   np.abs(voltage) / m.voltage_limit / share]
    return float(max(one.max() for one in ratios))


def distance_from_path(result: JointTrajectory, request: JointTrajectory) -> float:
    """Return the largest distance of the result from the lines between dense samples."""
    path = sampled(request, max(9, 40_000 // len(request.points)))[0]
    way = np.diff(path, axis=0)
    kept = np.linalg.norm(way, axis=1) > 1e-12
    start, way = path[:-1][kept], way[kept]
    largest = 0.0
    for q in sampled(result, 4)[0][::7]:
        near = int(np.argmin(((start - q)**2).sum(axis=1)))
        rows = slice(max(near - 1, 0), near + 2)
        share = np.clip(((q - start[rows]) * way[rows]).sum(axis=1) / (
            way[rows]**2).sum(axis=1), 0.0, 1.0)
        gaps = np.linalg.norm(start[rows] + share[:, np.newaxis] * way[rows] - q, axis=1)
        largest = max(largest, float(gaps.min()))
    return largest


def slowed_down(dynamics: ArmDynamics, request: JointTrajectory, **options: Any) -> Retiming:
    return retime(dynamics, request, 'slow_down', **options)


# --- a joint with a known solution ---------------------------------------------------------------

INERTIA = 0.5


def hinge(effort: float = 2.0, velocity: float = OPEN, kind: str = 'revolute') -> ArmModel:
    """Return an arm of one joint along gravity, or of a slide across it."""
    axis = '0 0 1' if kind == 'revolute' else '1 0 0'
    limit = '<limit lower="-5" upper="5" effort="100" velocity="2"/>'
    arm = load_arm(arm_of(inertial(0.5, (0.1, 0.1, INERTIA)), limit, kind, axis=axis))
    return replace(arm, limits=JointLimits(
        arm.limits.lower, arm.limits.upper, np.array([velocity]), np.array([effort])))


@pytest.mark.parametrize('kind', ['revolute', 'prismatic'])
@pytest.mark.parametrize('velocities', [(), [[0.0], [0.0]]])
def test_constant_inertia_is_bang_bang(kind: str, velocities: Any) -> None:
    path = make_trajectory(['hinge'], [0.0, 5.0], [[0.0], [1.5]], velocities)
    result = retime(ArmDynamics(hinge(kind=kind)), path)
    assert result.duration == pytest.approx(2.0 * np.sqrt(1.5 * INERTIA / 2.0), rel=3e-5)
    assert result.ratio == pytest.approx(result.duration / 5.0)
    assert set(result.limited_quantity) == {'effort'}
    assert set(result.limiting_joint) == {'hinge'}


@pytest.mark.parametrize(('way', 'tolerance'), [(1e-7, 0.1), (1e-5, 1e-4), (4.0, 1e-4)])
def test_ways_of_any_length(way: float, tolerance: float) -> None:
    path = make_trajectory(['hinge'], [0.0, 5.0], [[0.1], [0.1 + way]])
    result = retime(ArmDynamics(hinge()), path)
    assert result.duration == pytest.approx(2.0 * np.sqrt(way * INERTIA / 2.0), rel=tolerance)
    assert efforts_along(ArmDynamics(hinge()), result.trajectory).worst_ratio < 1.0 + 2e-6


def test_velocity_limits_give_a_trapezoid() -> None:
    path = quintic_point_to_point(['hinge'], [0.0], [1.5], 3.0)
    result = retime(ArmDynamics(hinge(velocity=0.8)), path)
    a = 2.0 / INERTIA
    assert result.duration == pytest.approx(1.5 / 0.8 + 0.8 / a, rel=3e-5)
    assert {'effort', 'velocity'} == set(result.limited_quantity)


def test_friction_acts_in_both_phases() -> None:
    arm = hinge().with_friction(make_friction(['hinge'], coulomb=0.5))
    result = retime(ArmDynamics(arm), quintic_point_to_point(['hinge'], [0.0], [1.5], 3.0))
    speed_up, slow_down = 1.5 / INERTIA, 2.5 / INERTIA
    v = np.sqrt(2.0 * 1.5 / (1.0 / speed_up + 1.0 / slow_down))
    assert result.duration == pytest.approx(v / speed_up + v / slow_down, rel=5e-5)


def test_viscous_friction_is_that_of_the_speed() -> None:
    d = 0.8
    arm = hinge().with_friction(make_friction(['hinge'], viscous=d))
    result = retime(ArmDynamics(arm), quintic_point_to_point(['hinge'], [0.0], [1.5], 3.0))
    # v' = (2 - d v) / I up to the switch, then v' = -(2 + d v) / I; integrated by small steps.
    dt, x_up, v_up = 1e-5, [0.0], [0.0]
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


@pytest.mark.parametrize(('acceleration', 'limit'), [(3.0, 'acceleration'), (30.0, 'effort')])
def test_acceleration_limits(acceleration: float, limit: str) -> None:
    path = quintic_point_to_point(['hinge'], [0.0], [1.5], 3.0)
    result = retime(ArmDynamics(hinge()), path, acceleration_limits=acceleration)
    a = min(acceleration, 2.0 / INERTIA)
    assert result.duration == pytest.approx(2.0 * np.sqrt(1.5 / a), rel=3e-5)
    assert set(result.limited_quantity) == {limit}


def test_the_voltage_of_a_motor_limits_its_speed() -> None:
    motor = make_actuators(['hinge'], 0.1, 10.0, resistance=0.01, voltage_limit=1.0)
    arm = hinge(effort=OPEN).with_actuators(motor)
    result = retime(ArmDynamics(arm), quintic_point_to_point(['hinge'], [0.0], [3.0], 3.0))
    assert result.duration == pytest.approx(3.0 / (1.0 / (0.1 * 10.0)), rel=0.02)
    assert largest_ratio(arm, result.trajectory) < 1.0 + 1e-5
    assert 'voltage' in result.limited_quantity


def test_the_current_of_a_motor_limits_effort_and_rotor() -> None:
    motor = make_actuators(['hinge'], 0.1, 10.0, rotor_inertia=2e-3, current_limit=2.0)
    arm = hinge(effort=OPEN).with_actuators(motor)
    result = retime(ArmDynamics(arm), quintic_point_to_point(['hinge'], [0.0], [1.5], 3.0))
    a = 2.0 / (INERTIA + 100.0 * 2e-3)
    assert result.duration == pytest.approx(2.0 * np.sqrt(1.5 / a), rel=5e-5)


# --- toppra as oracle ----------------------------------------------------------------------------

@pytest.mark.parametrize('name', ['panda', 'ur5', 'ur10', 'kinova', 'xarm7', 'z1'])
def test_durations_are_those_of_toppra(name: str) -> None:
    toppra = pytest.importorskip('toppra', reason='the oracle has wheels for x86-64 only')
    toppra.setup_logging('ERROR')
    arm = frictionless(robot(name))
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


# --- invariants ----------------------------------------------------------------------------------

def with_friction_and_motors(arm: ArmModel, kind: str, room: np.ndarray) -> ArmModel:
    """Return an arm whose friction takes a part of the effort that gravity leaves."""
    names = arm.joint_names
    v = np.where(np.isfinite(arm.limits.velocity), np.minimum(arm.limits.velocity, 10.0), 3.0)
    if kind == 'none':
        return frictionless(arm)
    if kind == 'viscous':
        return arm.with_friction(make_friction(names, 0.3 * room / v, 0.3 * room))
    if kind == 'stribeck':
        return arm.with_friction(make_friction(
            names, 0.1 * room / v, 0.1 * room, 0.2 * room, 0.05, 0.02 * room, sigmoid=0.1 * room,
            load_coefficient=0.05, effort_bias=0.01 * room))
    current = np.maximum(arm.limits.effort, 1.0) / (50.0 * 0.05 * 0.7)
    current = np.where(np.isfinite(current), current, 40.0)
    return arm.with_friction(make_friction(names, (), 0.1 * room)).with_actuators(make_actuators(
        names, 0.05, -50.0, resistance=0.5, rotor_inertia=2e-6, efficiency=0.7,
        current_limit=current, voltage_limit=0.55 * current + 2.5 * v))


def request_of(form: str, arm: ArmModel, q: np.ndarray) -> JointTrajectory:
    t = np.arange(float(len(q)))
    if form == 'quintics':
        return quintic_via_points(arm.joint_names, t, q)
    v = np.zeros_like(q)
    return make_trajectory(arm.joint_names, t, q, v, v if form == 'rests' else ())


def check(dynamics: ArmDynamics, request: JointTrajectory, share: float = 1.0) -> Retiming:
    """Check the invariants of the fastest timing, and return it."""
    result = retime(dynamics, request, effort_limit_fraction=share)
    trajectory = result.trajectory
    assert largest_ratio(dynamics.arm, trajectory, share) < 1.0 + 2e-5
    assert efforts_along(dynamics, trajectory).worst_ratio <= share * (1.0 + 2e-6)
    ends = [trajectory.points[i] for i in (0, -1)]
    for end, before in zip(ends, (request.points[0], request.points[-1])):
        assert end.velocity == pytest.approx(0.0, abs=1e-12)
        assert end.position == pytest.approx(before.position, abs=1e-9)
    assert distance_from_path(trajectory, request) < 1e-6
    open_limits = MotionLimits(*np.full((5, dynamics.arm.joint_count), OPEN))
    followed, slowness = feasible_trajectory(dynamics, trajectory, open_limits, share)
    assert (followed, slowness) == (trajectory, 1.0)  # the node does not reject it
    slow = slowed_down(dynamics, request, effort_limit_fraction=share)
    assert result.duration <= slow.duration * (1.0 + 1e-4)
    assert largest_ratio(dynamics.arm, slow.trajectory, share) < 1.0 + 1e-4
    assert len(result.limiting_joint) == len(result.limited_quantity) == len(trajectory.points)
    make_trajectory(trajectory.joint_names, *zip(*(
        (p.time_from_start, p.position, p.velocity) for p in trajectory.points)))
    return result


@pytest.mark.parametrize('kind', ['none', 'viscous', 'stribeck', 'motors'])
@pytest.mark.parametrize('name', ['panda', 'z1', 'kinova', 'tiago_no_hand'])
@settings(max_examples=4, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from(['quintics', 'cubics', 'rests']))
def test_limits_hold_on_robots(name: str, kind: str, seed: int, form: str) -> None:
    rng = np.random.default_rng(seed)
    arm = robot(name)
    q = poses(arm, rng.integers(2, 5), rng, 0.5)
    gravity = np.abs(ArmDynamics(frictionless(arm)).gravity_batch(q)).max(axis=0)
    limit = np.where(np.isfinite(arm.limits.effort), arm.limits.effort, 50.0)
    arm = with_friction_and_motors(arm, kind, 0.3 * np.maximum(limit - 1.2 * gravity, 0.0))
    try:
        result = check(ArmDynamics(arm), request_of(form, arm, q), 0.9)
    except TrajectoryError as error:
        assert 'due to gravity' in str(error)  # noqa: PT017
    else:
        assert np.percentile(result.limit_ratio, 50) > 0.98


@laws
@given(st.integers(0, 2**32), st.sampled_from(['quintics', 'cubics', 'rests']))
def test_limits_hold_on_random_arms(seed: int, form: str) -> None:
    rng = np.random.default_rng(seed)
    arm = load_arm(random_urdf(rng))
    n = arm.joint_count
    q = rng.uniform(-1.0, 1.0, (3, n))
    gravity = np.abs(ArmDynamics(frictionless(arm)).gravity_batch(rng.uniform(-3, 3, (50, n))))
    effort = 1.5 * gravity.max(axis=0) + 1.0
    arm = replace(arm, limits=replace(arm.limits, effort=effort, velocity=np.full(n, OPEN)))
    arm = with_friction_and_motors(
        arm, str(rng.choice(['none', 'viscous', 'stribeck'])), 0.2 * effort)
    try:
        check(ArmDynamics(arm), request_of(form, arm, q))
    except TrajectoryError as error:
        assert 'due to gravity' in str(error)  # noqa: PT017


def test_a_payload_takes_time() -> None:
    arm = frictionless(robot('panda'))
    path = quintic_via_points(arm.joint_names, [0, 1, 2], poses(arm, 3, np.random.default_rng(0)))
    loaded = arm.with_payloads([make_payload(arm.link_names[-1], 2.0, (0.0, 0.0, 0.1))])
    without, with_load = (check(ArmDynamics(one), path) for one in (arm, loaded))
    assert with_load.duration > 1.001 * without.duration


def test_a_joint_that_rests_has_no_friction() -> None:
    arm = load_arm(default_arm_urdf())
    arm = arm.with_friction(make_friction(arm.joint_names, coulomb=5.0))
    q = [[0.1, 0.4], [0.9, 0.4], [0.3, 0.4]]
    check(ArmDynamics(arm), quintic_via_points(arm.joint_names, [0, 1, 2], q))


def test_a_joint_that_turns_back_within_a_piece_rests_there() -> None:
    path = make_trajectory(['hinge'], [0.0, 1.0], [[0.0], [0.5]], [[3.0], [0.0]])
    segments = TrajectorySegments(path)
    top = segments.sample(np.zeros(1001, dtype=int), np.linspace(0, 1, 1001)).position.max()
    result = retime(ArmDynamics(hinge()), path)
    ways = np.array([top, top - 0.5])
    assert result.duration == pytest.approx(np.sum(2.0 * np.sqrt(ways * INERTIA / 2.0)), rel=1e-4)


# --- paths without velocities --------------------------------------------------------------------

def test_corners_are_rejected() -> None:
    with pytest.raises(TrajectoryError, match=re.escape(
            "points[1].positions is a corner of the path: its direction changes by 1.89 rad, most "
            "at joint 'joint1', expected at most 0.35 rad")):
        retime(PLANAR, make_trajectory(PLANAR.arm.joint_names, [0, 1, 2], CORNER))


@pytest.mark.parametrize('tolerance', [0.001, 0.02, 0.1])
def test_corners_are_rounded_within_the_tolerance(tolerance: float) -> None:
    path = make_trajectory(PLANAR.arm.joint_names, [0, 1, 2], CORNER)
    result = retime(PLANAR, path, corner_tolerance=tolerance)
    q = sampled(result.trajectory)[0]
    miss = np.linalg.norm(q - np.array(CORNER[1]), axis=1).min()
    assert 0.5 * tolerance < miss <= tolerance
    assert distance_from_path(result.trajectory, path) <= tolerance
    assert largest_ratio(PLANAR.arm, result.trajectory) < 1.0 + 2e-5


def test_larger_tolerances_are_quicker() -> None:
    path = make_trajectory(PLANAR.arm.joint_names, [0, 1, 2], CORNER)
    durations = [retime(PLANAR, path, corner_tolerance=x).duration for x in (0.001, 0.02, 0.1)]
    assert durations == sorted(durations, reverse=True)


def test_a_dense_path_is_that_of_its_curve() -> None:
    curve = quintic_via_points(PLANAR.arm.joint_names, [0, 1, 2], CORNER)
    dense = TrajectorySegments(curve).sample(
        np.repeat([0, 1], 400), np.tile(np.linspace(0.0, 1.0, 400), 2)).position
    dense = np.delete(dense, 400, axis=0)
    path = make_trajectory(PLANAR.arm.joint_names, np.arange(799.0), dense)
    result = retime(PLANAR, path)
    assert result.duration == pytest.approx(retime(PLANAR, curve).duration, rel=1e-3)
    assert distance_from_path(result.trajectory, curve) < 1e-4


def test_a_dense_path_with_a_corner() -> None:
    t = np.linspace(0.0, 2.0, 301)
    q = np.stack([np.interp(t, [0, 1, 2], column) for column in np.transpose(CORNER)], axis=1)
    path = make_trajectory(PLANAR.arm.joint_names, t, q)
    with pytest.raises(TrajectoryError, match=re.escape('points[150].positions is a corner')):
        retime(PLANAR, path)
    result = retime(PLANAR, path, corner_tolerance=0.02)
    sparse = make_trajectory(PLANAR.arm.joint_names, [0, 1, 2], CORNER)
    assert result.duration == pytest.approx(
        retime(PLANAR, sparse, corner_tolerance=0.02).duration, rel=1e-3)


def test_repeated_points_and_pauses_do_not_matter() -> None:
    names = PLANAR.arm.joint_names
    once = retime(PLANAR, make_trajectory(names, [0, 1], CORNER[:2]))
    twice = retime(PLANAR, make_trajectory(
        names, [0, 1, 2, 3], [CORNER[0], CORNER[0], CORNER[1], CORNER[1]]))
    assert twice.duration == pytest.approx(once.duration, rel=1e-6)


def test_noise_within_the_tolerance_does_not_matter() -> None:
    t = np.linspace(0.0, 2.0, 1000)
    curve = np.stack([np.sin(t), np.cos(t)], axis=1)
    noisy = curve + 1e-4 * np.random.default_rng(0).normal(size=curve.shape)
    smooth, noise = (retime(PLANAR, make_trajectory(PLANAR.arm.joint_names, t, q),
                            corner_tolerance=0.005) for q in (curve, noisy))
    assert noise.duration == pytest.approx(smooth.duration, rel=0.01)
    q = sampled(noise.trajectory)[0]
    assert max(np.linalg.norm(q - one, axis=1).min() for one in noisy[::20]) <= 0.005


def test_a_path_rests_where_it_turns_back() -> None:
    path = make_trajectory(['hinge'], [0, 1, 2], [[0.0], [1.0], [0.5]])
    with pytest.raises(TrajectoryError, match=r'points\[1\].* is a corner .* by 3.14 rad'):
        retime(ArmDynamics(hinge()), path)
    result = retime(ArmDynamics(hinge()), path, corner_tolerance=0.01)
    expected = sum(2.0 * np.sqrt(way * INERTIA / 2.0) for way in (1.0, 0.5))
    assert result.duration == pytest.approx(expected, rel=1e-4)
    assert max(point.position[0] for point in result.trajectory.points) == pytest.approx(1.0)


# --- uniform slow-downs --------------------------------------------------------------------------

@pytest.mark.parametrize('duration', [0.2, 0.5])
def test_the_slow_down_is_the_smallest(duration: float) -> None:
    path = quintic_point_to_point(PLANAR.arm.joint_names, [0.0, 0.0], [1.0, 0.5], duration)
    result = slowed_down(PLANAR, path)
    reaches = max(result.limit_ratio.max(),
                  efforts_along(PLANAR, result.trajectory).worst_ratio,
                  np.max(np.abs(sampled(result.trajectory, 999)[1]) / PLANAR.arm.limits.velocity))
    assert reaches == pytest.approx(1.0, abs=1e-4)
    assert result.duration == pytest.approx(result.ratio * duration)


def test_a_feasible_trajectory_is_not_changed() -> None:
    path = quintic_point_to_point(PLANAR.arm.joint_names, [0.0, 0.0], [1.0, 0.5], 5.0)
    result = slowed_down(PLANAR, path)
    assert result.ratio == 1.0
    for before, after in zip(path.points, result.trajectory.points, strict=True):
        assert np.array_equal(before.position, after.position)


# --- rejected requests ---------------------------------------------------------------------------

TWO = [[0.0, 0.0], [0.8, 0.5]]


def planar(times: Any = (0.0, 1.0), q: Any = TWO, *rows: Any) -> JointTrajectory:
    return make_trajectory(PLANAR.arm.joint_names, times, q, *rows)


@pytest.mark.parametrize(('request_', 'options', 'words'), [
    (planar, {'method': 'quick'}, "method is 'quick', expected one of ['fastest', 'slow_down']"),
    (planar, {'corner_tolerance': -1.0}, 'corner_tolerance is -1'),
    (planar, {'corner_tolerance': np.nan}, 'corner_tolerance is nan'),
    (planar, {'effort_limit_fraction': 0.0}, 'effort_limit_fraction is 0'),
    (planar, {'effort_limit_fraction': 1.5}, 'effort_limit_fraction is 1.5'),
    (planar, {'acceleration_limits': [1.0]}, 'acceleration_limits has 1 values, expected 2'),
    (planar, {'acceleration_limits': [1.0, 0.0]}, "acceleration_limits of 'joint2' is 0"),
    (planar, {'method': 'slow_down'}, 'points[0].velocities is empty, expected velocities'),
    (lambda: planar([0.0], TWO[:1]), {}, 'points has 1 point, expected at least 2'),
    (lambda: planar([0, 1], TWO[:1] * 2), {}, 'points are all at the same position [0.0, 0.0]'),
    (lambda: planar([0, 1], TWO, [[0.0, 0.0], []]), {}, 'points[1].velocities is empty, but'),
])
def test_bad_requests_are_rejected_by_name(
    request_: Callable[[], JointTrajectory], options: dict[str, Any], words: str,
) -> None:
    with pytest.raises(InvalidInputError, match=re.escape(words)):
        retime(PLANAR, request_(), **options)


@pytest.mark.parametrize('method', ['fastest', 'slow_down'])
def test_gravity_beyond_a_limit_is_rejected(method: str) -> None:
    arm = PLANAR.arm.with_payloads([make_payload('tool0', 12.0)])
    path = planar([0, 1], [[0.0, 0.0], [1.5, 0.0]], [[0.0, 0.0]] * 2)
    ratio = abs(ArmDynamics(arm).gravity([1.5, 0.0])[0]) / 150.0
    with pytest.raises(TrajectoryError, match=re.escape(
            f"the effort of 'joint1' due to gravity is {ratio:.4g} times its limit at rest at "
            'points[1]')):
        retime(ArmDynamics(arm), path, method)


def test_gravity_between_the_points_is_named_too() -> None:
    arm = PLANAR.arm.with_payloads([make_payload('tool0', 6.0)])
    path = planar([0, 1], [[-0.2, 0.0], [3.2, 0.0]])
    with pytest.raises(TrajectoryError, match=r"'joint1' due to gravity .* near points\[[01]\]"):
        retime(ArmDynamics(arm), path)


def test_friction_at_the_limit_is_rejected() -> None:
    arm = hinge().with_friction(make_friction(['hinge'], coulomb=2.5))
    with pytest.raises(TrajectoryError, match='1.25 times its limit in slow motion'):
        retime(ArmDynamics(arm), quintic_point_to_point(['hinge'], [0.0], [1.5], 3.0))


def test_an_arm_without_limits_is_rejected() -> None:
    arm = hinge(OPEN)
    path = quintic_point_to_point(['hinge'], [0.0], [1.5], 3.0)
    with pytest.raises(TrajectoryError, match='the arm has no limit of velocity, effort, current'):
        retime(ArmDynamics(arm), path)
    assert retime(ArmDynamics(arm), path, acceleration_limits=4.0).duration == pytest.approx(
        2.0 * np.sqrt(1.5 / 4.0), rel=3e-5)


def test_a_motion_that_no_limit_bounds_is_rejected() -> None:
    limits = PLANAR.arm.limits
    arm = replace(PLANAR.arm.with_gravity([0, 0, 0]), limits=replace(
        limits, effort=np.full(2, OPEN), velocity=np.array([OPEN, 1.0])))
    with pytest.raises(TrajectoryError, match=r"no limit applies to the motion of \['joi"):
        retime(ArmDynamics(arm), planar(q=[[0.0, 0.3], [1.0, 0.3]]))


@pytest.mark.parametrize('quantity', ['velocity', 'effort'])
def test_a_limit_of_zero_is_rejected(quantity: str) -> None:
    limits = replace(PLANAR.arm.limits, **{quantity: np.array([1.0, 0.0])})
    with pytest.raises(TrajectoryError, match=f"the {quantity} limit of 'joint2' is 0"):
        retime(ArmDynamics(replace(PLANAR.arm, limits=limits)), planar())


def test_positions_beyond_limits_are_warnings() -> None:
    arm = hinge(velocity=1.0)
    path = make_trajectory(['hinge'], [0.0, 1.0], [[0.0], [6.0]])
    warning, = retime(ArmDynamics(arm), path).warnings
    assert warning.startswith("position of 'hinge' is 6 at ")
